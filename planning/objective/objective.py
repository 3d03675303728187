"""The type of objectives: cost of candidate plans."""

from collections.abc import Callable

from tracking.numerics.arrays import Array

Objective = Callable[[Array], Array]  # candidates (N, k, H, 2) m/s -> costs (N,)
