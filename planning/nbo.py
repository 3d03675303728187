"""The objective of nominal belief-state optimisation (NBO) and its terminal penalty (MWTP), compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planning.belief import Outlook, add_information, transition
from planning.view import inside, shortest_move
from tracking.compiled import Array, compiled


def team_cost(outlook: Outlook, controls: Array, beta: float) -> float:
    """Objective of one joint plan (n, H, 2) m/s: `costs` with a single candidate."""
    return float(costs(outlook, controls, 0, controls[:1], beta)[0])


def costs(outlook: Outlook, controls: Array, uav: int, candidates: Array, beta: float) -> Array:
    """Objective (N,) m² of `candidates` (N, H, 2) m/s for one UAV while the others fly `controls` (n, H, 2).

    Σ over steps and targets of tr P (position block), each P updated with the information of all UAVs that see
    the nominal target ([Li22] eq. (11) with C̃ of eq. (7)), plus, for beta > 0, the MWTP of Algorithm 2.
    Candidates of one UAV share what the others contribute, so that is computed once.
    """
    return _costs(
        outlook,
        _paths(outlook.positions, controls, outlook.step),
        uav,
        _paths(outlook.positions[uav : uav + 1], candidates, outlook.step),
        beta,
    )


def _paths(positions: Array, controls: Array, step: float) -> Array:
    """Where cameras (N, H, 3) m get by controls (N, H, 2) m/s from positions (N or 1, 3) m ([Li22] eq. (5))."""
    path = np.empty((*controls.shape[:2], 3))
    path[:, :, :2] = positions[:, None, :2] + step * np.cumsum(controls, axis=1)
    path[:, :, 2] = positions[:, None, 2]
    return path


@compiled
def _costs(outlook: Outlook, fleet: Array, uav: int, own: Array, beta: float) -> Array:
    steps, targets = outlook.nominal.shape[0], outlook.nominal.shape[1]
    others = np.zeros((steps * targets, 3))
    for i in range(len(fleet)):
        if i != uav:
            for cell in range(steps * targets):
                add_information(outlook, i, fleet[i, cell // targets], cell, others[cell])
    result = np.zeros(len(own))
    ends = np.empty((len(fleet), 2))
    traces = np.empty(targets)
    information = np.empty(3)
    P = np.empty((4, 4))
    for c in range(len(own)):
        for t in range(targets):
            P[:] = outlook.covariances[t]
            for step in range(steps):
                cell = step * targets + t
                information[:] = others[cell]
                add_information(outlook, uav, own[c, step], cell, information)
                transition(P, outlook.step, outlook.noise, information)
                result[c] += P[0, 0] + P[1, 1]
            traces[t] = P[0, 0] + P[1, 1]
        if beta > 0.0:
            ends[:] = fleet[:, -1, :2]
            ends[uav] = own[c, -1, :2]
            result[c] += beta * weighted_trace_penalty(outlook.nominal[-1], traces, ends, outlook.views)
    return result


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
