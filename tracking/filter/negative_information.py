"""Negative information: the update of a belief by a scan that did not detect its person."""

import math

import numpy as np

from tracking.geometry.visibility import SAMPLE_VARIANCE, SAMPLES
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp, power

# Decrease of the log-likelihood of a second missed detection per width of the belief crossed meanwhile, and the share
# of the mean velocity that counts as crossing: a motion of the whole belief crosses only one of its edges. With these
# values beliefs are as wide as those of a particle filter, for one UAV or a fleet, under canopies of 1 to 8 m.
_AGAIN, _TOGETHER = 8.5, 0.35


@compiled
def miss_likelihood(means: Array, covariances: Array, views: Flags, elapsed: Array, detection: float) -> Array:
    """Likelihood (T, K) of no detection at the samples of beliefs.

    Negative information of the last frames is already in the belief, although the Gaussian has tails again in the empty
    place. A second look there only says that no person has come since. So where frames of both times show a place, the
    likelihood falls with the share of the belief that people cross between them.
    Note: this is ours; tests/tracking/filter compares it with particle filters. The last frames are assumed to be in
    the belief even if they showed all of it, which is no information, or if the fleet did not have the track then.

    means (T, 4) and covariances (T, 4, 4); views (T, 2, K): flags of the samples that the frames of this scan show, and
    those that the frames before showed, by one UAV or by any of several; elapsed (T,) s since the frames before;
    detection: probability of detection in plain view.
    """
    missed = np.ones((len(views), views.shape[2]))
    for t in range(len(missed)):
        shown = twice = 0
        for k in range(missed.shape[1]):
            if views[t, 0, k]:
                missed[t, k] = 1.0 - detection
                shown, twice = shown + 1, twice + views[t, 1, k]
        if twice > 0 and shown < missed.shape[1]:
            again = exp(-_AGAIN * share_crossed(means[t], covariances[t], elapsed[t]))
            for k in range(missed.shape[1]):
                if views[t, 1, k]:
                    missed[t, k] = max(missed[t, k], again)
    return missed


@compiled
def temper(missed: Array, exponent: float) -> Array:
    """Likelihoods (T, K) to the power of the setting `negative_information`; a power below 1 weakens them."""
    if exponent == 1.0:
        return missed
    tempered = np.empty_like(missed)
    for t in range(missed.shape[0]):
        for k in range(missed.shape[1]):
            tempered[t, k] = power(missed[t, k], exponent)
    return tempered


@compiled
def share_crossed(mean: Array, covariance: Array, elapsed: float) -> float:
    """Share of a belief's width that the person crosses in `elapsed` seconds, both as root mean squares.

    mean (4,), covariance (4, 4) of the belief. Of the mean velocity only a part counts.
    """
    width = covariance[0, 0] + covariance[1, 1]
    together = _TOGETHER * _TOGETHER * (mean[2] * mean[2] + mean[3] * mean[3])
    return elapsed * math.sqrt((covariance[2, 2] + covariance[3, 3] + together) / width)


@compiled
def negative_information_update(means: Array, covariances: Array, missed: Array) -> tuple[Array, Array]:
    """Beliefs after a scan without a detection, by Bayes' rule over samples; Gaussians with the posterior's moments.

    means (T, 4) and covariances (T, 4, 4) of the beliefs before; missed (T, K): likelihood of no detection at each
    position of `tracking.geometry.visibility.SAMPLES`. The state is mean + G u + a rest independent of the position,
    where u is the standardised position: P_pp = L Lᵀ, G Lᵀ = P_xp.
    Source: [Koch04], with samples in place of mixtures.
    """
    moved, spread = means.copy(), covariances.copy()
    G, narrowed = np.empty((4, 2)), np.empty(3)
    for t in range(len(missed)):
        alike = True
        for k in range(missed.shape[1]):
            alike &= missed[t, k] == missed[t, 0]
        if alike:
            continue  # the scan shows all of the belief or none of it
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
    """Mean of the samples weighted by `missed` (K,); sets `narrowed` (3,) to I minus their covariance: xx, xy, yy."""
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
