"""The plane at people's mid-height around a place, in coordinates along and across one camera's line of sight."""

import math
from typing import NamedTuple

import numpy as np

from tracking.geometry.lens import Lens, ground_point
from tracking.geometry.visibility import TARGET_HEIGHT
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
def make_clearing(lens: Lens, pixel: Pair) -> Clearing:
    """Clearing around the place that a pixel shows, without shadows yet."""
    x, y = ground_point(lens, pixel, TARGET_HEIGHT)
    east, north = x - lens.eye[0], y - lens.eye[1]
    distance = math.sqrt(east * east + north * north)
    away = (east / distance, north / distance) if distance > 0.0 else (1.0, 0.0)
    # Body coordinates right, up and back, each as a linear function of (u, v, 1).
    plane = np.array([[[away[0], -away[1], east], [away[1], away[0], north], [0.0, 0.0, TARGET_HEIGHT - lens.eye[2]]]])
    body = products(transpose(lens.rotation.reshape(1, 3, 3)), plane)[0]
    edges = np.empty((4, 3))
    half = lens.pixels / 2
    for j in range(3):
        right, up, depth = lens.focal * body[0, j], lens.focal * body[1, j], -half * body[2, j]
        edges[0, j], edges[1, j], edges[2, j], edges[3, j] = depth + right, depth - right, depth - up, depth + up
    depth = -body[2, 2]
    columns, rows = pixel[0] / depth, pixel[1] / depth
    a, b = (edges[0, 0] / depth + columns * body[2, 0]), (edges[0, 1] / depth + columns * body[2, 1])
    c, d = (edges[2, 0] / depth + rows * body[2, 0]), (edges[2, 1] / depth + rows * body[2, 1])
    footprint = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    return Clearing((x, y), away, distance, edges, footprint, np.empty((0, 7)))
