"""What a belief becomes when its person was not detected: a place seen empty is evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracking.camera import Camera, Pose
from tracking.compiled import Array
from tracking.kalman import symmetric
from tracking.visibility import SAMPLE_VARIANCE, SAMPLES, Forest, visible_samples

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
    `tracking.visibility.SAMPLES` a person is in plain view (T, K), and the likelihood of no detection, at each (T, K).
    To see a place empty again says only that nobody has come there since. What the last frame said is in the belief,
    but for the tails that a Gaussian has again in the place just seen empty; so where both frames show a place, it
    takes the time in which people cross the belief until that says as much again.
    Note: this is ours; tests/test_absence.py compares it with particles. What the last frame showed is taken to be in
    the belief also if it showed all of it, which says nothing, or the UAV did not hold the track then. What other UAVs'
    frames showed is not asked for: those of one time are averaged by consensus.
    """
    means, covariances = beliefs
    seen = visible_samples(camera, now[1], means[:, :2], covariances[:, :2, :2], forest)
    missed = np.asarray(1.0 - detection_probability * seen, dtype=float)
    partly = np.flatnonzero(seen.any(axis=1) & ~seen.all(axis=1))
    if last is not None and len(partly):
        some, spreads = means[partly], covariances[partly]
        before = visible_samples(camera, last[1], some[:, :2], spreads[:, :2, :2], forest)
        again = np.exp(-_AGAIN * crossed((some, spreads), now[0] - last[0]))[:, None]
        missed[partly] = np.where(before & seen[partly], np.maximum(missed[partly], again), missed[partly])
    return seen, missed


def crossed(beliefs: tuple[Array, Array], elapsed: float) -> Array:
    """Share of its belief's width that each person crosses in so many seconds (T,), in root mean squares."""
    means, covariances = beliefs
    width = np.trace(covariances[:, :2, :2], axis1=1, axis2=2)
    speed = np.trace(covariances[:, 2:, 2:], axis1=1, axis2=2) + np.sum(means[:, 2:] ** 2, axis=1)
    return np.asarray(elapsed * np.sqrt(speed / width))


def given_undetected(predicted: tuple[Array, Array], missed: Array) -> tuple[Array, Array]:
    """Moments of beliefs after a scan without a detection: Bayes' rule over samples.

    predicted: means (T, 4) and covariances (T, 4, 4); missed (T, K): the likelihood of no detection at each of the
    positions `tracking.visibility.SAMPLES`.
    Somebody who is not where they would be seen is where they would not: the mass moves behind the tree, or out of the
    field of view, and with it, by correlation, the velocity. The result is the Gaussian of equal moments.
    Source: [Koch04], with samples where it uses mixtures.
    """
    means, covariances = predicted
    partly = missed.min(axis=1) < missed.max(axis=1)
    if not partly.any():
        return means, covariances
    weights = missed / missed.sum(axis=1, keepdims=True)
    shift = weights @ SAMPLES
    spread = np.einsum("tk,ki,kj->tij", weights, SAMPLES, SAMPLES) - shift[:, :, None] * shift[:, None, :]
    spread += SAMPLE_VARIANCE * np.eye(2)
    # State = mean + G u + what position says nothing of, with u the standardised position.
    roots = np.linalg.cholesky(covariances[:, :2, :2])
    G = np.swapaxes(np.linalg.solve(roots, covariances[:, :2, :]), 1, 2)
    moved = means + (G @ shift[..., None])[..., 0]
    shrunk = symmetric(covariances - G @ (np.eye(2) - spread) @ np.swapaxes(G, 1, 2))
    return np.where(partly[:, None], moved, means), np.where(partly[:, None, None], shrunk, covariances)
