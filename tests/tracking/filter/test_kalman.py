"""Kalman filter: the model of the paper, stacks of beliefs, and filterpy."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from helpers.scenes import H

from tracking.association.jpda import mixture_update
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.filter.mean_reverting import MeanRevertingVelocity

MOTION = NearlyConstantVelocity(0.2, 0.5)


def update(predicted: Gaussian, z: np.ndarray, R: np.ndarray) -> Gaussian:
    """Update by a measurement that is the person's for sure."""
    stack = predicted.mean[None], predicted.covariance[None]
    mean, covariance = mixture_update(stack, stack, z[None], R[None], np.array([[0.0, 1.0]]))
    return Gaussian(mean[0], covariance[0])


def random_beliefs(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    roots = rng.normal(size=(count, 4, 4))
    return rng.normal(scale=50, size=(count, 4)), roots @ np.swapaxes(roots, 1, 2) + 0.01 * np.eye(4)


def test_the_model_is_equation_1_of_the_paper():
    dt, s = 0.2, 0.5
    np.testing.assert_array_equal(MOTION.F, [[1, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]])
    G = np.array([[dt**2 / 2, 0], [0, dt**2 / 2], [dt, 0], [0, dt]])
    np.testing.assert_allclose(MOTION.Q, s**2 * G @ G.T, rtol=1e-14)


@pytest.mark.parametrize("model", [MOTION, MeanRevertingVelocity(0.2, 1.0, walking_speed=1.6)])
def test_predicting_a_stack_is_predicting_each(model):
    means, covariances = random_beliefs(np.random.default_rng(0), 300)
    new_means, new_covariances = model.predict_all(means, covariances)
    for k in range(300):
        one = model.predict(Gaussian(means[k], covariances[k]))
        np.testing.assert_allclose(new_means[k], one.mean, rtol=1e-12)
        np.testing.assert_allclose(new_covariances[k], one.covariance, rtol=1e-11, atol=1e-12)


def test_a_run_is_filterpys_kalman_filter():
    rng = np.random.default_rng(2)
    peer = KalmanFilter(4, 2)
    peer.x, peer.P, peer.F, peer.Q, peer.H = np.zeros(4), 3 * np.eye(4), MOTION.F, MOTION.Q, H
    belief = Gaussian(np.zeros(4), 3 * np.eye(4))
    for k in range(50):
        z, R = np.array([0.3 * k, -0.1 * k]) + rng.normal(size=2), np.diag(rng.uniform(0.1, 1, 2))
        peer.predict()
        peer.update(z, R)
        belief = update(MOTION.predict(belief), z, R)
    np.testing.assert_allclose(belief.mean, peer.x, rtol=1e-10)
    np.testing.assert_allclose(belief.covariance, peer.P, rtol=1e-10, atol=1e-14)
