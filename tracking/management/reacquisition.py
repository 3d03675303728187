"""Whether somebody who turns up is a person whose track was lost."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking.numerics.compiled import Array
from tracking.numerics.matrices import length, log_determinant, squared_distance

# A person's position may differ by this much from where it was measured last, and from where it is measured now [m].
_MARGIN = 1.0


def recoveries(
    born: tuple[Array, Array], lost: tuple[Array, Array], seen: Array, *, now: float, max_speed: float
) -> list[tuple[int, int]]:
    """Pairs (b, l) of new tracks and the lost ones that they most probably continue.

    born and lost: means (B or L, 4) and covariances (B or L, 4, 4) at time `now` s; seen (L, 3): sightings of the lost.
    A lost person can have got no further from the last sighting than at `max_speed` m/s. Among those who can, one
    assignment finds the likeliest, however unlikely the beliefs make it: somebody who was lost is likelier to turn up
    than somebody unknown, and a belief that failed to foresee a turn behind a tree is wrong rather than another's.
    """
    nu = lost[0][None, :, :2] - born[0][:, None, :2]
    S = lost[1][None, :, :2, :2] + born[1][:, None, :2, :2]
    surprise = squared_distance(nu, S) + log_determinant(S)
    reach = max_speed * (now - seen[:, 2]) + _MARGIN
    finite = np.isfinite(surprise)  # which it is not where a covariance is not positive definite
    able = finite & (length(seen[None, :, :2] - born[0][:, None, :2]) <= reach)
    # A pair out of reach costs more than all others together, so the assignment makes as many in reach as it can.
    ceiling = 1.0 + np.sum(np.abs(np.where(finite, surprise, 0.0)))
    rows, columns = linear_sum_assignment(np.where(able, surprise, ceiling))
    return [(int(b), int(k)) for b, k in zip(rows, columns, strict=True) if able[b, k]]
