"""The interfaces of objectives, which optimisers minimise, and of their further terms."""

from collections.abc import Callable, Sequence
from typing import Protocol

from planning.planner import Situation
from tracking.numerics.arrays import Array

# Function from candidates (N, k, H, 2) m/s to costs (N,) m². Candidates are commands in optimisers and mean velocities
# in terms. The term of tracks also takes `ease` (k,) m/s: fields of view are wider by ease times a step on each side.
Objective = Callable[..., Array]


class Term(Protocol):
    """A term of the objective besides the uncertainty of tracks."""

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """Cost [m²] as a function of the mean velocities of UAVs `uavs`; the others fly `velocities`. None if zero.

        velocities (n, H, 2) m/s: a row for each UAV of `situation.vehicles`.
        """
