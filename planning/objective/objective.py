"""What optimisers minimise: a function of plans."""

from collections.abc import Callable

from tracking.numerics.compiled import Array

Objective = Callable[[Array], Array]  # candidates (N, k, H, 2) m/s -> costs (N,)
