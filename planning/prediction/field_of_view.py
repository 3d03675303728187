"""Field of view of a camera in level flight on the plane of the targets: a quadrangle that moves with its UAV."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planning.planner import Vehicle
from tracking.geometry.camera import ALL_ROUND, Camera, rotation
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.matrices import apply
from tracking.numerics.trigonometry import hypot

_MIDDLE = np.zeros((1, 2))
_CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
# Points of the image at which to keep a pursued target, in half edges: the middle and eight near the rim. A view from
# the side shows a target under a canopy that hides it from above.
IMAGE_POINTS = -0.85 * np.array([(x, y) for x in (0, -1, 1) for y in (0, -1, 1)])


class _View(NamedTuple):
    """What a field of view depends on. All UAVs of a fleet ask for the same ones, so each is worked out once."""

    bounds: tuple[float, float, float, float] | None  # as of `Camera.bounds`; None for a view all round
    height: float  # m, above the targets
    attitude: bytes  # of the quaternion


_KEPT = 4096  # views


def _view_of(vehicle: Vehicle) -> _View:
    attitude = np.asarray(vehicle.attitude, dtype=float)
    bounds = _find_bounds(vehicle.camera)
    return _View(bounds, float(vehicle.position[2] - TARGET_HEIGHT), attitude.tobytes())


@lru_cache(_KEPT)
def _find_bounds(camera: Camera) -> tuple[float, float, float, float] | None:
    return None if camera.fov >= ALL_ROUND else camera.bounds


def points_shown(vehicle: Vehicle, marks: Array) -> Array:
    """Points (K, 2) m, relative to the vehicle, that the image shows at `marks` (K, 2), half edges from its middle.

    Note: a view all round has no image; marks are taken in an image of 90 degrees instead.
    """
    return _find_points(_view_of(vehicle), marks.tobytes()).copy()


@lru_cache(_KEPT)
def _find_points(view: _View, given: bytes) -> Array:
    marks, height = np.frombuffer(given).reshape(-1, 2), view.height
    left, right, low, high = view.bounds or (-1.0, 1.0, -1.0, 1.0)
    half = height * np.array([(right - left) / 2, (high - low) / 2])
    middle = height * np.array([(right + left) / 2, (high + low) / 2])
    rays = np.column_stack([half * marks + middle, np.full(len(marks), -height)])
    points = apply(rotation(np.frombuffer(view.attitude).copy()), rays)
    return np.asarray(points[:, :2] * (height / -points[:, 2:]))


def aim_point(vehicle: Vehicle) -> Array:
    """Point (2,) m, relative to the vehicle, that the middle of the image shows."""
    return points_shown(vehicle, _MIDDLE).ravel()


def viewing_range(vehicle: Vehicle) -> float:
    """Longest planar distance at which the vehicle can see a target [m]."""
    return _find_range(_view_of(vehicle))


@lru_cache(_KEPT)
def _find_range(view: _View) -> float:
    return math.inf if view.bounds is None else float(np.max(length(_find_points(view, _CORNERS.tobytes()))))


def view_quadrangle(vehicle: Vehicle) -> Array:
    """The field of view (5, 3): four half-planes (a, b, c) and, in the last row, x and y [m] of its aim point.

    A point (dx, dy) m from the vehicle is inside if a dx + b dy <= c for all four; (a, b) has length 1. A camera
    sees points between its `bounds` times their depth; at constant height that is linear. Of the view through a lens,
    whose edges are bent, this is the upright rectangle inside it, so that no point is claimed that is not seen.
    """
    return _make_quadrangle(_view_of(vehicle)).copy()


@lru_cache(_KEPT)
def _make_quadrangle(view: _View) -> Array:
    if view.bounds is None:
        return np.array([*((x, y, math.inf) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))), (0, 0, 0)], dtype=float)
    R, out = rotation(np.frombuffer(view.attitude).copy()), np.empty((5, 3))
    left, right, low, high = view.bounds
    for k, (axis, sign, slope) in enumerate(((0, 1.0, right), (0, -1.0, -left), (1, 1.0, high), (1, -1.0, -low))):
        normal = sign * R[:, axis] + slope * R[:, 2]
        size = hypot(normal[0], normal[1])
        out[k] = normal[0] / size, normal[1] / size, view.height * normal[2] / size
    out[4] = *_find_points(view, _MIDDLE.tobytes())[0], 0.0
    return out
