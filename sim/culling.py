"""Which bodies cannot show in an image."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tracking.compiled import Array, compiled

NEAR, FAR = 0.5, 500.0  # m, along the optical axis; the carrier's own body is nearer than NEAR
# Of meshes to the cylinders that they stand for: from the corners, which are outside, to the faces, which are inside.
_OUTER, _INNER = 1.01, 0.99


@compiled
def in_frustum(centres: Array, radii: Array, position: Array, rotation: Array, fov: float) -> NDArray[np.bool_]:
    """Which spheres at centres (B, 3) m with radii (B,) m a camera at position (3,) m may see (B,); none at NaN.

    rotation (3, 3) from the camera to the world; fov in rad.
    """
    sin, cos = math.sin(fov / 2), math.cos(fov / 2)
    seen = np.empty(len(centres), dtype=np.bool_)
    for k in range(len(centres)):
        x, y, z = centres[k, 0] - position[0], centres[k, 1] - position[1], centres[k, 2] - position[2]
        right = x * rotation[0, 0] + y * rotation[1, 0] + z * rotation[2, 0]
        up = x * rotation[0, 1] + y * rotation[1, 1] + z * rotation[2, 1]
        depth = -(x * rotation[0, 2] + y * rotation[1, 2] + z * rotation[2, 2])
        seen[k] = max(abs(right), abs(up)) * cos - depth * sin <= radii[k] and depth + radii[k] >= NEAR
    return seen


@compiled
def under_canopy(trees: Array, position: Array, fov: float) -> NDArray[np.bool_]:
    """Which trees (T, 6), in the order of `Tree`, hide all of their own trunk from a camera at position (3,) m (T,)."""
    # Else the near plane could cut away what hides the trunk: so high above a canopy it is too far for that.
    clearance = NEAR * math.sqrt(1 + 2 * math.tan(fov / 2) ** 2)
    hidden = np.zeros(len(trees), dtype=np.bool_)
    for k in range(len(trees)):
        x, y, canopy, base, top, trunk = trees[k]
        if position[2] >= top + clearance:
            # How far from the axis the lines to the trunk's foot pass the canopy's base.
            distance = math.sqrt((position[0] - x) ** 2 + (position[1] - y) ** 2)
            hidden[k] = _OUTER * trunk + distance * base / position[2] <= _INNER * canopy
    return hidden
