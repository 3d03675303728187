"""Expected squared error of a position up to a cut-off, as GOSPA counts it, compiled."""

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp

_NEGLIGIBLE = 37.0  # exp(-37) is less than half the spacing of floating-point numbers below one


@compiled
def cut_off(traces: Array, cutoff: float) -> None:
    """Replace traces τ (N,) [m²] of position covariances by E min(|e|², c²) of errors e [m²] with the cut-off c [m].

    It is τ (1 - exp(-c²/τ)), because |e|² of a Gaussian error is exponential if it is as wide in all directions. That
    is what a track of a person adds to the square of GOSPA of order 2: the squared error, and half of c² each for a
    person missed and a false track where the error exceeds c. A trace far below c² stays what it is, to the last bit.

    Note: Of an oblong covariance the true value is smaller, by up to a fifth where all of it lies along one line.
    """
    square = cutoff * cutoff
    for k in range(len(traces)):
        if traces[k] * _NEGLIGIBLE > square:
            traces[k] *= 1.0 - exp(-square / traces[k])
