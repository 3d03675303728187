"""Mutual information of plans against that of all states and measurements at once."""

import dataclasses

import numpy as np
import pytest
from helpers.nominal import GAINS, information, nominal
from helpers.porous import make_porous, plain_detectabilities

from planning.objective.nbo import make_objective
from planning.prediction.field_of_view import view_quadrangle
from tracking.filter.kalman import Gaussian
from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT

WALKING = MeanRevertingVelocity(1.0, 0.5, walking_speed=1.75, scans=5)


def plain(situation, controls):
    """½ log det(I + R⁻¹ C) of each target; C is the covariance of all positions measured, at all steps at once."""
    total, F, Q = 0.0, situation.motion.F, situation.motion.Q
    for track in situation.tracks:
        mean, variance, spread, rows = track.belief.mean, track.belief.covariance, [], []
        for step in range(controls.shape[1]):
            mean, variance = situation.motion.predict(Gaussian(mean, variance)).mean, F @ variance @ F.T + Q
            spread.append(variance)
            point = np.array([*mean[:2], TARGET_HEIGHT])
            for v, flown in zip(situation.vehicles, controls, strict=True):
                place = v.position[:2] + situation.step * flown[: step + 1].sum(axis=0)
                camera = np.array([*place, v.position[2]])
                seen = v.camera.sees(Pose(camera, v.attitude), point)[0]
                share = seen * plain_detectabilities(situation.forest, camera, point, view_quadrangle(v)[4, 2], 0.0)[0]
                if share > 0.0:
                    rows.append((step, v.noise.covariance(place, point[:2]) / share))
        C, R = np.zeros((2 * len(rows), 2 * len(rows))), np.eye(2 * len(rows))
        for a, (one, noise) in enumerate(rows):
            R[2 * a : 2 * a + 2, 2 * a : 2 * a + 2] = noise
            for b, (other, _) in enumerate(rows):
                early, late = min(one, other), max(one, other)
                both = spread[early] @ np.linalg.matrix_power(F, late - early).T
                C[2 * a : 2 * a + 2, 2 * b : 2 * b + 2] = (both if one <= other else both.T)[:2, :2]
        total += 0.5 * np.linalg.slogdet(np.eye(len(C)) + np.linalg.inv(R) @ C)[1]
    return total


@pytest.mark.parametrize("porous", [False, True])
def test_the_information_is_that_of_all_positions_and_measurements_at_once(random_team, porous):
    """Under porous trees each measurement counts with its probability."""
    seen = 0
    for seed in range(25):
        situation = random_team(seed, spread=12.0 + seed)[0]
        situation = dataclasses.replace(situation, motion=WALKING if seed % 2 else situation.motion)
        if porous:
            forest = make_porous(situation.forest, np.random.default_rng(seed))
            situation = dataclasses.replace(situation, forest=forest)
        controls = np.random.default_rng(seed).uniform(-3.5, 3.5, (3, 5, 2))
        expected = plain(situation, controls)
        found = information(situation, range(3), controls[None])[0]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
        seen += expected > 1.0
    assert seen >= 15


def test_candidates_are_valued_as_joint_plans_and_sums_by_existence(random_team):
    situation = random_team(3)[0]
    view = nominal(situation, 4)._replace(weights=np.array([1.0, 0.5, 0.25, 0.0]))
    rng = np.random.default_rng(0)
    controls, candidates = rng.uniform(-3, 3, (3, 4, 2)), rng.uniform(-3, 3, (6, 3, 4, 2))
    alone = [dataclasses.replace(situation, tracks=(track,)) for track in situation.tracks]
    for uavs in ([0], [2], [2, 1], [0, 1, 2]):
        chosen = candidates[:, : len(uavs)]
        values = make_objective(view, controls, uavs, 0.0, measure=GAINS)(chosen)
        for value, candidate in zip(values, chosen, strict=True):
            joint = controls.copy()
            joint[uavs] = candidate
            each = [plain(one, joint) for one in alone]
            assert -value == pytest.approx(each[0] + 0.5 * each[1] + 0.25 * each[2], rel=1e-9)
