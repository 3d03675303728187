"""Integrated probabilistic data association: whether somebody is there at all, besides where."""

from __future__ import annotations

import numpy as np

from tracking.association.jpda import association_probabilities
from tracking.numerics.compiled import Array
from tracking.numerics.elementary import exp_each, log_each

_SUREST = 1e-9  # of existing, or of not: however long the evidence, as much as this can be argued against


def log_odds(existence: Array) -> Array:
    """Logarithms of r / (1 - r) of probabilities of existence, kept finite."""
    r = np.clip(existence, _SUREST, 1.0 - _SUREST)
    return np.asarray(log_each(r) - log_each(1.0 - r))


def from_log_odds(odds: Array) -> Array:
    """Probabilities of existence."""
    return 1.0 / (1.0 + exp_each(-odds))


def associated(
    likelihood: Array, detection_probability: Array, clutter_density: float, existence: Array
) -> tuple[Array, Array, Array]:
    """Association of tracks that may be nobody's, and whether they are anybody's after the scan.

    likelihood (T, N), detection_probability (T, N + 1) and clutter_density are those of
    `tracking.association.jpda.association_probabilities`; existence r (T,), before the scan.
    Returns beta (T, N + 1), column 0 for nobody there or nothing detected; the same given that there is somebody; and
    r (T,) after the scan. Every joint event has factors 1 - r P_D and r P_D likelihood / clutter_density in place of
    JPDA's; certain tracks are JPDA's. Source: [Musicki04], with a P_D that depends on where the person is.
    """
    detection = existence[:, None] * detection_probability
    beta = association_probabilities(likelihood, detection, clutter_density)
    if np.all(existence == 1.0):
        return beta, beta, existence
    given = beta.copy()
    given[:, 0] *= existence * (1.0 - detection_probability[:, 0]) / (1.0 - detection[:, 0])
    after = given.sum(axis=1)
    return beta, given / after[:, None], np.minimum(after, 1.0)
