"""Interpolation of poses in time."""

import numpy as np

from tracking.numerics.arrays import Array


def interpolate_poses(times: Array, poses: Array, at: Array) -> Array:
    """Poses (N, 7) at times `at` (N,) s between the first and the last of `poses` (K, 7), which are at `times` (K,) s.

    A pose is a position and a quaternion xyzw. Both are linear in between, the quaternion the shorter way.
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
