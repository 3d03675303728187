"""The objective of nominal belief-state optimisation (NBO): traces, errors or information, and the MWTP, compiled."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planning.objective.cost_to_go import NO_COST_TO_GO, CostToGo, lower_times_to_view, replace_by_future_errors
from planning.objective.mwtp import add_penalties
from planning.objective.terms import Objective
from planning.prediction.predicted_belief import (
    LANES,
    PredictedBelief,
    add_information,
    advance_belief,
    advance_with_gains,
    possibly_visible,
)
from planning.prediction.quadrangle import inside
from tracking.metrics.squared_error import cut_off
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, inlined

_TRIANGLE = ((0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3))


class Measure(NamedTuple):
    """Measure of the uncertainty of a target after a step."""

    gains: bool  # True: minus the gain of information [nats]; False: the trace [m²]
    cutoff: float  # m, at which errors are cut off; infinite: the trace itself
    ahead: CostToGo = NO_COST_TO_GO  # errors after the horizon; needs a finite cut-off


TRACE = Measure(gains=False, cutoff=np.inf)


def make_objective(
    belief: PredictedBelief,
    velocities: Array,
    uavs: Sequence[int],
    beta: float,
    samples: int = 1,
    measure: Measure = TRACE,
) -> Objective:
    """The objective [m² or nats] as a function of candidates (N, k, H, 2) m/s for k UAVs; the others fly `velocities`.

    Velocities are means over a step: with them [Li22] eq. (5) holds for UAVs with any lag (`prediction.response`).
    The objective sums tr P (position block) times the target's weight over steps and targets, and adds for beta > 0
    the MWTP of Algorithm 2 on weighted traces. Each P is updated with the information of all UAVs that see the target
    at its predicted position ([Li22] eq. (11) with C̃ of eq. (7)). If a target has several equally probable
    trajectories, each has its own P, and the mean of their traces counts. The contribution of the others is the same
    for all candidates and computed once.

    Note: as in [Li22], a UAV makes one measurement of a target in view at the end of each step. Trackers get one from
    every frame, by default five in a step of 1 s, so beliefs in people in view become narrower than predicted.

    Args:
        belief: Belief predicted over the horizon.
        velocities: Mean velocities (n, H, 2) m/s of all UAVs.
        uavs: Rows of the k UAVs that decide.
        beta: Weight of the MWTP.
        samples: Number of sets of targets, over which the mean is taken.
        measure: Replaces each trace by the expected squared error up to a cut-off (`squared_error.cut_off`), or by
            minus the mutual information between targets' paths and all measurements (`advance_with_gains`). A learned
            cost-to-go adds the errors to be expected after the horizon (`cost_to_go.FUTURE`).
    """
    deciding = np.asarray(uavs, dtype=np.int64)
    others = _predict_others(belief, np.ascontiguousarray(velocities, dtype=float), deciding, measure)

    def values(candidates: Array, ease: Array | None = None) -> Array:
        eased = belief
        if ease is not None:  # the margins of wider fields of view may lack some of the trees that hide targets
            eased = belief._replace(views=belief.views.copy())
            eased.views[deciding, :4, 2] += belief.step * ease[:, None]
        return _compute_costs(eased, others, np.ascontiguousarray(candidates, dtype=float), beta, samples)

    return values


class _Others(NamedTuple):
    """Contribution of the UAVs that do not decide; rows count (step, target, trajectory) triples."""

    uavs: Indices  # (k,) UAVs that decide
    information: Array  # (H T K, 3): xx, xy, yy
    before: Array  # (H T K, 10): P before each step with this information alone, as one lane of `advance_belief`
    costs: Array  # (H T K,) m² or nats: weighted `measure` of the position block of this P after each step
    ends: Array  # (n, 2): x, y [m] at the end
    seen: Flags  # (T,): targets in their fields of view at the end
    finals: Array  # (T K,) m²: trace of the position block of P after the last step
    seconds: Array  # (T,): from there until one of these UAVs can have the target in view; infinite without any
    measure: Measure


class _CameraLanes(NamedTuple):
    """Paths of the cameras of k UAVs in C groups of LANES plans."""

    cameras: Array  # (C, k, H, 2, LANES) m
    boxes: Array  # (C, k, H, 4) m: x0, x1, y0, y1 of the bounding box of a group


@compiled
def _trace_cameras(belief: PredictedBelief, uavs: Indices, plans: Array) -> _CameraLanes:
    """Camera paths of plans of mean velocities (N, k, H, 2) m/s; the last plan fills spare lanes."""
    groups, steps = (len(plans) + LANES - 1) // LANES, plans.shape[2]
    cameras, boxes = np.empty((groups, len(uavs), steps, 2, LANES)), np.empty((groups, len(uavs), steps, 4))
    for g in range(groups):
        for j in range(len(uavs)):
            for axis in range(2):
                start, now = belief.positions[uavs[j], axis], cameras[g, j, 0, axis]
                for lane in range(LANES):
                    now[lane] = start
                for step in range(steps):
                    low, high = np.inf, -np.inf
                    before, now = now, cameras[g, j, step, axis]
                    for lane in range(LANES):
                        at = before[lane] + belief.step * plans[min(g * LANES + lane, len(plans) - 1), j, step, axis]
                        now[lane] = at
                        low, high = min(low, at), max(high, at)
                    boxes[g, j, step, 2 * axis], boxes[g, j, step, 2 * axis + 1] = low, high
    return _CameraLanes(cameras, boxes)


@compiled
def _compute_costs(belief: PredictedBelief, others: _Others, own: Array, beta: float, samples: int) -> Array:
    result, weight = np.empty(len(own)), others.measure.ahead.weight
    finals, total, sums = np.empty((len(others.finals), LANES)), np.empty(LANES), np.empty(LANES)
    if len(own) == 0:
        return result
    flights = _trace_cameras(belief, others.uavs, own)
    in_reach = _find_targets_in_reach(belief, others.uavs, flights.boxes)
    for index in range(len(finals) if beta > 0.0 or weight > 0.0 else 0):
        _fill(finals[index], others.finals[index : index + 1])  # those out of reach stay as they are
    for first in range(0, len(own), LANES):
        cameras, boxes = flights.cameras[first // LANES], flights.boxes[first // LANES]
        _sum(belief, others, cameras, possibly_visible(belief, others.uavs, boxes, in_reach), in_reach, finals, total)
        if beta > 0.0:
            _penalise(belief, others, cameras[:, -1], finals, samples, sums)
            _add(sums, beta, total)
        if weight > 0.0:
            _look_ahead(belief, others, cameras[:, -1], finals, sums)
            _add(sums, weight / belief.step, total)
        for lane in range(min(LANES, len(own) - first)):
            result[first + lane] = total[lane] / samples
    return result


@compiled
def _find_targets_in_reach(belief: PredictedBelief, uavs: Indices, boxes: Array) -> Flags:
    """Mask (T,) of targets that may be in view in any of C groups of plans, with boxes (C, k, H, 4) m."""
    whole, count = boxes[0].copy(), belief.points.shape[2]
    for g in range(len(boxes)):
        for j in range(len(uavs)):
            for step in range(boxes.shape[2]):
                for low in (0, 2):
                    whole[j, step, low] = min(whole[j, step, low], boxes[g, j, step, low])
                    whole[j, step, low + 1] = max(whole[j, step, low + 1], boxes[g, j, step, low + 1])
    in_reach = np.zeros(belief.points.shape[1], dtype=np.bool_)
    may = possibly_visible(belief, uavs, whole, ~in_reach)
    for row in range(len(may)):
        in_reach[row // count % len(in_reach)] |= may[row]
    return in_reach


@compiled
def _sum(
    belief: PredictedBelief, others: _Others, cameras: Array, near: Flags, in_reach: Flags, finals: Array, total: Array
) -> None:
    """Set the `total` (LANES,) of weighted costs, and the traces `finals` (T K, LANES) [m²] of targets `in_reach` (T,).

    cameras (k, H, 2, LANES) m; near (H T K,): points that they may see, all of targets in reach.
    """
    P, information, trace, free = np.empty(10 * LANES), np.empty(3 * LANES), np.empty(LANES), np.empty(LANES)
    count, each = belief.points.shape[2], len(finals)  # trajectories of one target, and of all
    gains, cutoff = others.measure.gains, others.measure.cutoff  # here, as taking them from a tuple takes time
    shared = 0.0  # costs that are the same in all lanes
    total[:] = 0.0
    for index in range(each):
        if not in_reach[index // count]:
            for row in range(index, len(near), each):
                shared += others.costs[row]
            continue
        weight, tracked = belief.weights[index // count] / count, False  # tracked: a deciding UAV has seen it
        _fill(finals[index], others.finals[index : index + 1])
        for row in range(index, len(near), each):
            if near[row] or tracked:
                _fill(information, others.information[row])
            seen = tracked
            for j in range(len(others.uavs) if near[row] else 0):
                seen |= add_information(belief, others.uavs[j], cameras[j, row // each], row, information, free)
            if not seen:
                shared += others.costs[row]
                continue
            if not tracked:
                _fill(P, others.before[row])
            tracked = True
            _advance(P, belief, information, gains, cutoff, trace)
            _add(trace, weight, total)
        for lane in range(LANES if tracked else 0):
            finals[index, lane] = P[lane] + P[4 * LANES + lane]
    total += shared


@inlined
def _advance(P: Array, belief: PredictedBelief, information: Array, gains: bool, cutoff: float, costs: Array) -> None:
    """`advance_belief` of P over a step, with `costs` (LANES,) by the measure."""
    if gains:
        advance_with_gains(P, belief.transition, belief.noise, information, costs)
    else:
        advance_belief(P, belief.transition, belief.noise, information)
        for lane in range(LANES):
            costs[lane] = P[lane] + P[4 * LANES + lane]
        cut_off(costs, cutoff)


@inlined
def _add(trace: Array, weight: float, total: Array) -> None:
    for lane in range(LANES):
        total[lane] += weight * trace[lane]


@inlined
def _fill(lanes: Array, values: Array) -> None:
    """Set all lanes of (m LANES,) to the same m values."""
    for k in range(len(values)):
        value = values[k]
        for lane in range(LANES):  # a loop, because assigning to a slice takes much longer
            lanes[k * LANES + lane] = value


@compiled
def _penalise(belief: PredictedBelief, others: _Others, own: Array, finals: Array, samples: int, sums: Array) -> None:
    """Set `sums` (LANES,) to the MWTP summed over the samples of targets.

    own (k, 2, LANES) m: final positions of the deciding UAVs; finals (T K, LANES) m².
    """
    points, each = belief.points[-1, :, 0], belief.points.shape[1] // samples
    costs, count = np.zeros((len(belief.weights), LANES)), belief.points.shape[2]
    for index in range(len(finals)):
        errors = finals[index].copy()
        cut_off(errors, others.measure.cutoff)
        _add(errors, belief.weights[index // count] / count, costs[index // count])
    sums[:] = 0.0
    for first in range(0, len(points), max(each, 1)):
        last = first + each
        targets, weighted, seen = points[first:last], costs[first:last], others.seen[first:last]
        add_penalties(targets, weighted, seen, others.ends, others.uavs, own, belief.views, sums)


@compiled
def _look_ahead(belief: PredictedBelief, others: _Others, own: Array, finals: Array, sums: Array) -> None:
    """Set `sums` (LANES,) to the weighted cost-to-go [m² s] of the targets; arguments as of `_penalise`.

    The time until a target can be in view is computed for its mean; its trace is the mean over its trajectories.
    """
    ahead, count = others.measure.ahead, belief.points.shape[2]
    seconds, trace = np.empty(LANES), np.empty(LANES)
    sums[:] = 0.0
    for t in range(len(others.seconds)):
        seconds[:] = others.seconds[t]
        for j in range(len(others.uavs)):
            lower_times_to_view(seconds, belief, ahead, t, others.uavs[j], own[j])
        trace[:] = 0.0
        for index in range(t * count, (t + 1) * count):
            _add(finals[index], 1.0 / count, trace)
        replace_by_future_errors(seconds, trace, others.measure.cutoff)
        _add(seconds, belief.weights[t], sums)


@compiled
def _predict_others(belief: PredictedBelief, velocities: Array, uavs: Indices, measure: Measure) -> _Others:
    """Contribution of the UAVs other than `uavs` with their mean velocities (n, H, 2) m/s."""
    targets, each = belief.points.shape[1], belief.points.shape[1] * belief.points.shape[2]
    rows = belief.points.shape[0] * each
    others = _Others(
        uavs,
        np.zeros((rows, 3)),
        np.empty((rows, 10)),
        np.empty(rows),
        np.zeros((len(velocities), 2)),
        np.zeros(targets, dtype=np.bool_),
        np.empty(each),
        np.full(targets, np.inf),
        measure,
    )
    _add_others(belief, velocities, others)
    P, information, costs = np.empty(10 * LANES), np.empty(3 * LANES), np.empty(LANES)
    count, gains, cutoff = belief.points.shape[2], measure.gains, measure.cutoff
    for first in range(0, each, LANES):  # the lanes are trajectories here
        lanes = np.minimum(np.arange(first, first + LANES), each - 1)
        for lane in range(LANES):
            for k, (i, j) in enumerate(_TRIANGLE):
                P[k * LANES + lane] = belief.covariances[lanes[lane] // count, i, j]
        for before in range(0, rows, each):
            for lane in range(LANES):
                for k in range(10):
                    others.before[before + lanes[lane], k] = P[k * LANES + lane]
                for k in range(3):
                    information[k * LANES + lane] = others.information[before + lanes[lane], k]
            _advance(P, belief, information, gains, cutoff, costs)
            for lane in range(LANES):
                others.costs[before + lanes[lane]] = belief.weights[lanes[lane] // count] / count * costs[lane]
        for lane in range(LANES):
            others.finals[lanes[lane]] = P[lane] + P[4 * LANES + lane]
    return others


@compiled
def _add_others(belief: PredictedBelief, velocities: Array, others: _Others) -> None:
    """Set the information of the UAVs that do not decide, their final positions and the targets in view there."""
    steps = belief.points.shape[0]
    information, free = np.empty(3 * LANES), np.empty(LANES)
    for i in range(len(velocities)):
        if i in others.uavs:
            continue
        flight = _trace_cameras(belief, np.array([i]), velocities[i : i + 1].reshape(1, 1, steps, 2))
        cameras = flight.cameras[0, 0]
        others.ends[i, 0], others.ends[i, 1] = cameras[-1, 0, 0], cameras[-1, 1, 0]
        for t in range(len(others.seen)):
            place = belief.points[-1, t, 0]
            others.seen[t] |= inside(belief.views[i], place[0] - others.ends[i, 0], place[1] - others.ends[i, 1])
        for t in range(len(others.seconds) if others.measure.ahead.weight > 0.0 else 0):
            free[:] = others.seconds[t]
            lower_times_to_view(free, belief, others.measure.ahead, t, i, cameras[-1])
            others.seconds[t] = free[0]
        near = possibly_visible(belief, np.array([i]), flight.boxes[0], np.ones(len(others.seen), dtype=np.bool_))
        for row in range(len(near)):
            if near[row]:
                _fill(information, others.information[row])
                add_information(belief, i, cameras[row * steps // len(near)], row, information, free)
                for k in range(3):  # assigning an array would take 2 s to compile, for its error
                    others.information[row, k] = information[k * LANES]
