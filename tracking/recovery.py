"""Whether somebody who turns up is a person whose track was lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracking.compiled import Array
from tracking.kalman import Gaussian

# A person's position may differ by this much from where it was measured last, and from where it is measured now [m].
_MARGIN = 1.0


def sightings(ids: list[int], now: Array, before: dict[int, Array], unseen: NDArray[np.bool_]) -> Array:
    """Where [m] and when [s] the fleet last saw each track (T, 3).

    now (T, 3): where the tracks are at this instant; before: the same of those known at the last scan; unseen (T,).
    """
    rows = [before.get(id, here) if absent else here for id, here, absent in zip(ids, now, unseen, strict=True)]
    return np.array(rows).reshape(-1, 3)


def recovered(
    born: Gaussian, tracks: tuple[Array, Array], seen: Array, lost: NDArray[np.bool_], *, now: float, max_speed: float
) -> int | None:
    """The track that `born` (a belief at time `now` s) most probably continues, if there is one.

    tracks: means (T, 4) and covariances (T, 4, 4); seen (T, 3): sightings; lost (T,): which may be taken. A lost
    person can have got no further from the last sighting than at `max_speed` m/s. Of those who can, the likeliest is
    taken, however unlikely its belief makes it: somebody who was lost is likelier to turn up than somebody unknown,
    and a belief that failed to foresee a turn behind a tree is overconfident rather than another person's.
    """
    reach = max_speed * (now - seen[:, 2]) + _MARGIN
    able = lost & (np.hypot(*(seen[:, :2] - born.mean[:2]).T) <= reach)
    if not able.any():
        return None
    nu = tracks[0][:, :2] - born.mean[:2]
    S = tracks[1][:, :2, :2] + born.covariance[:2, :2]
    surprise = (nu * np.linalg.solve(S, nu[..., None])[..., 0]).sum(axis=1) + np.log(np.linalg.det(S))
    return int(np.argmin(np.where(able, surprise, np.inf)))
