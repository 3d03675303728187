"""Errors of poses to first order, against rays from poses that err and against samples of the errors."""

import numpy as np
import pytest
from helpers.poses import tilted

from sim.sensing.navigation import NavigationErrors
from tracking.geometry.camera import Pose, rotate
from tracking.navigation import NAVIGATION
from tracking.registration.pose_errors import ERRORS, ErrorModel, error_slopes, move_to_believed, sandwich

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
    believed = [errors.mislead(true, np.append(VELOCITY, 0.0), np.zeros(3)) for errors in drawn]
    moved = np.array([move_to_believed(points, true, pose) for pose in believed]) - points
    model = ErrorModel(NAVIGATION[name])
    expected = sandwich(error_slopes(points, true, VELOCITY), np.diag(model.variances + model.noise))
    for k in range(len(points)):
        scale = np.trace(expected[k])
        np.testing.assert_allclose(np.cov(moved[:, k].T), expected[k], atol=0.05 * scale)
        assert np.abs(moved[:, k].mean(axis=0)).max() < 5 * np.sqrt(scale / 6000)


def test_correlations_are_those_of_sampled_errors():
    """Yaw of consumer UAVs, whose bias stays while its drift goes."""
    pairs = []
    for seed in range(4000):
        errors = NavigationErrors(NAVIGATION["consumer"], np.random.default_rng(seed))
        pair = []
        for _ in range(2):
            pair.append(errors.mislead(Pose.level(0, 0, 20), np.zeros(3), np.zeros(3)).quaternion[2])
            errors.advance(60.0)
        pairs.append(pair)
    assert np.corrcoef(np.array(pairs).T)[0, 1] == pytest.approx(
        ErrorModel(NAVIGATION["consumer"]).correlation(60.0)[5], abs=0.01
    )
