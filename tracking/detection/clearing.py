"""The plane at people's mid-height around a place, in coordinates along and across one camera's line of sight."""

import math
from typing import NamedTuple

import numpy as np

from tracking.geometry.lens import Lens, ground_point, linear_pixel
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.matrices import products, transpose

Pair = tuple[float, float]


class Clearing(NamedTuple):
    """Surroundings of a place on the plane at people's mid-height, as one camera sees them.

    Its coordinates (u, v) [m] begin at the place: u away from the camera, v to the left of that.
    """

    origin: Pair  # m
    away: Pair  # unit vector of u
    distance: float  # m, horizontally, from the camera
    edges: Array  # (4, 3): inside the image where edges @ (u, v, 1) >= 0
    footprint: Array  # (2, 2) m per pixel: (u, v) by the image's columns and rows, at the place
    # (S, 7): hull of each shadow that may reach the surroundings, and the horizontal distance from the camera [m]
    # beyond which people are hidden: the distance of a trunk, or 0 for a canopy, which is above people.
    shadows: Array


@compiled
def to_clearing_axes(clearing: Clearing, x: float, y: float) -> Pair:
    """Coordinates (u, v) of a point (x, y) m of the plane."""
    x, y = x - clearing.origin[0], y - clearing.origin[1]
    return clearing.away[0] * x + clearing.away[1] * y, clearing.away[0] * y - clearing.away[1] * x


@compiled
def _trace(body: Array, form: tuple[float, float, float], start: float, sign: float) -> Array:
    """Linear function (3,) of (u, v, 1) on the plane: a coordinate of the image from `start` on, times the depth.

    body (3, 3): right, up and back; form: the coordinate as of `linear_pixel`.
    """
    out = np.empty(3)
    for j in range(3):
        rise = form[0] * body[0, j] - form[1] * body[1, j]
        out[j] = sign * (rise - (form[2] - start) * body[2, j])
    return out


@compiled
def make_clearing(lens: Lens, pixel: Pair) -> Clearing:
    """Clearing around the place that a pixel shows, without shadows yet."""
    x, y = ground_point(lens, pixel, TARGET_HEIGHT)
    east, north = x - lens.eye[0], y - lens.eye[1]
    distance = math.sqrt(east * east + north * north)
    away = (east / distance, north / distance) if distance > 0.0 else (1.0, 0.0)
    # Body coordinates right, up and back, each as a linear function of (u, v, 1).
    plane = np.array([[[away[0], -away[1], east], [away[1], away[0], north], [0.0, 0.0, TARGET_HEIGHT - lens.eye[2]]]])
    body = products(transpose(lens.rotation.reshape(1, 3, 3)), plane)[0]
    optics, edges = lens.optics, np.empty((4, 3))
    u, v = pixel
    width, height = float(optics.width), float(optics.height)
    # A lens bends the edges; near the place they are straight. So is all else within the size of a person.
    sides = (
        _trace(body, linear_pixel(optics, 0.0, v)[0], 0.0, 1.0),
        _trace(body, linear_pixel(optics, width, v)[0], width, -1.0),
        _trace(body, linear_pixel(optics, u, 0.0)[1], 0.0, 1.0),
        _trace(body, linear_pixel(optics, u, height)[1], height, -1.0),
    )
    for k in range(4):
        for a in range(3):
            edges[k, a] = sides[k][a]
    columns, rows = linear_pixel(optics, u, v)
    across, down, depth = _trace(body, columns, 0.0, 1.0), _trace(body, rows, 0.0, 1.0), -body[2, 2]
    a, b = (across[0] / depth + u / depth * body[2, 0]), (across[1] / depth + u / depth * body[2, 1])
    c, d = (down[0] / depth + v / depth * body[2, 0]), (down[1] / depth + v / depth * body[2, 1])
    footprint = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    return Clearing((x, y), away, distance, edges, footprint, np.empty((0, 7)))
