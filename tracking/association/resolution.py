"""Resolution: the probability that two people near each other give one measurement."""

from __future__ import annotations

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.universal import exp_each

# Probability in one place, and the distance [m] over which it falls.
_UNRESOLVED, _RESOLUTION = 0.12, 1.0


def unresolved(means: Array, existence: Array) -> Array:
    """Probability (T,) that another person is so near that both give one measurement; means (T, 4), existence (T,).

    Without it, of two people that pass each other one is taken for a ghost. Source: [Koch97], for the nearest person.
    Note: in one place it is not 1 but an eighth, as people keep apart: two tracks that stay in one place are of one.
    """
    if len(means) < 2:
        return np.zeros(len(means))
    squared = np.sum(np.square(means[:, None, :2] - means[:, :2]), axis=2)
    near = existence * exp_each(-0.5 / (_RESOLUTION * _RESOLUTION) * squared)
    np.fill_diagonal(near, 0.0)
    return np.asarray(_UNRESOLVED * near.max(axis=1))
