"""Moments of beliefs in information form, and back."""

import numpy as np

from tracking.numerics.factorisation import inverses
from tracking.numerics.matrices import apply


def information_form(means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Information vectors q = Ω ξ (..., 4) and matrices Ω = P⁻¹ (..., 4, 4) of a stack of beliefs."""
    omega = inverses(covariances.reshape(-1, 4, 4)).reshape(covariances.shape)
    return apply(omega, means), omega


def moment_form(q: np.ndarray, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means ξ (..., 4) and covariances P (..., 4, 4) of a stack of information vectors and matrices."""
    return information_form(q, omega)
