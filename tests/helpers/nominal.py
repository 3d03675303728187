"""Nominal beliefs and their cost, also computed plainly."""

import math

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.stats import norm

from helpers.teams import among
from planning.objective.cost_to_go import FUTURE
from planning.objective.mwtp import add_penalties
from planning.objective.nbo import Measure, make_objective
from planning.prediction.predicted_belief import LANES
from planning.prediction.propagation import Nominal
from planning.prediction.quadrangle import inside, shortest_move
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT

GAINS = Measure(gains=True, cutoff=np.inf)


def nominal(situation, horizon):
    """Nominal beliefs as compiled code takes them; nothing in them is by chance."""
    return Nominal().predict(situation, horizon, np.random.default_rng(0))


def team_cost(belief, controls, beta, samples=1):
    """Objective of one joint plan (n, H, 2) m/s."""
    return float(make_objective(belief, controls, range(len(controls)), beta, samples)(controls[None])[0])


def information(situation, uavs, plans, *, expected=False):
    """Mutual information (N,) of plans (N, k, H, 2) m/s of UAVs `uavs`, by ascending id, as if there were no others."""
    belief = Nominal(expected).predict(among(situation, uavs), plans.shape[2], np.random.default_rng(0))
    return -make_objective(belief, plans[0], range(len(uavs)), 0.0, measure=GAINS)(plans)


def weighted_trace_penalty(targets, traces, sensors, views):
    """Compiled MWTP [m³] of targets (T, 2) m, traces (T,) m², for UAVs at (n, 2) m with fields of view (n, 5, 3)."""
    lanes, own, sums = np.tile(traces[:, None], LANES), np.tile(sensors[:, :, None], LANES), np.zeros(LANES)
    unseen, deciding = np.zeros(len(targets), np.bool_), np.arange(len(sensors))
    add_penalties(targets, lanes, unseen, sensors, deciding, own, views, sums)
    return sums[0]


def plain_mwtp(targets, traces, sensors, views):
    """Algorithm 2 of [Li22], line by line, with beta = 1; arguments as of `weighted_trace_penalty`."""
    sensors, J, D = np.array(sensors, dtype=float), 0.0, np.zeros(len(sensors))
    seen = [any(inside(v, *(t - s)) for v, s in zip(views, sensors, strict=True)) for t in targets]
    for t in sorted(np.flatnonzero(~np.array(seen, bool)), key=lambda t: -traces[t]):  # equal traces by index
        gaps = targets[t] - sensors
        d = np.linalg.norm(gaps - views[:, 4, :2], axis=1)
        i = int(np.argmin(D + d))
        if D[i] == 0:
            J += d[i] * traces[t]
        D[i] += d[i]
        sensors[i] += shortest_move(views, i, *gaps[i])
    return J


def plain_square_mwtp(targets, traces, sensors, reach):
    """The same for level fields of view with half edges `reach` (n,) m, with nothing of the compiled code."""
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


def lattice():
    """Five points (5, 2) of variance one: the mean of each fifth of a standard normal, once along either axis."""
    edges = norm.ppf(np.linspace(0.0, 1.0, 6))
    pieces = norm.pdf(edges[:-1]) - norm.pdf(edges[1:])
    pieces /= math.sqrt(np.mean(pieces**2))
    return np.array([(pieces[k], pieces[m]) for k, m in ((2, 2), (3, 0), (4, 3), (1, 4), (0, 1))])


