"""Information form of Gaussian beliefs."""

from tracking.numerics.arrays import Array
from tracking.numerics.factorisation import inverse
from tracking.numerics.matrices import applied


def information_form(means: Array, covariances: Array) -> tuple[Array, Array]:
    """Information vectors q = Ω ξ (..., 4) and matrices Ω = P⁻¹ (..., 4, 4) of a stack of beliefs."""
    omega = inverse(covariances)
    return applied(omega, means), omega
