"""The objective of nominal belief-state optimisation (NBO) and its terminal penalty (MWTP), compiled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planning.objective.mwtp import cover
from planning.objective.mwtp_lanes import Workspace, cover_lanes, penalties, workspace
from planning.prediction.belief import LANES, Outlook, may_see, observe, transition
from planning.prediction.targets_in_reach import Eased
from tracking.numerics.compiled import Array, compiled

_TRIANGLE = ((0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3))


def team_cost(outlook: Outlook, controls: Array, beta: float, samples: int = 1) -> float:
    """Objective of one joint plan (n, H, 2) m/s: `costs` with a single candidate."""
    return float(costs(outlook, controls, range(len(controls)), controls[None], beta, samples)[0])


def costs(
    outlook: Outlook, controls: Array, uavs: Sequence[int], candidates: Array, beta: float, samples: int = 1
) -> Array:
    """Objective (N,) m² of `candidates` (N, k, H, 2) m/s for k UAVs while the others fly `controls` (n, H, 2)."""
    return objective(outlook, controls, uavs, beta, samples)(candidates)


def objective(outlook: Outlook, controls: Array, uavs: Sequence[int], beta: float, samples: int = 1) -> Eased:
    """The objective [m²] as a function of candidates (N, k, H, 2) m/s for k UAVs; the others fly `controls` (n, H, 2).

    Σ over steps and targets of tr P (position block) times the target's weight, each P updated with the information
    of all UAVs that see the target where the outlook has it ([Li22] eq. (11) with C̃ of eq. (7)), plus, for beta > 0,
    the MWTP of Algorithm 2 on weighted traces; the mean over `samples` sets of targets. Candidates share what the
    others contribute, so that is computed once.
    """
    rest = _without(outlook, np.ascontiguousarray(controls, dtype=float), np.asarray(uavs, dtype=np.int64))

    def values(candidates: Array, ease: Array | None = None) -> Array:
        seen = outlook if ease is None else _eased(outlook, uavs, ease)
        return _costs(seen, rest, np.ascontiguousarray(candidates, dtype=float), beta, samples)

    return values


def _eased(outlook: Outlook, uavs: Sequence[int], ease: Array) -> Outlook:
    """The outlook with wider fields of view; what they show beyond the true ones may lack trees."""
    views = outlook.views.copy()
    views[list(uavs), :4, 2] += outlook.step * ease[:, None]
    return outlook._replace(views=views)


class Ends(NamedTuple):
    """What a joint plan leaves at the end of the horizon, as the MWTP takes it."""

    targets: Array  # (T, 3) m
    traces: Array  # (T,) m² of position, times the target's weight
    seen: NDArray[np.bool_]  # (T,): in some field of view, hidden or not
    sensors: Array  # (n, 3): x, y [m] and D_i, which is 0


def ends(outlook: Outlook, controls: Array) -> Ends:
    """What a joint plan (n, H, 2) m/s comes to, with one sample of targets."""
    rest = _without(outlook, np.ascontiguousarray(controls, dtype=float), np.empty(0, dtype=np.int64))
    count = len(outlook.weights)
    traces = outlook.weights * rest.traces[len(rest.traces) - count :]
    return Ends(np.ascontiguousarray(outlook.points[-1, :, 0]), traces, rest.seen, rest.ends)


class _Rest(NamedTuple):
    """Who decides, and what the other UAVs contribute; rows count (step, target) pairs."""

    uavs: NDArray[np.int64]  # (k,) that decide
    information: Array  # (H T, 3): xx, xy, yy
    before: Array  # (H T, 10): with it alone, P before each step, as in one lane of `belief.transition`
    traces: Array  # (H T,) m² of its position block after each step
    ends: Array  # (n, 3): x, y [m] at the end, and 0: the D_i of the MWTP at first
    seen: NDArray[np.bool_]  # (T,): which targets they have in their fields of view at the end


class _Flight(NamedTuple):
    """Where LANES plans of k UAVs take their cameras."""

    cameras: Array  # (k, H, 2, LANES) m
    boxes: Array  # (k, H, 4) m: x0, x1, y0, y1 of what holds them


@compiled
def _costs(outlook: Outlook, rest: _Rest, own: Array, beta: float, samples: int) -> Array:
    result = np.empty(len(own))
    steps, targets = outlook.points.shape[0], outlook.points.shape[1]
    flight = _Flight(np.empty((len(rest.uavs), steps, 2, LANES)), np.empty((len(rest.uavs), steps, 4)))
    traces, total, sums = np.empty((targets, LANES)), np.empty(LANES), np.empty(LANES)
    work = workspace(targets // samples, len(outlook.positions))
    for first in range(0, len(own), LANES):
        plans = own[first : first + LANES]
        _fly(outlook, rest.uavs, plans, flight)
        _sum(outlook, rest, flight, traces, total)
        if beta > 0.0:
            _penalise(outlook, rest, flight.cameras[:, -1], traces, work, sums)
            for lane in range(LANES):
                total[lane] += beta * sums[lane]
        result[first : first + LANES] = total[: len(plans)]
    return result / samples


@compiled
def _fly(outlook: Outlook, uavs: NDArray[np.int64], plans: Array, flight: _Flight) -> None:
    """Set where up to LANES plans (N, k, H, 2) m/s take cameras ([Li22] eq. (5)); the last fills lanes left over."""
    cameras, boxes = flight
    for j in range(len(uavs)):
        for axis in range(2):
            start, now = outlook.positions[uavs[j], axis], cameras[j, 0, axis]
            for lane in range(LANES):
                now[lane] = start
            for step in range(cameras.shape[1]):
                low, high = np.inf, -np.inf
                before, now = now, cameras[j, step, axis]
                for lane in range(LANES):
                    at = before[lane] + outlook.step * plans[min(lane, len(plans) - 1), j, step, axis]
                    now[lane] = at
                    low, high = min(low, at), max(high, at)
                boxes[j, step, 2 * axis], boxes[j, step, 2 * axis + 1] = low, high


@compiled
def _sum(outlook: Outlook, rest: _Rest, flight: _Flight, traces: Array, total: Array) -> None:
    """Set the weighted `traces` (T, LANES) at the end of the horizon, and `total` (LANES,) over steps and targets."""
    P, information = np.empty(10 * LANES), np.empty(3 * LANES)
    near = may_see(outlook, rest.uavs, flight.boxes)
    shared = 0.0  # what all lanes have in common
    total[:] = 0.0
    for t in range(len(traces)):
        tracked, weight, trace = False, outlook.weights[t], traces[t]  # tracked: whether P differs from the others'
        for row in range(t, len(rest.traces), len(traces)):
            some = np.any(near[row])
            if some or tracked:
                _fill(information, rest.information[row])
            seen = tracked
            for j in range(len(rest.uavs) if some else 0):
                seen |= observe(outlook, rest.uavs[j], flight.cameras[j, row // len(traces)], row, near, information)
            if not seen:
                shared += weight * rest.traces[row]
                continue
            if not tracked:
                _fill(P, rest.before[row])
            tracked = True
            transition(P, outlook.step, outlook.noise, information, trace)
            _add(trace, weight, total)
        if not tracked:
            trace[:] = weight * rest.traces[len(rest.traces) - len(traces) + t]
    total += shared


@compiled
def _add(trace: Array, weight: float, total: Array) -> None:
    """Weigh traces (LANES,) and add them to the total."""
    for lane in range(LANES):
        trace[lane] *= weight
        total[lane] += trace[lane]


@compiled
def _fill(lanes: Array, values: Array) -> None:
    """Set all lanes of (m LANES,) to the same m values."""
    for k in range(len(values)):
        value = values[k]
        for lane in range(LANES):  # a loop, because assigning to a slice takes much longer
            lanes[k * LANES + lane] = value


@compiled
def _penalise(outlook: Outlook, rest: _Rest, own: Array, traces: Array, work: Workspace, sums: Array) -> None:
    """Set `sums` (LANES,) over sets of targets, one for each sample, of the MWTP with `uavs` at `own` (k, 2, LANES) m.

    traces (T, LANES) m².
    """
    each, points, ends = len(work.unseen), outlook.points[-1, :, 0], rest.ends
    sums[:] = 0.0
    for first in range(0, len(traces), max(each, 1)):
        targets, seen = points[first : first + each], rest.seen[first : first + each]
        if np.all(seen):
            continue
        for i in range(len(ends)):
            for axis in range(3):
                work.sensors[i, axis, :] = ends[i, axis]
        for t in range(each):
            work.unseen[t, :] = 0.0 if seen[t] else 1.0
        for j in range(len(rest.uavs)):
            work.sensors[rest.uavs[j], :2] = own[j]
            cover_lanes(work, targets, rest.uavs[j], outlook.views)
        penalties(work, targets, traces[first : first + each], outlook.views, sums)


@compiled
def _without(outlook: Outlook, controls: Array, uavs: NDArray[np.int64]) -> _Rest:
    """What others than `uavs` contribute by their controls (n, H, 2) m/s."""
    steps, targets = outlook.points.shape[0], outlook.points.shape[1]
    rest = _Rest(
        uavs,
        np.zeros((steps * targets, 3)),
        np.empty((steps * targets, 10)),
        np.empty(steps * targets),
        np.zeros((len(controls), 3)),
        np.zeros(targets, dtype=np.bool_),
    )
    _add_others(outlook, controls, rest)
    P, information, trace = np.empty(10 * LANES), np.empty(3 * LANES), np.empty(LANES)
    for t in range(targets):
        for k, (i, j) in enumerate(_TRIANGLE):
            P[k * LANES : (k + 1) * LANES] = outlook.covariances[t, i, j]
        for row in range(t, steps * targets, targets):
            rest.before[row] = P[::LANES]
            _fill(information, rest.information[row])
            transition(P, outlook.step, outlook.noise, information, trace)
            rest.traces[row] = trace[0]
    return rest


@compiled
def _add_others(outlook: Outlook, controls: Array, rest: _Rest) -> None:
    """Set in `rest` the information of UAVs that do not decide, where they end, and what they have in view there."""
    steps, targets = outlook.points.shape[0], outlook.points.shape[1]
    flight = _Flight(np.empty((1, steps, 2, LANES)), np.empty((1, steps, 4)))
    information = np.empty(3 * LANES)
    for i in range(len(controls)):
        if np.any(rest.uavs == i):
            continue
        _fly(outlook, np.array([i]), controls[i : i + 1].reshape(1, 1, steps, 2), flight)
        rest.ends[i, :2] = flight.cameras[0, -1, :, 0]
        cover(outlook.points[-1, :, 0], rest.seen, rest.ends, outlook.views, i)
        near = may_see(outlook, np.array([i]), flight.boxes)
        for row in range(len(near)):
            if not np.any(near[row]):
                continue
            _fill(information, rest.information[row])
            observe(outlook, i, flight.cameras[0, row // targets], row, near, information)
            rest.information[row] = information[::LANES]
