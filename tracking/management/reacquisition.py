"""Re-acquisition: new tracks that continue lost ones."""

from tracking.numerics.arrays import Array
from tracking.numerics.assignment import most_pairs
from tracking.numerics.distances import length, pair_distances

# Sum of the errors of the last measurement and of the present one, at most [m].
_MARGIN = 1.0


def farthest(unseen: Array, max_speed: float) -> Array:
    """Distances (...) [m] from its last detection that a person can have moved in `unseen` (...) s."""
    return max_speed * unseen + _MARGIN


def reacquisitions(
    born: tuple[Array, Array], lost: tuple[Array, Array], seen: Array, *, now: float, max_speed: float
) -> list[tuple[int, int]]:
    """Pairs (b, l) of new tracks and the lost ones that they most probably continue.

    born and lost: means (B or L, 4) and covariances (B or L, 4, 4) at time `now` s; seen (L, 3): sightings of the lost.
    A lost person can have moved from the last sighting at no more than `max_speed` m/s. Among the pairs within reach,
    one assignment finds the likeliest, however unlikely its beliefs: a lost person is likelier to turn up than an
    unknown one, and a belief that did not foresee a turn behind a tree is wrong rather than another person's.
    """
    positions = ((means[:, :2], covariances[:, :2, :2]) for means, covariances in (born, lost))
    _, cost = pair_distances(*positions)
    gaps = length(seen[None, :, :2] - born[0][:, None, :2])
    return most_pairs(gaps <= farthest(now - seen[:, 2], max_speed), cost)
