"""Negative information: the update of a belief by a scan that did not detect its person."""

import math

import numpy as np

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.lens import Lens
from tracking.geometry.line_of_sight import Grid
from tracking.geometry.visibility import SAMPLE_VARIANCE, SAMPLES, Forest, seen_samples
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp
from tracking.numerics.stacks import cholesky_factors

Viewpoint = tuple[float, Pose]  # time of a frame [s], and pose of its camera

# Decrease of the log-likelihood of a second missed detection per width of the belief crossed meanwhile. With 4 to 5
# beliefs are as wide as those of a particle filter, under canopies of 1 to 8 m; with 2, far wider.
_AGAIN = 4.5


def miss_likelihood(
    camera: Camera,
    forest: Forest,
    beliefs: tuple[Array, Array],
    *,
    now: Viewpoint,
    last: Viewpoint | None,
    detection_probability: float,
) -> tuple[Flags, Array]:
    """Likelihood of no detection at the samples of beliefs, means (T, 4) and covariances (T, 4, 4).

    now, last: time and pose of the frame and of the UAV's frame before, if any. Returns flags (T, K) of the positions
    `visibility.SAMPLES` that are in plain view, and the likelihood of no detection at each (T, K).
    Negative information of the last frame is already in the belief, but for the tails that a Gaussian has again in the
    empty place. A second look at an empty place says only that no person has come there since. So where both frames
    show a place, the likelihood falls with the share of the belief that people cross between the frames.
    Note: this is ours; tests/tracking/filter/test_negative_information.py compares it with a particle filter. The last
    frame is taken to be in the belief also if it showed all of it, which is no information, or if the UAV did not hold
    the track then. Frames of other UAVs are left out: consensus averages those of one time.
    """
    means, covariances = (np.ascontiguousarray(part) for part in beliefs)
    views = camera.lens(now[1]), camera.lens((last or now)[1])
    elapsed = now[0] - last[0] if last else 0.0
    return _miss_likelihood(means, covariances, views, elapsed, (forest.blockers, forest.grid), detection_probability)


@compiled
def _miss_likelihood(
    means: Array,
    covariances: Array,
    views: tuple[Lens, Lens],
    elapsed: float,
    trees: tuple[Array, Grid],
    detection_probability: float,
) -> tuple[Flags, Array]:
    """As `miss_likelihood`, from the views now and `elapsed` s before; 0 s stands for the first frame."""
    places, roots = means[:, :2].copy(), cholesky_factors(covariances[:, :2, :2].copy())
    seen = seen_samples(places, roots, views[0], *trees)
    missed = np.where(seen, 1.0 - detection_probability, 1.0)
    for t in range(len(seen)):
        if elapsed > 0.0 and np.any(seen[t]) and not np.all(seen[t]):
            before = seen_samples(places[t : t + 1], roots[t : t + 1], views[1], *trees)[0]
            again = exp(-_AGAIN * share_crossed(means[t], covariances[t], elapsed))
            for k in range(len(before)):
                if before[k] and seen[t, k]:
                    missed[t, k] = max(missed[t, k], again)
    return seen, missed


@compiled
def share_crossed(mean: Array, covariance: Array, elapsed: float) -> float:
    """Share of its belief's width that a person crosses in `elapsed` seconds, in root mean squares.

    mean (4,) and covariance (4, 4) of the belief.
    """
    width = covariance[0, 0] + covariance[1, 1]
    speed = covariance[2, 2] + covariance[3, 3] + (mean[2] * mean[2] + mean[3] * mean[3])
    return elapsed * math.sqrt(speed / width)


@compiled
def negative_information_update(predicted: tuple[Array, Array], missed: Array) -> tuple[Array, Array]:
    """Viewpoints of beliefs after a scan without a detection: Bayes' rule over samples.

    predicted: means (T, 4) and covariances (T, 4, 4); missed (T, K): the likelihood of no detection at each of the
    positions `tracking.geometry.visibility.SAMPLES`.
    The mass moves out of the visible places, behind trees or out of the field of view, and by correlation the velocity
    changes, too. The result is the Gaussian of equal moments.
    State = mean + G u + a rest independent of the position, with u the standardised position: P_pp = L Lᵀ, G Lᵀ = P_xp.
    Source: [Koch04], with samples where it uses mixtures.
    """
    means, covariances = predicted
    moved, spread = means.copy(), covariances.copy()
    G, narrowed = np.empty((4, 2)), np.empty(3)
    for t in range(len(missed)):
        if missed[t].min() == missed[t].max():
            continue  # the scan shows all of the belief or nothing of it
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
