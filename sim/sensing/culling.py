"""Culling of bodies that cannot show in an image."""

import math
from collections.abc import Sequence

import numpy as np

from tracking.geometry.visibility import Solid
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.trigonometry import cos, hypot, sin, tan

NEAR_PLANE = 0.5  # m from the camera, so that its own UAV is left out
LEAST_FAR_PLANE = 500.0  # m; the far plane is farther away for cameras higher than 50 m
# A mesh is a prism: corners at 1.01 of the nominal radius, faces at 0.99.
_OUTER, _INNER = 1.01, 0.99


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


def select_standing(solids: Sequence[Solid]) -> Array:
    """Upright cylinders (N, 4) m around the solids that stand on the ground, as in `find_hidden`; NaN for others."""
    rows = [(s.x, s.y, _OUTER * s.radius, s.top) if s.bottom == 0.0 else (math.nan,) * 4 for s in solids]
    return np.array(rows, dtype=float).reshape(-1, 4)


def select_covers(solids: Sequence[Solid]) -> Array:
    """Opaque solids above the ground (C, 5) m: x, y, radius, bottom, top. Porous ones hide nobody for certain."""
    rows = [s[1:6] for s in solids if s.bottom > 0.0 and not s.is_porous]
    return np.array(rows, dtype=float).reshape(-1, 5)


@compiled
def find_hidden(bodies: Array, covers: Array, position: Array, fov: float) -> Flags:
    """Mask (N,) of bodies that a single one of the covers fully hides from a camera at position (3,) m.

    bodies (N, 4) m: x, y, radius and height of upright cylinders on the ground. covers (C, 5) m as in `select_covers`.
    """
    hidden = np.zeros(len(bodies), dtype=np.bool_)
    for i in range(len(bodies)):
        for k in range(len(covers)):
            # Skip covers that do not extend over the body's x: they rarely hide a whole one.
            if abs(covers[k, 0] - bodies[i, 0]) <= covers[k, 2] and _covers(covers[k], bodies[i], position, fov):
                hidden[i] = True
                break
    return hidden


@compiled
def _covers(cover: Array, body: Array, position: Array, fov: float) -> bool:
    """True if a cover hides a body from a camera at position (3,) m."""
    radius, base, top, height = _INNER * cover[2], cover[3], cover[4], body[3]
    # At this height above a cover the near plane cuts off no part of it.
    clearance = NEAR_PLANE * math.sqrt(1 + 2 * tan(fov / 2) * tan(fov / 2))
    if position[2] < top + clearance or height > base:
        return False
    # Offsets of body and camera from the cover's axis. Lines of sight from the body's foot and head cross the plane of
    # the cover's base in two discs, and lines from points between them in discs between these.
    x, y = body[0] - cover[0], body[1] - cover[1]
    dx, dy = position[0] - cover[0], position[1] - cover[1]
    foot, head = base / position[2], (base - height) / (position[2] - height)
    farthest = max(
        hypot(x + foot * (dx - x), y + foot * (dy - y)),
        hypot(x + head * (dx - x), y + head * (dy - y)),
    )
    return bool(farthest + body[2] <= radius)
