"""Moments of beliefs in information form."""

import numpy as np

from tracking.numerics.factorisation import inverse
from tracking.numerics.matrices import applied


def moment_form(q: np.ndarray, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means ξ (..., 4) and covariances P (..., 4, 4) of a stack of information vectors and matrices."""
    covariances = inverse(omega)
    return applied(covariances, q), covariances
