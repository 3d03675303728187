"""Expected squared error of a position up to a cut-off, as GOSPA counts it, compiled."""

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp

_NEGLIGIBLE = 37.0  # exp(-37) is less than the spacing of floating-point numbers below one


@compiled
def cut_off(traces: Array, cutoff: float) -> None:
    """Replace traces τ (N,) [m²] of position covariances by E min(|e|², c²) of errors e [m] with the cut-off c [m].

    The result is τ (1 - exp(-c²/τ)), because |e|² of a Gaussian error in the plane, equally wide in all directions, is
    exponential with mean τ. A person and the person's track, far from all others, add min(|e|², c²) to the square of
    GOSPA of order 2 with alpha = 2: beyond c, c²/2 for the missed person and c²/2 for the false track. A trace below
    c²/37 keeps its bits. Source: [Rahmathullah17].
    Note: for an oblong covariance the true value is smaller, by up to a fifth if all errors lie along one line.
    """
    square = cutoff * cutoff
    some = 0
    for k in range(len(traces)):  # neither loop has branches, so both are vectorised
        some += traces[k] * _NEGLIGIBLE > square
    for k in range(len(traces) if some else 0):
        trace = traces[k]
        counts = trace * _NEGLIGIBLE > square
        traces[k] = trace * (1.0 - exp(-square / trace if counts else 0.0)) if counts else trace
