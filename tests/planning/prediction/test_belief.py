"""The compiled belief transition against matrix algebra."""

import numpy as np
import pytest

from planning.prediction.predicted_belief import LANES, belief_transition
from tracking.filter.kalman import NearlyConstantVelocity

TRIANGLE = np.triu_indices(4)


def stepped(P, model, J):
    """Covariances (N, 4, 4) after one transition with information (N, 2, 2), as many at once as there are lanes."""
    noise = np.array([model.Q[0, 0], model.Q[0, 2], model.Q[2, 2]])
    lanes, information, traces = np.zeros((10, LANES)), np.zeros((3, LANES)), np.empty(LANES)
    lanes[:, : len(P)] = P[:, TRIANGLE[0], TRIANGLE[1]].T
    information[:, : len(P)] = J[:, [0, 0, 1], [0, 1, 1]].T
    flat = lanes.ravel()
    belief_transition(flat, model.dt, noise, information.ravel(), traces)
    out = np.empty_like(P)
    out[:, TRIANGLE[0], TRIANGLE[1]] = flat.reshape(10, LANES)[:, : len(P)].T
    out[:, TRIANGLE[1], TRIANGLE[0]] = out[:, TRIANGLE[0], TRIANGLE[1]]
    np.testing.assert_array_equal(traces[: len(P)], out[:, 0, 0] + out[:, 1, 1])
    return out


@pytest.mark.parametrize("dt", [0.2, 1.0])
def test_transition_equals_predict_and_update_in_matrix_form(dt):
    rng = np.random.default_rng(1)
    model = NearlyConstantVelocity(dt, 0.7)
    H = np.eye(2, 4)
    roots, halves = rng.normal(size=(50, 4, 4)), rng.normal(size=(50, 2, 2))
    P = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(4)
    J = halves @ halves.transpose(0, 2, 1)
    expected = np.linalg.inv(np.linalg.inv(model.F @ P @ model.F.T + model.Q) + H.T @ J @ H)
    np.testing.assert_allclose(stepped(P, model, J), expected, rtol=1e-9, atol=1e-12)


def test_without_information_the_covariance_only_grows():
    model = NearlyConstantVelocity(1.0, 0.5)
    after = stepped(np.eye(4)[None], model, np.zeros((1, 2, 2)))
    np.testing.assert_allclose(after[0], model.F @ model.F.T + model.Q, rtol=1e-14)
