"""What a belief becomes when its person was not detected: a place seen empty is evidence."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import SAMPLE_VARIANCE, SAMPLES, Forest, visible_samples
from tracking.numerics.compiled import Array, compiled
from tracking.numerics.elementary import exp_each

Moment = tuple[float, Pose]  # s, when a frame was taken, and where the camera was

# By how much the logarithm of the likelihood of seeing nobody again falls, per width of the belief that is crossed
# meanwhile. With 4 to 5 beliefs are as wide as particles say, under canopies of 1 to 8 m; with 2, far wider.
_AGAIN = 4.5


def look(
    camera: Camera,
    forest: Forest,
    beliefs: tuple[Array, Array],
    *,
    now: Moment,
    last: Moment | None,
    detection_probability: float,
) -> tuple[NDArray[np.bool_], Array]:
    """What a frame can say of beliefs, means (T, 4) and covariances (T, 4, 4).

    now, last: when it and the UAV's frame before, if any, were taken, and from where. Returns at which of the positions
    `visibility.SAMPLES` a person is in plain view (T, K), and the likelihood of no detection, at each (T, K).
    To see a place empty again says only that nobody has come there since. What the last frame said is in the belief,
    but for the tails that a Gaussian has again in the place just seen empty; so where both frames show a place, it
    takes the time in which people cross the belief until that says as much again.
    Note: this is ours; tests/tracking/filter/test_negative_information.py compares it with particles. What the last
    frame showed is taken to be in the belief also if it showed all of it, which says nothing, or the UAV did not hold
    the track then. What other UAVs' frames showed is not asked for: those of one time are averaged by consensus.
    """
    means, covariances = beliefs
    seen = visible_samples(camera, now[1], means[:, :2], covariances[:, :2, :2], forest)
    missed = np.asarray(1.0 - detection_probability * seen, dtype=float)
    partly = np.flatnonzero(seen.any(axis=1) & ~seen.all(axis=1))
    if last is not None and len(partly):
        some, spreads = means[partly], covariances[partly]
        before = visible_samples(camera, last[1], some[:, :2], spreads[:, :2, :2], forest)
        again = exp_each(-_AGAIN * crossed((some, spreads), now[0] - last[0]))[:, None]
        missed[partly] = np.where(before & seen[partly], np.maximum(missed[partly], again), missed[partly])
    return seen, missed


def crossed(beliefs: tuple[Array, Array], elapsed: float) -> Array:
    """Share of its belief's width that each person crosses in so many seconds (T,), in root mean squares."""
    means, covariances = beliefs
    width = np.trace(covariances[:, :2, :2], axis1=1, axis2=2)
    speed = np.trace(covariances[:, 2:, 2:], axis1=1, axis2=2) + np.sum(np.square(means[:, 2:]), axis=1)
    return np.asarray(elapsed * np.sqrt(speed / width))


def given_undetected(predicted: tuple[Array, Array], missed: Array) -> tuple[Array, Array]:
    """Moments of beliefs after a scan without a detection: Bayes' rule over samples.

    predicted: means (T, 4) and covariances (T, 4, 4); missed (T, K): the likelihood of no detection at each of the
    positions `tracking.geometry.visibility.SAMPLES`.
    Somebody who is not where they would be seen is where they would not: the mass moves behind the tree, or out of the
    field of view, and with it, by correlation, the velocity. The result is the Gaussian of equal moments.
    Source: [Koch04], with samples where it uses mixtures.
    """
    means, covariances = predicted
    partly = missed.min(axis=1) < missed.max(axis=1)
    if not partly.any():
        return means, covariances
    return _given(means, covariances, missed, partly)


@compiled
def _given(means: Array, covariances: Array, missed: Array, partly: NDArray[np.bool_]) -> tuple[Array, Array]:
    """`given_undetected` for the beliefs that a scan says something of, `partly` (T,).

    State = mean + G u + what position says nothing of, with u the standardised position: P_pp = L Lᵀ and G Lᵀ = P_xp.
    """
    moved, spread = means.copy(), covariances.copy()
    G, narrowed = np.empty((4, 2)), np.empty(3)
    for t in np.flatnonzero(partly):
        P = covariances[t]
        one = math.sqrt(P[0, 0])
        across = P[1, 0] / one
        two = math.sqrt(P[1, 1] - across * across)
        for i in range(4):
            G[i, 0] = P[i, 0] / one
            G[i, 1] = (P[i, 1] - G[i, 0] * across) / two
        x, y = _sample_moments(missed[t], narrowed)
        for i in range(4):
            moved[t, i] += G[i, 0] * x + G[i, 1] * y
            for j in range(i, 4):
                lost = G[i, 0] * G[j, 0] * narrowed[0] + G[i, 1] * G[j, 1] * narrowed[2]
                lost += (G[i, 0] * G[j, 1] + G[i, 1] * G[j, 0]) * narrowed[1]
                spread[t, i, j] = spread[t, j, i] = P[i, j] - lost
    return moved, spread


@compiled
def _sample_moments(missed: Array, narrowed: Array) -> tuple[float, float]:
    """Mean of the samples, weighted by `missed` (K,); `narrowed` (3,) becomes I less their covariance: xx, xy, yy."""
    total = x = y = xx = xy = yy = 0.0
    for k in range(len(missed)):
        total += missed[k]
        u, v = missed[k] * SAMPLES[k, 0], missed[k] * SAMPLES[k, 1]
        x, y = x + u, y + v
        xx, xy, yy = xx + u * SAMPLES[k, 0], xy + u * SAMPLES[k, 1], yy + v * SAMPLES[k, 1]
    x, y = x / total, y / total
    narrowed[0] = 1.0 - (xx / total - x * x + SAMPLE_VARIANCE)
    narrowed[1] = x * y - xy / total
    narrowed[2] = 1.0 - (yy / total - y * y + SAMPLE_VARIANCE)
    return x, y
