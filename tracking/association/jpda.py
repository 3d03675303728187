"""Joint probabilistic data association of people who may not exist (JPDA, JIPDA): gating, association, update."""

import math

import numpy as np

from tracking.association.marginals import EXACT_SIDE, marginals
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, merged
from tracking.numerics.exponential import exp, log
from tracking.numerics.matrices import symmetrise

_SUREST = 1e-9  # least probability of existing, and of not existing, so that later scans can outweigh any history
_LEAST = 1e-100  # least probability of existing in an association; from zero nothing would follow


@compiled
def log_odds(existence: float) -> float:
    """Logarithm of r / (1 - r) of a probability of existence r, kept finite."""
    r = min(max(existence, _SUREST), 1.0 - _SUREST)
    return log(r) - log(1.0 - r)


@compiled
def from_log_odds(odds: float) -> float:
    """Probability of existence r from the logarithm of r / (1 - r)."""
    return 1.0 / (1.0 + exp(-odds))


@merged
def existence_association(
    likelihood: Array, detection_probability: Array, clutter_density: float, existence: Array
) -> tuple[Array, Array, Array]:
    """Association probabilities of tracks of uncertain existence, and existence probabilities after the scan.

    likelihood (T, N) 1/m², zero outside the gate; detection_probability P_D (T, N + 1), below 1, of a measurement of
    the track's person inside the gate: column 0 over the whole belief, column 1 + j given that measurement j is the
    person's; clutter_density 1/m², above 0; existence r (T,) before the scan, of which zero counts as 1e-100.
    Returns beta (T, N + 1), with column 0 for no person or no detection; beta given that the person exists; and r (T,)
    after the scan. In a joint event a track has the factor 1 - r P_D or r P_D likelihood / clutter_density.
    Source: [BarShalom11] 6.2, [Williams14]; [Musicki04], with a P_D that depends on the person's position.
    """
    existence = np.maximum(existence, _LEAST)
    misses, pairs = _compute_joint_weights(likelihood, detection_probability, clutter_density, existence)
    beta = marginals(misses, pairs, EXACT_SIDE)
    if np.all(existence == 1.0):
        return beta, beta, existence
    given, after = beta.copy(), np.zeros(len(beta))
    for t in range(len(beta)):
        miss = detection_probability[t, 0]
        given[t, 0] *= existence[t] * (1.0 - miss) / (1.0 - existence[t] * miss)
        row, total = given[t], given[t].sum()
        row /= total
        after[t] = min(total, 1.0)
    return beta, given, after


@merged
def _compute_joint_weights(
    likelihood: Array, detection: Array, clutter: float, existence: Array
) -> tuple[Array, Array]:
    """Weights of misses (T,) and of pairs (T, N), relative to the largest weight of their track.

    Every joint event has one factor from each track, so scaling changes no probability and keeps products in range.
    """
    misses, pairs = np.empty(len(likelihood)), np.zeros_like(likelihood)
    for i in range(len(misses)):
        scale = misses[i] = 1.0 - existence[i] * detection[i, 0]
        for j in range(pairs.shape[1]):
            if likelihood[i, j] > 0.0:
                pairs[i, j] = existence[i] * detection[i, j + 1] * likelihood[i, j] / clutter
                scale = max(scale, pairs[i, j])
        misses[i] /= scale
        row = pairs[i]
        row /= scale
    return misses, pairs


@merged
def gated_likelihood(
    means: Array, covariances: Array, measurements: Array, noise: Array, gate_probability: float
) -> Array:
    """Density (T, N) 1/m² of each measurement, given that it is the track's and in its gate; zero outside the gate.

    The gate is an ellipse. means (T, 4) and covariances (T, 4, 4) of tracks; measurements (N, 2) m and their
    covariances `noise` (N, 2, 2) m²; gate_probability: that a person's measurement is in the gate.
    """
    threshold = -2.0 * log(1.0 - gate_probability)
    out = np.zeros((len(means), len(measurements)))
    for i in range(len(means)):
        for j in range(len(measurements)):
            dx, dy = measurements[j, 0] - means[i, 0], measurements[j, 1] - means[i, 1]
            xx = covariances[i, 0, 0] + noise[j, 0, 0]
            xy = covariances[i, 0, 1] + noise[j, 0, 1]
            yy = covariances[i, 1, 1] + noise[j, 1, 1]
            if dx * dx > 2.0 * threshold * xx:
                continue  # outside the gate, as are most pairs among many people
            det = xx * yy - xy * xy
            d2 = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det
            if d2 <= threshold:
                out[i, j] = exp(-0.5 * d2) / (2.0 * math.pi * math.sqrt(det) * gate_probability)
    return out


