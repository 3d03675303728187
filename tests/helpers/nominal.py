"""Teams that know of one another, and nominal beliefs and their cost, computed plainly."""

import dataclasses
import itertools
import math

import numpy as np
from scipy.stats import norm

from planning.planner import Plan
from planning.prediction.propagation import Nominal
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT


def nominal(situation, horizon):
    """Nominal beliefs as compiled code takes them; nothing in them is by chance."""
    return Nominal().predict(situation, horizon, np.random.default_rng(0))


def plain_mwtp(targets, traces, sensors, reach):
    """Algorithm 2 of [Li22], line by line, with beta = 1."""
    sensors = [np.array(s, dtype=float) for s in sensors]
    outside = [
        t
        for t in range(len(targets))
        if not any(np.max(np.abs(targets[t] - s)) <= r for s, r in zip(sensors, reach, strict=True))
    ]
    J, D = 0.0, [0.0] * len(sensors)
    for t in sorted(outside, key=lambda t: -traces[t]):
        d = [np.linalg.norm(targets[t] - s) for s in sensors]
        i = min(range(len(sensors)), key=lambda i: D[i] + d[i])
        if D[i] == 0:
            J += d[i] * traces[t]
        D[i] += d[i]
        gap = targets[t] - sensors[i]
        sensors[i] = sensors[i] + np.sign(gap) * np.maximum(np.abs(gap) - reach[i], 0)
    return J


def thirds():
    """Means of a standard normal's three equally probable pieces, the middle one first."""
    edges = norm.ppf([0.0, 1 / 3, 2 / 3, 1.0])
    low, middle, high = (3 * (norm.pdf(a) - norm.pdf(b)) for a, b in itertools.pairwise(edges))
    return middle, low, high


def plain_cost(situation, controls, beta, *, expected=False, weights=None):
    """Eqs. (1), (4), (5), (7), (11), with nominal targets and matrix inverses; also counts targets in view of UAVs.

    With `expected` each target is at nine equally probable points of its predicted belief at once; with `weights` (T,)
    targets count by these.
    """
    weights = np.ones(len(situation.tracks)) if weights is None else weights
    marks = np.array(list(itertools.product(thirds(), repeat=2))) if expected else np.zeros((1, 2))
    fleet, F, Q = situation.vehicles, situation.motion.F, situation.motion.Q
    H = np.eye(2, 4)
    means = [t.belief.mean for t in situation.tracks]
    P = [t.belief.covariance for t in situation.tracks]
    spread = list(P)
    positions = [v.position[:2].copy() for v in fleet]
    reach = [(v.position[2] - TARGET_HEIGHT) * math.tan(v.camera.fov / 2) for v in fleet]
    J, seen = 0.0, []
    for step in range(controls.shape[1]):
        positions = [p + u * situation.step for p, u in zip(positions, controls[:, step], strict=True)]
        means = [F @ m for m in means]
        for t, m in enumerate(means):
            information = np.linalg.inv(F @ P[t] @ F.T + Q)
            spread[t] = F @ spread[t] @ F.T + Q
            count = 0
            for v, p in zip(fleet, positions, strict=True):
                camera, before = np.array([*p, v.position[2]]), information
                for x, y in m[:2] + marks @ np.linalg.cholesky(spread[t][:2, :2]).T:
                    point = np.array([x, y, TARGET_HEIGHT])
                    seen_there = v.camera.sees(Pose(camera, v.attitude), point)[0]
                    if seen_there and situation.forest.visible(camera, point)[0, 0]:
                        R = v.noise.covariance(p, point[:2])
                        information = information + H.T @ np.linalg.inv(R) @ H / len(marks)
                count += information is not before
            P[t] = np.linalg.inv(information)
            J += weights[t] * np.trace(P[t][:2, :2])
            seen.append(count)
    if beta:
        traces = [w * np.trace(p[:2, :2]) for w, p in zip(weights, P, strict=True)]
        J += beta * plain_mwtp([m[:2] for m in means], traces, positions, reach)
    return J, seen


def squares(reach):
    """Level fields of view with these half edges, as the compiled code takes them (n, 5, 3)."""
    return np.array([[(1, 0, r), (-1, 0, r), (0, 1, r), (0, -1, r), (0, 0, 0)] for r in reach], dtype=float)


def knowing(team, plans):
    """The team after plans of which these are the rest."""
    intents = {s.own.id: Plan(np.vstack([np.zeros((1, 2)), p])) for s, p in zip(team, plans, strict=True)}
    return [dataclasses.replace(s, intents=intents) for s in team]
