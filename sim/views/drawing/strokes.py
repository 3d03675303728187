"""Anti-aliased lines and circles in images."""

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.views.palette import Colour
from tracking.numerics.arrays import Array, Image

SHIFT = 4  # OpenCV's fixed point: sixteenths of a pixel


def draw_line(image: Image, points: Array, colour: Colour, *, thickness: int = 1, closed: bool = False) -> None:
    """Draw an anti-aliased polyline through pixels (N, 2)."""
    cv2.polylines(image, [to_fixed_point(points)], closed, colour, thickness, cv2.LINE_AA, SHIFT)


def draw_lines(image: Image, lines: Array | Sequence[Array], colour: Colour, *, thickness: int = 1) -> None:
    """Draw anti-aliased polylines, each through pixels (N, 2), one after another."""
    fixed = to_fixed_point(lines) if isinstance(lines, np.ndarray) else map(to_fixed_point, lines)
    cv2.polylines(image, list(fixed), False, colour, thickness, cv2.LINE_AA, SHIFT)


def cut_dashes(outline: Array, dashes: Sequence[int]) -> list[Array]:
    """Drawn pieces (2, 2) of the edges of a closed outline (N, 2); dashes: lengths of lines and gaps [pixel]."""
    pieces = []
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        length = math.dist(start, end)
        stops = np.cumsum([0.0, *np.tile(dashes, int(length / sum(dashes)) + 1)])[:-1].reshape(-1, 2, 1)
        shares = np.minimum(stops[stops[:, 0, 0] < length] / max(length, 1e-9), 1.0)
        pieces += list(start + shares * (end - start))
    return pieces


def draw_disc(image: Image, centre: Array, radius: float, colour: Colour, thickness: int = -1) -> None:
    """Draw an anti-aliased circle at a pixel (2,), filled by default."""
    x, y = (round(min(max((at - 0.5) * 2**SHIFT, -1e6), 1e6)) for at in centre.tolist())
    cv2.circle(image, (x, y), round(radius * 2**SHIFT), colour, thickness, cv2.LINE_AA, SHIFT)


def draw_outline(image: Image, points: Array, colour: Colour, halo: Colour, *, closed: bool = False) -> None:
    """Draw a polyline through pixels (N, 2) with a halo, visible on any background."""
    draw_line(image, points, halo, thickness=4, closed=closed)
    draw_line(image, points, colour, thickness=2, closed=closed)


def to_fixed_point(points: Array) -> NDArray[np.int32]:
    """Pixels in OpenCV's fixed point; OpenCV counts from the centre of the first pixel, we count from its corner."""
    return np.asarray(np.rint(np.minimum(np.maximum((points - 0.5) * 2**SHIFT, -1e6), 1e6)), dtype=np.int32)
