"""Elementary functions of arrays that broadcast, as universal functions of NumPy's."""

from tracking.numerics.compiled import elementwise
from tracking.numerics.exponential import exp, power
from tracking.numerics.trigonometry import arctan2, cos, sin


@elementwise
def exp_each(x: float) -> float:
    """`exp` of each element."""
    return exp(x)


@elementwise
def sin_each(x: float) -> float:
    """`sin` of each element."""
    return sin(x)


@elementwise
def cos_each(x: float) -> float:
    """`cos` of each element."""
    return cos(x)


@elementwise
def arctan2_each(y: float, x: float) -> float:
    """`arctan2` of each element."""
    return arctan2(y, x)


@elementwise
def power_each(x: float, y: float) -> float:
    """`power` of each element."""
    return power(x, y)
