"""Distortion of images by lenses: the model of [Brown66] with OpenCV's coefficients, and its inverse."""

import math
from typing import NamedTuple

from tracking.numerics.compiled import compiled

_STEP = 1 / 512  # of the radius, in the search for the fold
_FARTHEST = 8.0  # radius of points 83 degrees off the optical axis


class Distortion(NamedTuple):
    """Coefficients of radial (k) and tangential (p) distortion, as of OpenCV; all zero for a pinhole camera."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0


@compiled
def distort(d: Distortion, x: float, y: float) -> tuple[float, float]:
    """Where a lens shows the point (x, y) of the image plane at distance 1; x to the right, y down."""
    s = x * x + y * y
    g = 1.0 + s * (d.k1 + s * (d.k2 + s * d.k3))
    return (
        x * g + 2.0 * d.p1 * x * y + d.p2 * (s + 2.0 * x * x),
        y * g + d.p1 * (s + 2.0 * y * y) + 2.0 * d.p2 * x * y,
    )


@compiled
def distortion_slopes(d: Distortion, x: float, y: float) -> tuple[float, float, float]:
    """Derivatives of `distort`: of its x by x, of its y by y, and of either by the other, which are equal."""
    s = x * x + y * y
    g, h = 1.0 + s * (d.k1 + s * (d.k2 + s * d.k3)), d.k1 + s * (2.0 * d.k2 + s * 3.0 * d.k3)
    xx = g + 2.0 * x * x * h + 2.0 * d.p1 * y + 6.0 * d.p2 * x
    yy = g + 2.0 * y * y * h + 6.0 * d.p1 * y + 2.0 * d.p2 * x
    return xx, yy, 2.0 * (x * y * h + d.p1 * x + d.p2 * y)


@compiled
def find_reach(d: Distortion) -> float:
    """Square of the radius within which `distort` folds nothing over; 0 without distortion.

    The matrix of slopes is symmetric. Where its least eigenvalue is positive, `distort` is the gradient of a convex
    function and so one to one. The bound on that eigenvalue is exact if the distortion is radial.
    """
    if d.k1 == 0.0 and d.k2 == 0.0 and d.p1 == 0.0 and d.p2 == 0.0 and d.k3 == 0.0:
        return 0.0
    tangential, r = 6.0 * math.sqrt(d.p1 * d.p1 + d.p2 * d.p2), 0.0
    while r < _FARTHEST:
        s = (r + _STEP) * (r + _STEP)
        across = 1.0 + s * (d.k1 + s * (d.k2 + s * d.k3))
        along = 1.0 + s * (3.0 * d.k1 + s * (5.0 * d.k2 + s * 7.0 * d.k3))
        if not min(across, along) > tangential * (r + _STEP):
            break
        r += _STEP
    return r * r


@compiled
def undistort(d: Distortion, reach: float, u: float, v: float) -> tuple[float, float]:
    """The point that `distort` takes to (u, v), by Newton's method; NaN if there is none within the reach."""
    x, y, least = 0.0, 0.0, u * u + v * v
    for _ in range(50):
        right, down = distort(d, x, y)
        right, down = right - u, down - v
        xx, yy, xy = distortion_slopes(d, x, y)
        size = xx * yy - xy * xy
        along, across, share = (yy * right - xy * down) / size, (xx * down - xy * right) / size, 1.0
        for _ in range(30):  # a shorter step towards the same point, if it would leave the reach or lead away
            near, far = x - share * along, y - share * across
            right, down = distort(d, near, far)
            error = (right - u) * (right - u) + (down - v) * (down - v)
            if near * near + far * far <= reach and error < least:
                break
            share *= 0.5
        else:
            break
        x, y, least = near, far, error
    return (x, y) if least < 1e-24 else (math.nan, math.nan)
