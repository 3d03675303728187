"""Attitudes as unit quaternions xyzw, from body to world: the arithmetic on a mission's path.

Recordings depend on every bit of it. Elsewhere scipy's `Rotation` serves.
"""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined, merged
from tracking.numerics.trigonometry import cos, sin


@compiled
def rotation(quaternion: Array) -> Array:
    """Rotation matrix from body to world (3, 3) of a unit quaternion (4,)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@compiled
def engine_rotation(x: float, y: float, z: float, w: float) -> Array:
    """As `rotation`, of a quaternion of any length, with the same bits as the engine's."""
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
        m = engine_rotation(quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3])
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


@merged
def rotate(quaternion: Array, spin: Array, dt: float) -> Array:
    """Quaternion (4,) after a turn from `quaternion` at `spin` (3,) rad/s, in the world frame, for dt s.

    Uses the exponential map, like the engine. The last bit of the engine's own quaternion depends on the processor,
    because its sine and cosine are those of the C library.
    """
    rate = math.sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2])
    scale = sin(0.5 * rate * dt) / rate if rate > 0.0 else 0.5 * dt
    x, y, z, w = scale * spin[0], scale * spin[1], scale * spin[2], cos(0.5 * rate * dt)
    a, b, c, d = quaternion
    out = np.array(
        [
            w * a + x * d + y * c - z * b,
            w * b + y * d + z * a - x * c,
            w * c + z * d + x * b - y * a,
            w * d - x * a - y * b - z * c,
        ]
    )
    norm = math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2] + out[3] * out[3])
    for j in range(4):
        out[j] /= norm
    return out


@inlined
def level_attitude(yaw: float) -> tuple[float, float, float, float]:
    """Quaternion of a level body whose x axis is turned from east towards north by an angle [rad]."""
    return 0.0, 0.0, sin(yaw / 2), cos(yaw / 2)


def multiply(p: Array, q: Array) -> Array:
    """Products (N, 4) of quaternions (N, 4), without the rounding by which scipy normalises them."""
    (a, b, c, d), (x, y, z, w) = p.T, q.T
    east = d * x + a * w + b * z - c * y
    north = d * y - a * z + b * w + c * x
    return np.column_stack([east, north, d * z + a * y - b * x + c * w, d * w - a * x - b * y - c * z])


def mean_spin(a: Array, b: Array, elapsed: float) -> Array:
    """Angular velocity (3,) rad/s, in the world frame, from an attitude (4,) to one that is little turned from it."""
    # Vector and scalar of the turn b a*; twice the vector is the angle, if that is small.
    vector = a[3] * b[:3] - b[3] * a[:3] - np.cross(b[:3], a[:3])
    scalar = a[3] * b[3] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return np.asarray(vector * (math.copysign(2.0, scalar) / elapsed))


def pitch(quaternion: Array, angle: float) -> Array:
    """A carrier's attitude (4,), turned by an angle [rad] about its y axis: a downward view rises to its x axis."""
    if angle == 0.0:
        return quaternion
    x, y, z, w = quaternion.tolist()
    s, c = -sin(angle / 2), cos(angle / 2)
    return np.array([c * x - s * z, c * y + s * w, c * z + s * x, c * w - s * y])


def interpolate_poses(times: Array, poses: Array, at: Array) -> Array:
    """Poses (N, 7) at times `at` (N,) s between the first and the last of `poses` (K, 7), which are at `times` (K,) s.

    A pose is a position and a quaternion. Both are linear in between, the quaternion the shorter way.
    """
    if len(times) == 1:
        return np.repeat(poses, len(at), axis=0)
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    one, other = poses[after - 1], poses[after].copy()
    other[:, 3:] *= np.where(np.sum(one[:, 3:] * other[:, 3:], axis=1) < 0, -1.0, 1.0)[:, None]
    share = ((at - times[after - 1]) / (times[after] - times[after - 1]))[:, None]
    mixed = one + share * (other - one)
    mixed[:, 3:] /= np.sqrt(np.sum(np.square(mixed[:, 3:]), axis=1))[:, None]
    # At the time of a pose it is taken as it is.
    return np.where(share <= 1e-9, one, np.where(share >= 1 - 1e-9, poses[after], mixed))
