"""Elementary functions of arrays that broadcast, as universal functions of NumPy's."""

from tracking.numerics.compiled import elementwise
from tracking.numerics.exponential import exp, power
from tracking.numerics.trigonometry import arctan2, cos, sin

exp_each = elementwise(lambda x: exp(x))
sin_each = elementwise(lambda x: sin(x))
cos_each = elementwise(lambda x: cos(x))
arctan2_each = elementwise(lambda y, x: arctan2(y, x))
power_each = elementwise(lambda x, y: power(x, y))
