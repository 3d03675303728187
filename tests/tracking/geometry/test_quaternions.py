"""Quaternions against SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracking.geometry import quaternions

# Turns by more than 120 degrees about each axis too, so that each entry of the matrix's diagonal is the largest once.
ATTITUDES = np.vstack([Rotation.random(40, random_state=0).as_quat(), np.eye(4), 0.5 - np.eye(4)])


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_matrices_and_quaternions_are_those_of_scipy(attitude):
    expected = Rotation.from_quat(attitude).as_matrix()
    np.testing.assert_allclose(quaternions.rotation(attitude), expected, atol=1e-15)
    np.testing.assert_allclose(quaternions.engine_rotation(*(3.0 * attitude)), expected, atol=1e-15)
    (settled,) = quaternions.settle(attitude[None])
    np.testing.assert_allclose(settled * np.sign(settled @ attitude), attitude, atol=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_turns_and_products_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    one, other = ATTITUDES[seed], ATTITUDES[seed + 5]
    spin, angle = rng.normal(size=3), rng.uniform(-1.5, 1.5)

    def same(found, expected):
        np.testing.assert_allclose(Rotation.from_quat(found).as_matrix(), expected.as_matrix(), atol=1e-14)

    before, after = Rotation.from_quat(one), Rotation.from_quat(other)
    same(quaternions.rotate(one, spin, 0.7), Rotation.from_rotvec(0.7 * spin) * before)
    same(quaternions.rotate(one, np.zeros(3), 0.7), before)
    same(quaternions.multiply(one[None], other[None])[0], before * after)
    same(quaternions.pitch(one, angle), before * Rotation.from_euler("y", -angle))
    same(np.array(quaternions.level_attitude(angle)), Rotation.from_euler("z", angle))
    near = (Rotation.from_rotvec(1e-4 * spin) * before).as_quat()
    for sign in (1.0, -1.0):  # both are the same attitude
        np.testing.assert_allclose(quaternions.mean_spin(one, sign * near, 1e-4), spin, rtol=1e-6)
