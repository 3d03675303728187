"""Joint integrated probabilistic data association (JIPDA): existence probabilities beside association probabilities."""

import numpy as np

from tracking.association.jpda import association_probabilities
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import elementwise
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
    detection = existence[:, None] * detection_probability
    beta = association_probabilities(likelihood, detection, clutter_density)
    if np.all(existence == 1.0):
        return beta, beta, existence
    given = beta.copy()
    given[:, 0] *= existence * (1.0 - detection_probability[:, 0]) / (1.0 - detection[:, 0])
    after = given.sum(axis=1)
    return beta, given / after[:, None], np.minimum(after, 1.0)
