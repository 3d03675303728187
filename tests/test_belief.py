"""The compiled belief transition against matrix algebra."""

import numpy as np
import pytest

from planning.belief import transition
from tracking.kalman import NearlyConstantVelocity


@pytest.mark.parametrize("dt", [0.2, 1.0])
def test_transition_equals_predict_and_update_in_matrix_form(dt):
    rng = np.random.default_rng(1)
    model = NearlyConstantVelocity(dt, 0.7)
    noise = np.array([model.Q[0, 0], model.Q[0, 2], model.Q[2, 2]])
    H = np.eye(2, 4)
    for _ in range(50):
        root = rng.normal(size=(4, 4))
        P = root @ root.T + 0.1 * np.eye(4)
        half = rng.normal(size=(2, 2))
        J = half @ half.T
        predicted = model.F @ P @ model.F.T + model.Q
        expected = np.linalg.inv(np.linalg.inv(predicted) + H.T @ J @ H)
        transition(P, dt, noise, np.array([J[0, 0], J[0, 1], J[1, 1]]))
        np.testing.assert_allclose(P, expected, rtol=1e-9, atol=1e-12)


def test_without_information_the_covariance_only_grows():
    model = NearlyConstantVelocity(1.0, 0.5)
    P = np.eye(4)
    transition(P, 1.0, np.array([model.Q[0, 0], model.Q[0, 2], model.Q[2, 2]]), np.zeros(3))
    np.testing.assert_allclose(P, model.F @ model.F.T + model.Q, rtol=1e-14)
