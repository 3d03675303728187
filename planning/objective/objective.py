"""The interface of objectives, which optimisers minimise."""

from collections.abc import Callable

from tracking.numerics.arrays import Array

# Function from candidates (N, k, H, 2) m/s to costs (N,) m². Candidates are commands in optimisers and mean velocities
# in terms. The term of tracks also takes `ease` (k,) m/s: fields of view are wider by ease times a step on each side.
Objective = Callable[..., Array]
