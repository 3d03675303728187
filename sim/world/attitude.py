"""Attitudes of bodies as the engine converts and turns them."""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled


@compiled
def matrix_of(x: float, y: float, z: float, w: float) -> Array:
    """Rotation matrix (3, 3) from body to world of a quaternion of any length, with the same bits as the engine's."""
    s = 2.0 / (x * x + y * y + z * z + w * w)
    xs, ys, zs = x * s, y * s, z * s
    wx, wy, wz = w * xs, w * ys, w * zs
    xx, xy, xz = x * xs, x * ys, x * zs
    yy, yz, zz = y * ys, y * zs, z * zs
    return np.array(
        [
            [1.0 - (yy + zz), xy - wz, xz + wy],
            [xy + wz, 1.0 - (xx + zz), yz - wx],
            [xz - wy, yz + wx, 1.0 - (xx + yy)],
        ]
    )


@compiled
def settle(quaternions: Array) -> Array:
    """Quaternions (n, 4) as the engine returns those given to it, which it converts to matrices and back."""
    out = np.empty(quaternions.shape)
    for i in range(len(quaternions)):
        m = matrix_of(quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3])
        trace = m[0, 0] + m[1, 1] + m[2, 2]
        if trace > 0.0:
            root = math.sqrt(trace + 1.0)
            half = 0.5 / root
            out[i, 3] = root * 0.5
            out[i, 0] = (m[2, 1] - m[1, 2]) * half
            out[i, 1] = (m[0, 2] - m[2, 0]) * half
            out[i, 2] = (m[1, 0] - m[0, 1]) * half
        else:
            a = 1 if m[0, 0] < m[1, 1] else 0
            a = 2 if m[a, a] < m[2, 2] else a
            b, c = (a + 1) % 3, (a + 2) % 3
            root = math.sqrt(m[a, a] - m[b, b] - m[c, c] + 1.0)
            half = 0.5 / root
            out[i, a] = root * 0.5
            out[i, 3] = (m[c, b] - m[b, c]) * half
            out[i, b] = (m[b, a] + m[a, b]) * half
            out[i, c] = (m[c, a] + m[a, c]) * half
    return out
