"""Resolution: the probability that two people near each other give one measurement."""

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp

# Probability in one place, and the distance [m] over which it falls.
_UNRESOLVED, _RESOLUTION = 0.12, 1.0


@compiled
def unresolved(means: Array, existence: Array) -> Array:
    """Probability (T,) that another person is so near that both give one measurement; means (T, 4), existence (T,).

    Without it, of two people that pass each other one is taken for a ghost. Source: [Koch97], for the nearest person.
    Note: in one place it is not 1 but 0.12, as people keep apart: two tracks that stay in one place are of one.
    """
    nearest = np.zeros(len(means))
    for a in range(len(means)):
        for b in range(len(means)):
            if a != b:
                x, y = means[a, 0] - means[b, 0], means[a, 1] - means[b, 1]
                near = existence[b] * exp(-0.5 / (_RESOLUTION * _RESOLUTION) * (x * x + y * y))
                nearest[a] = max(nearest[a], near)
    return _UNRESOLVED * nearest
