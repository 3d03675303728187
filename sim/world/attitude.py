"""Attitudes of bodies as the engine converts and turns them."""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.trigonometry import cos, sin


@compiled
def matrix_of(quaternion: Array) -> Array:
    """Rotation matrix (3, 3) from body to world, to the bits of the engine; quaternion xyzw (4,) of any length."""
    x, y, z, w = quaternion
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
    out = np.empty_like(quaternions)
    for row, quaternion in zip(out, quaternions):  # noqa: B905 - Numba has no `strict`
        m = matrix_of(quaternion)
        trace = m[0, 0] + m[1, 1] + m[2, 2]
        if trace > 0.0:
            root = math.sqrt(trace + 1.0)
            half = 0.5 / root
            row[3] = root * 0.5
            row[0] = (m[2, 1] - m[1, 2]) * half
            row[1] = (m[0, 2] - m[2, 0]) * half
            row[2] = (m[1, 0] - m[0, 1]) * half
        else:
            i = 1 if m[0, 0] < m[1, 1] else 0
            i = 2 if m[i, i] < m[2, 2] else i
            j, k = (i + 1) % 3, (i + 2) % 3
            root = math.sqrt(m[i, i] - m[j, j] - m[k, k] + 1.0)
            half = 0.5 / root
            row[i] = root * 0.5
            row[3] = (m[k, j] - m[j, k]) * half
            row[j] = (m[j, i] + m[i, j]) * half
            row[k] = (m[k, i] + m[i, k]) * half
    return out


@compiled
def rotate(quaternion: Array, spin: Array, dt: float) -> Array:
    """Quaternion xyzw (4,) after a turn from `quaternion` at `spin` (3,) rad/s, in the world frame, for dt s.

    Uses the exponential map, like the engine. The last bit of the engine's own quaternion depends on the processor,
    because its sine and cosine are those of the C library.
    """
    rate = math.sqrt(np.sum(spin * spin))
    scale = sin(0.5 * rate * dt) / rate if rate > 0.0 else 0.5 * dt
    (x, y, z), w = scale * spin, cos(0.5 * rate * dt)
    a, b, c, d = quaternion
    out = np.array(
        [
            w * a + x * d + y * c - z * b,
            w * b + y * d + z * a - x * c,
            w * c + z * d + x * b - y * a,
            w * d - x * a - y * b - z * c,
        ]
    )
    return out / math.sqrt(np.sum(out * out))