@compiled
def mixture_update(
    predicted: tuple[Array, Array], undetected: tuple[Array, Array], measurements: Array, noise: Array, beta: Array
) -> tuple[Array, Array]:
    """Mean and covariance of the mixture over association hypotheses, including the spread of the means.

    The component of a measurement is a Kalman update of the predicted belief in Joseph's form with the measurement's R.
    Source: [BarShalom11] 6.2.

    predicted: means (T, 4) and covariances (T, 4, 4) before the scan; undetected: the same, given that the person gave
    no measurement; measurements (N, 2) m and their covariances `noise` (N, 2, 2) m²; beta (T, N + 1): association
    probabilities.
    """
    means, covariances = predicted
    new_means, new_covariances = means.copy(), np.empty_like(covariances)
    moves = np.empty((len(measurements) + 1, 4))
    K, updated = np.empty((4, 2)), np.empty((4, 4))
    for i in range(len(means)):
        for a in range(4):
            moves[0, a] = undetected[0][i, a] - means[i, a]
            for b in range(4):
                new_covariances[i, a, b] = beta[i, 0] * undetected[1][i, a, b]
        for c in range(1, beta.shape[1]):
            if beta[i, c] != 0.0:  # a track's cost must not grow with distant measurements
                _update(covariances[i], noise[c - 1], K, updated)
                x, y = measurements[c - 1, 0] - means[i, 0], measurements[c - 1, 1] - means[i, 1]
                for a in range(4):
                    moves[c, a] = K[a, 0] * x + K[a, 1] * y
                    for b in range(4):
                        new_covariances[i, a, b] += beta[i, c] * updated[a, b]
        _add_moves(beta[i], moves, new_means[i], new_covariances[i])
    symmetrise(new_covariances)
    return new_means, new_covariances


@merged
def _update(P: Array, R: Array, K: Array, updated: Array) -> None:
    """Write gain K (4, 2) and covariance (4, 4) after a measurement, in Joseph's form.

    The products are written out, because for so small matrices library calls and new arrays cost ten times more.
    """
    xx, xy, yy = P[0, 0] + R[0, 0], P[0, 1] + R[0, 1], P[1, 1] + R[1, 1]
    det = xx * yy - xy * xy
    for a in range(4):
        K[a, 0] = (P[a, 0] * yy - P[a, 1] * xy) / det
        K[a, 1] = (P[a, 1] * xx - P[a, 0] * xy) / det
    for a in range(4):
        # Row a of A P, then of A P Aᵀ + K R Kᵀ, with A = I - K H.
        ap0 = P[a, 0] - (K[a, 0] * P[0, 0] + K[a, 1] * P[1, 0])
        ap1 = P[a, 1] - (K[a, 0] * P[0, 1] + K[a, 1] * P[1, 1])
        kr0, kr1 = K[a, 0] * R[0, 0] + K[a, 1] * R[1, 0], K[a, 0] * R[0, 1] + K[a, 1] * R[1, 1]
        for b in range(4):
            ap = P[a, b] - (K[a, 0] * P[0, b] + K[a, 1] * P[1, b])
            updated[a, b] = (ap - (ap0 * K[b, 0] + ap1 * K[b, 1])) + (kr0 * K[b, 0] + kr1 * K[b, 1])


@merged
def _add_moves(beta: Array, moves: Array, mean: Array, covariance: Array) -> None:
    """Add the mean of the components' moves (N + 1, 4) to a mean, and their spread to a covariance."""
    move = np.zeros(4)
    for c in range(len(beta)):
        for a in range(4 if beta[c] != 0.0 else 0):  # other moves are not set
            move[a] += beta[c] * moves[c, a]
    for c in range(len(beta)):
        for a in range(4 if beta[c] != 0.0 else 0):
            for b in range(4):
                covariance[a, b] += beta[c] * ((moves[c, a] - move[a]) * (moves[c, b] - move[b]))
    for a in range(4):
        mean[a] += move[a]
