"""Culling of bodies that cannot show in an image."""

import math
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.trigonometry import cos, hypot, sin, tan

NEAR_PLANE = 0.5  # m from the camera, so that its own UAV is left out
LEAST_FAR_PLANE = 500.0  # m; the far plane is farther away for cameras higher than 50 m
# A mesh is a prism: corners at 1.01 of the nominal radius, faces at 0.99.
_OUTER, _INNER = 1.01, 0.99
_PERSON = (0.5, 1.75)  # m, radius and height of an upright cylinder that encloses a person


class _Cylinder(NamedTuple):
    """An upright cylinder that stands on the ground [m]."""

    x: float
    y: float
    radius: float
    height: float


@compiled
def find_in_frustum(centres: Array, radii: Array, position: Array, rotation: Array, fov: float) -> Flags:
    """Mask (B,) of spheres at centres (B, 3) m with radii (B,) m that may show in the image of a camera.

    position (3,) m and rotation (3, 3) from camera to world; fov in rad. Spheres with centres NaN do not show.
    """
    s, c = sin(fov / 2), cos(fov / 2)
    seen = np.empty(len(centres), dtype=np.bool_)
    for k in range(len(centres)):
        x, y, z = centres[k, 0] - position[0], centres[k, 1] - position[1], centres[k, 2] - position[2]
        right = x * rotation[0, 0] + y * rotation[1, 0] + z * rotation[2, 0]
        up = x * rotation[0, 1] + y * rotation[1, 1] + z * rotation[2, 1]
        depth = -(x * rotation[0, 2] + y * rotation[1, 2] + z * rotation[2, 2])
        seen[k] = max(abs(right), abs(up)) * c - depth * s <= radii[k] and depth + radii[k] >= NEAR_PLANE
    return seen


@compiled
def find_hidden_trunks(trees: Array, position: Array, fov: float) -> Flags:
    """Mask (T,) of trees whose canopy hides their trunk from a camera at position (3,) m; trees (T, 7) as in `Tree`."""
    hidden = np.empty(len(trees), dtype=np.bool_)
    for k in range(len(trees)):
        x, y, base, trunk = trees[k, 0], trees[k, 1], trees[k, 3], _OUTER * trees[k, 5]
        hidden[k] = _covers(trees[k], _Cylinder(x, y, trunk, base), position, fov)
    return hidden


@compiled
def find_hidden_people(people: Array, trees: Array, position: Array, fov: float) -> Flags:
    """Mask (M,) of people at (M, 2) m that a single tree of (T, 7) fully hides from a camera at position (3,) m."""
    hidden = np.zeros(len(people), dtype=np.bool_)
    for i in range(len(people)):
        body = _Cylinder(people[i, 0], people[i, 1], _PERSON[0], _PERSON[1])
        for k in range(len(trees)):
            # Skip trees whose canopy does not extend over the person's x: they rarely hide a whole person.
            if abs(trees[k, 0] - people[i, 0]) <= trees[k, 2] and _covers(trees[k], body, position, fov):
                hidden[i] = True
                break
    return hidden


@compiled
def _covers(tree: Array, body: _Cylinder, position: Array, fov: float) -> bool:
    """True if a tree's canopy hides a body from a camera at position (3,) m."""
    radius, base, top = _INNER * tree[2], tree[3], tree[4]
    # At this height above a canopy the near plane cuts off no part of it.
    clearance = NEAR_PLANE * math.sqrt(1 + 2 * tan(fov / 2) * tan(fov / 2))
    if position[2] < top + clearance or body.height > base:
        return False
    # Offsets of body and camera from the tree's axis. Lines of sight from the body's foot and head cross the plane of
    # the canopy's base in two discs, and lines from points between them in discs between these.
    x, y = body.x - tree[0], body.y - tree[1]
    dx, dy = position[0] - tree[0], position[1] - tree[1]
    foot, head = base / position[2], (base - body.height) / (position[2] - body.height)
    farthest = max(
        hypot(x + foot * (dx - x), y + foot * (dy - y)),
        hypot(x + head * (dx - x), y + head * (dy - y)),
    )
    return bool(farthest + body.radius <= radius)
