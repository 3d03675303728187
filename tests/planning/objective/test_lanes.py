"""Belief transitions and MWTPs side by side, against matrix algebra and the plain algorithm."""

import dataclasses

import numpy as np
import pytest
from helpers.nominal import plain_mwtp
from scipy.spatial.transform import Rotation

from planning.objective.mwtp import add_penalties
from planning.prediction.field_of_view import view_quadrangle
from planning.prediction.predicted_belief import LANES, advance_belief, advance_with_gains
from planning.prediction.quadrangle import inside
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.geometry.camera import ALL_ROUND, Camera

TRIANGLE = np.triu_indices(4)


def views(team, rng, kind):
    """Fields of view of level or tilted cameras, or of some all round."""
    out = []
    for i, s in enumerate(team):
        turn = Rotation.from_euler("xyz", rng.uniform(-0.4, 0.4, 3)).as_quat() if kind == "tilted" else s.own.attitude
        camera = Camera(ALL_ROUND, 128) if kind == "all round" and i % 2 else s.own.camera
        out.append(view_quadrangle(dataclasses.replace(s.own, attitude=turn, camera=camera)))
    return np.array(out)


@pytest.mark.parametrize("kind", ["level", "tilted", "all round"])
def test_the_penalties_of_plans_side_by_side_are_those_of_the_plain_algorithm(random_team, kind):
    rng, positive = np.random.default_rng(3), 0
    for case in range(60):
        n, T = int(rng.integers(1, 6)), int(rng.integers(0, 9))
        fields = views(random_team(case, uavs=n, targets=1), rng, kind)
        # Of points by axis and sample, as planners have them.
        targets, sensors = rng.uniform(-40, 40, (T, 3, 2))[:, :, 0], rng.uniform(-40, 40, (n, 2, LANES))
        traces = rng.uniform(0.1, 9.0, (T, LANES))
        if case % 3 == 0:
            traces = np.ceil(traces)  # some are equal
        deciding = np.arange(0, n, 2)  # the others are at one place in all lanes
        sensors[1::2] = sensors[1::2, :, :1]
        seen = [any(inside(fields[i], *(t[:2] - sensors[i, :, 0])) for i in range(1, n, 2)) for t in targets]
        ends, sums = np.where(np.arange(n)[:, None] % 2, sensors[:, :, 0], np.nan), np.zeros(LANES)
        add_penalties(targets, traces, np.array(seen, np.bool_), ends, deciding, sensors[::2].copy(), fields, sums)
        expected = [plain_mwtp(targets[:, :2], traces[:, k], sensors[:, :, k], fields) for k in range(LANES)]
        np.testing.assert_allclose(sums, expected, rtol=1e-12)
        positive += np.sum(np.array(expected) > 0)
    assert positive > (1000 if kind != "all round" else 100)


def stepped(P, model, J):
    """Covariances (N, 4, 4) after one transition with information (N, 2, 2), as many at once as there are lanes."""
    noise = np.array([model.Q[0, 0], model.Q[0, 2], model.Q[2, 2]])
    lanes, information, costs = np.zeros((10, LANES)), np.zeros((3, LANES)), np.empty(LANES)
    lanes[:, : len(P)] = P[:, TRIANGLE[0], TRIANGLE[1]].T
    information[:, : len(P)] = J[:, [0, 0, 1], [0, 1, 1]].T
    flat, same = lanes.ravel(), lanes.flatten()
    advance_belief(flat, model.transition, noise, information.ravel())
    advance_with_gains(same, model.transition, noise, information.ravel(), costs)
    np.testing.assert_array_equal(same, flat)
    out = np.empty_like(P)
    out[:, TRIANGLE[0], TRIANGLE[1]] = flat.reshape(10, LANES)[:, : len(P)].T
    out[:, TRIANGLE[1], TRIANGLE[0]] = out[:, TRIANGLE[0], TRIANGLE[1]]
    ahead = (model.F @ P @ model.F.T + model.Q)[:, :2, :2]
    gains = 0.5 * np.log(np.linalg.det(np.eye(2) + J @ ahead))
    np.testing.assert_allclose(-costs[: len(P)], gains, rtol=1e-9)
    return out


@pytest.mark.parametrize(
    "model",
    [
        NearlyConstantVelocity(0.2, 0.7),
        NearlyConstantVelocity(1.0, 0.7),
        MeanRevertingVelocity(1.0, 0.7, walking_speed=1.6, scans=5),
    ],
)
def test_transition_equals_predict_and_update_in_matrix_form(model):
    rng = np.random.default_rng(1)
    H = np.eye(2, 4)
    roots, halves = rng.normal(size=(50, 4, 4)), rng.normal(size=(50, 2, 2))
    P = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(4)
    J = halves @ halves.transpose(0, 2, 1)
    expected = np.linalg.inv(np.linalg.inv(model.F @ P @ model.F.T + model.Q) + H.T @ J @ H)
    np.testing.assert_allclose(stepped(P, model, J), expected, rtol=1e-9, atol=1e-12)
    model = NearlyConstantVelocity(1.0, 0.5)
    after = stepped(np.eye(4)[None], model, np.zeros((1, 2, 2)))
    np.testing.assert_allclose(after[0], model.F @ model.F.T + model.Q, rtol=1e-14)
