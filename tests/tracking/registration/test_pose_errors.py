"""Errors of poses to first order, against rays from poses that err and against samples of the errors."""

import numpy as np
import pytest
from helpers.poses import tilted

from sim.sensing.navigation import NavigationErrors
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import rotate
from tracking.navigation import NAVIGATION
from tracking.registration.pose_errors import ERRORS, error_slopes, move_to_believed
from tracking.registration.registration import make_registration
from tracking.track import Scan

VELOCITY = np.array([3.0, -1.0])


def mislead(pose, errors):
    """The believed pose of a camera for errors (7,)."""
    moved = errors[:3] + errors[6] * np.append(VELOCITY, 0.0)
    return Pose(pose.position + moved, rotate(pose.quaternion, errors[3:6], 1.0))


def test_slopes_are_the_derivatives_of_where_rays_meet_the_ground():
    rng, step = np.random.default_rng(0), 1e-5
    for _ in range(20):
        true = tilted(rng, rng.normal(0, 5, 3) + np.array([0.0, 0.0, 25.0]), 0.4)
        points = true.position[:2] + rng.normal(0, 6, (4, 2))
        slopes = error_slopes(points, true, VELOCITY)
        for part in range(ERRORS):
            there, back = (move_to_believed(points, true, mislead(true, s * step * np.eye(7)[part])) for s in (1, -1))
            np.testing.assert_allclose(slopes[:, :, part], (there - back) / (2 * step), atol=1e-6)


@pytest.mark.parametrize("name", ["rtk", "gnss", "consumer"])
def test_covariances_are_those_of_sampled_errors(name):
    true, points = Pose.level(1, 2, 20), np.array([[1.0, 2.0], [9.0, 2.0], [-5.0, 10.0]])
    drawn = [NavigationErrors(NAVIGATION[name], np.random.default_rng(seed)) for seed in range(6000)]
    velocity = np.append(VELOCITY, 0.0)
    believed = [e.mislead(Pose(true.position + e.clock * velocity, true.quaternion)) for e in drawn]
    moved = np.array([move_to_believed(points, true, pose) for pose in believed]) - points
    registration = make_registration(NAVIGATION[name], "inflate", known=True)
    for time in (0.0, 0.2, 0.4):  # the velocity is that from scan to scan
        pose = Pose(true.position + (time - 0.4) * velocity, true.quaternion)
        scan = registration.correct(Scan(0, time, pose, points, np.zeros((3, 2, 2))))
    np.testing.assert_array_equal(scan.measurements, points)
    registration.learn(np.array([4]), np.eye(4)[None], 2)  # nothing of the fleet, to which tracks would owe more
    np.testing.assert_array_equal(registration.find_added([4], np.ones((1, 4))), np.zeros((1, 4, 4)))
    for k, expected in enumerate(scan.covariances):
        scale = np.trace(expected)
        np.testing.assert_allclose(np.cov(moved[:, k].T), expected, atol=0.05 * scale)
        assert np.abs(moved[:, k].mean(axis=0)).max() < 5 * np.sqrt(scale / 6000)
