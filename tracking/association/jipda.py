"""Joint integrated probabilistic data association (JIPDA): existence probabilities beside association probabilities."""

import numpy as np

from tracking.association.jpda import joint_weights
from tracking.association.marginals import EXACT_SIDE, marginals
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, elementwise
from tracking.numerics.exponential import exp, log

_SUREST = 1e-9  # least probability of existing, or of not: however long the history, later scans can outweigh it


@elementwise
def log_odds(existence: float) -> float:
    """Logarithm of r / (1 - r) of each probability of existence r, kept finite."""
    r = min(max(existence, _SUREST), 1.0 - _SUREST)
    return log(r) - log(1.0 - r)


@elementwise
def from_log_odds(odds: float) -> float:
    """Probability of existence r of each logarithm of r / (1 - r)."""
    return 1.0 / (1.0 + exp(-odds))


@compiled
def existence_association(
    likelihood: Array, detection_probability: Array, clutter_density: float, existence: Array
) -> tuple[Array, Array, Array]:
    """Association probabilities of tracks of uncertain existence, and existence probabilities after the scan.

    likelihood (T, N), detection_probability (T, N + 1) and clutter_density are those of
    `tracking.association.jpda.association_probabilities`; existence r (T,), before the scan.
    Returns beta (T, N + 1), column 0 for no person or no detection; the same given that the person exists; and r (T,)
    after the scan. Every joint event has factors 1 - r P_D and r P_D likelihood / clutter_density in place of
    JPDA's; certain tracks are JPDA's. Source: [Musicki04], with a P_D that depends on the person's position.
    """
    detection = existence.reshape(-1, 1) * detection_probability
    misses, pairs = joint_weights(likelihood, detection, clutter_density)
    beta = marginals(misses, pairs, EXACT_SIDE)
    if np.all(existence == 1.0):
        return beta, beta, existence
    given, after = beta.copy(), np.empty(len(beta))
    for t in range(len(beta)):
        given[t, 0] *= existence[t] * (1.0 - detection_probability[t, 0]) / (1.0 - detection[t, 0])
        after[t] = 0.0
        for j in range(beta.shape[1]):
            after[t] += given[t, j]
        given[t] /= after[t]
        after[t] = min(after[t], 1.0)
    return beta, given, after
