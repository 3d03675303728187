"""Distortion of images by lenses: the models of OpenCV, and their inverse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.trigonometry import arctan2

MODELS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}  # ROS's names, and most coefficients of each
_STEP = 1 / 512  # of the radius, in the search for the fold
_FARTHEST = 8.0  # radius of points 83 degrees off the optical axis
WIDEST = 4.0  # radius of points 76 degrees off the axis, beyond which equidistant lenses are taken to show nothing
_NEAR = 1e-12  # square of a radius within which equidistant lenses are taken to second order


class Distortion(NamedTuple):
    """Coefficients of a lens, as of OpenCV; all zero for a pinhole camera.

    k and p are the radial and tangential ones of a rational polynomial, [Brown66] if k4 to k6 are 0. Of an equidistant
    lens, k1 to k4 are those of [Kannala06], which OpenCV calls fisheye, and the others 0.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    equidistant: float = 0.0  # 1 for an equidistant lens

    @staticmethod
    def of(model: str, coefficients: Sequence[float]) -> Distortion:
        """The lens of a model of `MODELS` with coefficients in OpenCV's order; ValueError if there are too many."""
        k = [float(number) for number in coefficients]
        if len(k) > MODELS[model]:
            larger = next((f"; {name} has {most}" for name, most in MODELS.items() if len(k) <= most), "")
            raise ValueError(f"distortion: {k} has more than the {MODELS[model]} coefficients of {model}{larger}")
        if model != "equidistant":
            return Distortion(*k)
        return Distortion(**dict(zip(("k1", "k2", "k3", "k4"), k, strict=False)), equidistant=1.0)

    @property
    def model(self) -> str:
        """The name of the model in `MODELS`."""
        if self.equidistant:
            return "equidistant"
        return "rational_polynomial" if any(self[5:8]) else "plumb_bob"

    @property
    def coefficients(self) -> tuple[float, ...]:
        """All coefficients of the model, in OpenCV's order."""
        if self.equidistant:
            return self.k1, self.k2, self.k3, self.k4
        return self[: MODELS[self.model]]

    @property
    def settings(self) -> dict[str, Any]:
        """The keys of a camera's settings that make this lens."""
        named = {} if self.model == "plumb_bob" else {"distortion_model": self.model}
        return {"distortion": list(self.coefficients), **named}


@inlined
def _radial(d: Distortion, s: float) -> tuple[float, float]:
    """Factor by which a lens moves points whose squared radius is s from the axis, and its derivative by s."""
    if d.equidistant == 0.0:
        g, h = 1.0 + s * (d.k1 + s * (d.k2 + s * d.k3)), d.k1 + s * (2.0 * d.k2 + s * 3.0 * d.k3)
        if d.k4 == 0.0 and d.k5 == 0.0 and d.k6 == 0.0:
            return g, h
        below, fall = 1.0 + s * (d.k4 + s * (d.k5 + s * d.k6)), d.k4 + s * (2.0 * d.k5 + s * 3.0 * d.k6)
        return g / below, (h - g / below * fall) / below
    if s < _NEAR:
        return 1.0 + s * (d.k1 - 1 / 3), d.k1 - 1 / 3
    r = math.sqrt(s)
    angle = arctan2(r, 1.0)
    a = angle * angle
    g = angle / r * (1.0 + a * (d.k1 + a * (d.k2 + a * (d.k3 + a * d.k4))))
    along = (1.0 + a * (3.0 * d.k1 + a * (5.0 * d.k2 + a * (7.0 * d.k3 + a * 9.0 * d.k4)))) / (1.0 + s)
    return g, (along - g) / (2.0 * s)


@compiled
def distort(d: Distortion, x: float, y: float) -> tuple[float, float]:
    """Where a lens shows the point (x, y) of the image plane at distance 1; x to the right, y down."""
    s = x * x + y * y
    g, _ = _radial(d, s)
    return (
        x * g + 2.0 * d.p1 * x * y + d.p2 * (s + 2.0 * x * x),
        y * g + d.p1 * (s + 2.0 * y * y) + 2.0 * d.p2 * x * y,
    )


@compiled
def distortion_slopes(d: Distortion, x: float, y: float) -> tuple[float, float, float]:
    """Derivatives of `distort`: of its x by x, of its y by y, and of either by the other, which are equal."""
    g, h = _radial(d, x * x + y * y)
    xx = g + 2.0 * x * x * h + 2.0 * d.p1 * y + 6.0 * d.p2 * x
    yy = g + 2.0 * y * y * h + 6.0 * d.p1 * y + 2.0 * d.p2 * x
    return xx, yy, 2.0 * (x * y * h + d.p1 * x + d.p2 * y)


@compiled
def find_reach(d: Distortion) -> float:
    """Square of the radius within which `distort` folds nothing over; 0 without distortion.

    It ends 83 degrees off the optical axis, and 76 degrees off that of equidistant lenses.

    The matrix of slopes is symmetric. Where its least eigenvalue is positive, `distort` is the gradient of a convex
    function and so one to one. The bound on that eigenvalue is exact if the distortion is radial.
    """
    total = 0.0
    for k in d:
        total += abs(k)
    if total == 0.0:
        return 0.0
    farthest = _FARTHEST if d.equidistant == 0.0 else WIDEST
    tangential, r = 6.0 * math.sqrt(d.p1 * d.p1 + d.p2 * d.p2), 0.0
    while r < farthest:
        s = (r + _STEP) * (r + _STEP)
        across, h = _radial(d, s)
        if not min(across, across + 2.0 * s * h) > tangential * (r + _STEP):
            break
        r += _STEP
    return r * r


def explain_fold(d: Distortion) -> str:
    """What is wrong with a lens that shows two directions in one pixel."""
    return f"distortion: {list(d.coefficients)} folds the image over; expected coefficients that do not"


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
