"""The objective of nominal belief-state optimisation (NBO) and its terminal penalty (MWTP), compiled."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planning.belief import Outlook, observe, transition
from planning.view import inside, shortest_move
from tracking.compiled import Array, compiled


def team_cost(outlook: Outlook, controls: Array, beta: float, samples: int = 1) -> float:
    """Objective of one joint plan (n, H, 2) m/s: `costs` with a single candidate."""
    return float(costs(outlook, controls, range(len(controls)), controls[None], beta, samples)[0])


def costs(
    outlook: Outlook, controls: Array, uavs: Sequence[int], candidates: Array, beta: float, samples: int = 1
) -> Array:
    """Objective (N,) m² of `candidates` (N, k, H, 2) m/s for k UAVs while the others fly `controls` (n, H, 2).

    Σ over steps and targets of tr P (position block), each P updated with the information of all UAVs that see
    the target where the outlook has it ([Li22] eq. (11) with C̃ of eq. (7)), plus, for beta > 0, the MWTP of
    Algorithm 2; the mean over `samples` sets of targets. Candidates share what the others contribute, so that is
    computed once.
    """
    chosen = np.asarray(uavs, dtype=np.int64)
    return _costs(
        outlook,
        _paths(outlook.positions, controls, outlook.step),
        chosen,
        _paths(outlook.positions[chosen], candidates, outlook.step),
        beta,
        samples,
    )


def _paths(positions: Array, controls: Array, step: float) -> Array:
    """Where cameras (..., n, H, 3) m get by controls (..., n, H, 2) m/s from positions (n, 3) m ([Li22] eq. (5))."""
    path = np.empty((*controls.shape[:-1], 3))
    path[..., :2] = positions[:, None, :2] + step * np.cumsum(controls, axis=-2)
    path[..., 2] = positions[:, None, 2]
    return path


@compiled
def _costs(outlook: Outlook, fleet: Array, uavs: NDArray[np.int64], own: Array, beta: float, samples: int) -> Array:
    others, before, unseen = _without(outlook, fleet, uavs)
    result = np.zeros(len(own))
    traces = np.empty(outlook.points.shape[1])
    information, seen = np.empty_like(others), np.empty(len(others), dtype=np.bool_)
    P = np.empty((4, 4))
    for c in range(len(own)):
        information[:], seen[:] = others, False
        for j in range(len(uavs)):
            observe(outlook, uavs[j], own[c, j], information, seen)
        for t in range(len(traces)):
            tracked = False  # whether P differs from what the others alone make of it
            for row in range(t, len(others), len(traces)):
                if seen[row] and not tracked:
                    P[:] = before[row]
                    tracked = True
                if tracked:
                    transition(P, outlook.step, outlook.noise, information[row])
                    traces[t] = P[0, 0] + P[1, 1]
                else:
                    traces[t] = unseen[row]
                result[c] += traces[t]
        if beta > 0.0:
            result[c] += beta * _penalties(outlook, traces, _ends(fleet, uavs, own[c]), samples)
    return result / samples


@compiled
def _ends(fleet: Array, uavs: NDArray[np.int64], own: Array) -> Array:
    """Where the fleet is at the end (n, 2) if `uavs` take their own paths (k, H, 3), and the others those of before."""
    ends = fleet[:, -1, :2].copy()
    for j in range(len(uavs)):
        ends[uavs[j]] = own[j, -1, :2]
    return ends


@compiled
def _penalties(outlook: Outlook, traces: Array, ends: Array, samples: int) -> float:
    """Sum over samples, each a set of targets in turn, of the MWTP with sensors at `ends` (n, 2) m."""
    each = len(traces) // samples
    total = 0.0
    for s in range(samples):
        rows = slice(s * each, (s + 1) * each)
        total += weighted_trace_penalty(outlook.points[-1, rows, 0], traces[rows], ends.copy(), outlook.views)
    return total


@compiled
def _without(outlook: Outlook, fleet: Array, uavs: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Information (H T, 3) of UAVs other than `uavs`, and with it alone P before and its trace after each step.

    P (H T, 4, 4), trace of its position block (H T,).
    """
    steps, targets = outlook.points.shape[0], outlook.points.shape[1]
    others, seen = np.zeros((steps * targets, 3)), np.zeros(steps * targets, dtype=np.bool_)
    for i in range(len(fleet)):
        if not np.any(uavs == i):
            observe(outlook, i, fleet[i], others, seen)
    before, traces = np.empty((steps * targets, 4, 4)), np.empty(steps * targets)
    P = np.empty((4, 4))
    for t in range(targets):
        P[:] = outlook.covariances[t]
        for step in range(steps):
            row = step * targets + t
            before[row] = P
            transition(P, outlook.step, outlook.noise, others[row])
            traces[row] = P[0, 0] + P[1, 1]
    return others, before, traces


@compiled
def weighted_trace_penalty(targets: Array, traces: Array, sensors: Array, views: Array) -> float:
    """Multiple weighted trace penalty, [Li22] Algorithm 2 with β = 1 [m³].

    targets (T, 2 or 3) m at the end of the horizon, traces (T,) m² of their position covariance, sensors (n, 2) m,
    views (n, 5, 3): their fields of view, see `planning.view.quadrangle`. `sensors` is overwritten with the positions
    p^MDO.

    Note: distances are counted from where a camera looks, which the paper's cameras do straight down.
    Note: T is the set outside all fields of view as geometry; a target in view but hidden is not in it, because
    p^MDO, the least displacement after which the field of view covers the target, would be where the sensor is.
    """
    distance = np.zeros(len(sensors))  # D_i
    penalty = 0.0
    seen = _covered(targets, sensors, views)
    for t in np.argsort(-traces, kind="mergesort"):
        if seen[t]:
            continue
        nearest, shortest = _nearest(targets[t], sensors, views, distance)
        if distance[nearest] == 0.0:
            penalty += shortest * traces[t]
        distance[nearest] += shortest
        dx, dy = targets[t, 0] - sensors[nearest, 0], targets[t, 1] - sensors[nearest, 1]
        move_x, move_y = shortest_move(views, nearest, dx, dy)
        sensors[nearest, 0] += move_x
        sensors[nearest, 1] += move_y
    return penalty


@compiled
def _covered(targets: Array, sensors: Array, views: Array) -> NDArray[np.bool_]:
    covered = np.zeros(len(targets), dtype=np.bool_)
    for t in range(len(targets)):
        for i in range(len(sensors)):
            dx, dy = targets[t, 0] - sensors[i, 0], targets[t, 1] - sensors[i, 1]
            covered[t] |= inside(views, i, dx, dy)
    return covered


@compiled
def _nearest(target: Array, sensors: Array, views: Array, distance: Array) -> tuple[int, float]:
    best, shortest, total = 0, 0.0, np.inf
    for i in range(len(sensors)):
        d = math.hypot(target[0] - sensors[i, 0] - views[i, 4, 0], target[1] - sensors[i, 1] - views[i, 4, 1])
        if distance[i] + d < total:
            best, shortest, total = i, d, distance[i] + d
    return best, shortest
