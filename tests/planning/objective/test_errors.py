"""The objective of squared errors up to a cut-off: a plain transcription, and what it makes of lost people."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.nominal import nominal, plain_cost

from planning.loading import load_planner
from planning.objective.nbo import Measure, objective
from planning.prediction.propagation import Nominal
from tracking.filter.kalman import Gaussian
from tracking.track import Track


@pytest.mark.parametrize("doubtful", [False, True])
def test_the_objective_with_a_cutoff_equals_a_plain_transcription(random_team, doubtful):
    changed = 0
    for seed in range(15):
        situation = random_team(seed, spread=12.0 + seed)[0]
        controls = np.random.default_rng(seed).uniform(-3.5, 3.5, (3, 5, 2))
        view = Nominal(doubtful).predict(situation, 5, np.random.default_rng(0))
        wanted, _ = plain_cost(situation, controls, 0.5, expected=doubtful, cutoff=1.0)
        found = objective(view, controls, [0], 0.5, measure=Measure(gains=False, cutoff=1.0))(controls[None, :1])[0]
        assert found == pytest.approx(wanted, rel=1e-6)
        changed += not math.isclose(wanted, plain_cost(situation, controls, 0.5, expected=doubtful)[0], rel_tol=1e-2)
    assert changed >= 10


def test_a_person_lost_for_longer_costs_no_more(random_team):
    situation, still = random_team(2)[0], np.zeros((3, 3, 2))
    view = nominal(situation, 3)
    found = {}
    for cutoff in (np.inf, 10.0):
        for grown in (1e4, 1e6):  # of three of four people
            scales = np.array([1.0, grown, grown, grown])[:, None, None]
            lost = view._replace(covariances=view.covariances * scales)
            values = objective(lost, still, [0], 0.0, measure=Measure(gains=False, cutoff=cutoff))
            found[cutoff, grown] = values(still[None, :1])[0]
    assert found[np.inf, 1e6] > 90.0 * found[np.inf, 1e4]
    assert found[10.0, 1e4] <= found[10.0, 1e6] <= min(1.01 * found[10.0, 1e4], 4 * 3 * 100.0)


def test_a_lost_person_draws_a_uav_away_only_without_a_cutoff(random_team):
    """One UAV holds a person; another is lost 36 m away, and seeing that one takes leaving the first."""
    situation = random_team(2, uavs=1, targets=2, trees=0)[0]
    here = situation.own.position[:2]
    held = Track(0, Gaussian(np.array([*here, 0.0, 0.0]), np.diag([0.1, 0.1, 4.0, 4.0])))
    lost = Track(1, Gaussian(np.array([here[0] + 36.0, here[1], 0.0, 0.0]), np.diag([200.0, 200.0, 0.5, 0.5])))
    situation = dataclasses.replace(situation, tracks=(held, lost))
    ends = []
    for cutoff in (0, 10):
        planner = load_planner(f"sma-nbo-gospa(search=0, cutoff={cutoff}, evaluations=2000)")
        (plan,) = planner.plan([situation], np.random.default_rng(0))
        ends.append(plan.controls[:, 0].sum())
    assert ends[0] > 15.0 and ends[1] < 0.0