def plain_cost(situation, controls, beta, *, expected=False, weights=None, cutoff=math.inf, ahead=0.0):
    """Eqs. (1), (4), (5), (7), (11), with nominal targets and matrix inverses; also counts targets in view of UAVs.

    With `expected` each target has five equally probable trajectories through its predicted beliefs, and its trace is
    the mean of theirs; with `weights` (T,) targets count by these; with a `cutoff` [m] each trace is cut off. `ahead`
    is the weight of the learned cost-to-go.
    """
    weights = np.ones(len(situation.tracks)) if weights is None else weights
    traces, seen = np.zeros((controls.shape[1], len(weights))), []
    marks = lattice() if expected else np.zeros((1, 2))
    fleet, J = situation.vehicles, 0.0
    ends = [v.position[:2] + situation.step * u.sum(axis=0) for v, u in zip(fleet, controls, strict=True)]
    reach = [(v.position[2] - TARGET_HEIGHT) * math.tan(v.camera.fov / 2) for v in fleet]
    for t, track in enumerate(situation.tracks):
        last = []
        for mark in marks:
            along, count = plain_traces(situation, controls, track.belief, mark)
            traces[:, t] += [plain_error(trace, cutoff) / len(marks) for trace in along]
            last.append(along[-1])
            seen += count
        if ahead:
            belief = track.belief
            for _ in traces:
                belief = situation.motion.predict(belief)
            gaps = [np.linalg.norm(belief.mean[:2] - end) - r for end, r in zip(ends, reach, strict=True)]
            away = min(max(gap, 0.0) / v.max_speed for gap, v in zip(gaps, fleet, strict=True))
            future = plain_future(math.sqrt(np.mean(last)) / cutoff, away) * cutoff**2 / situation.step
            J += ahead * weights[t] * future
    J += (traces * weights).sum()
    if beta:
        ahead = [t.belief for t in situation.tracks]
        for _ in traces:
            ahead = [situation.motion.predict(belief) for belief in ahead]
        J += beta * plain_square_mwtp([belief.mean[:2] for belief in ahead], traces[-1] * weights, ends, reach)
    return J, seen


def plain_error(trace, cutoff):
    """Mean of the squared error up to a cut-off [m²], of a Gaussian error as wide in all directions."""
    return trace * (1.0 - math.exp(-cutoff * cutoff / trace))


def plain_future(deviation, seconds):
    """The table of future errors [s] at a standard deviation in units of the cut-off and a time, by SciPy."""
    scales = [spacing * np.arange(count) for spacing, count in zip((0.2, 2.0), FUTURE.shape, strict=True)]
    place = [min(x, scale[-1]) for x, scale in zip((deviation, seconds), scales, strict=True)]
    return float(RegularGridInterpolator(scales, FUTURE)(place)[0])


def plain_traces(situation, controls, belief, mark):
    """Traces (H,) m² of a target that stays `mark` standard deviations off its mean; numbers of UAVs that see it."""
    F, Q, H = situation.motion.F, situation.motion.Q, np.eye(2, 4)
    mean, P, spread = belief.mean, belief.covariance, belief.covariance
    positions = [v.position[:2] for v in situation.vehicles]
    traces, seen = [], []
    for step in range(controls.shape[1]):
        positions = [p + u * situation.step for p, u in zip(positions, controls[:, step], strict=True)]
        ahead = situation.motion.predict(Gaussian(mean, spread))
        mean, spread = ahead.mean, ahead.covariance
        information = np.linalg.inv(F @ P @ F.T + Q)
        point = np.array([*mean[:2] + np.linalg.cholesky(spread[:2, :2]) @ mark, TARGET_HEIGHT])
        seen.append(0)
        for v, p in zip(situation.vehicles, positions, strict=True):
            camera = np.array([*p, v.position[2]])
            if v.camera.sees(Pose(camera, v.attitude), point)[0] and situation.forest.visible(camera, point)[0, 0]:
                information = information + H.T @ np.linalg.inv(v.noise.covariance(p, point[:2])) @ H
                seen[-1] += 1
        P = np.linalg.inv(information)
        traces.append(np.trace(P[:2, :2]))
    return np.array(traces), seen


def squares(reach):
    """Level fields of view with these half edges, as the compiled code takes them (n, 5, 3)."""
    return np.array([[(1, 0, r), (-1, 0, r), (0, 1, r), (0, -1, r), (0, 0, 0)] for r in reach], dtype=float)
