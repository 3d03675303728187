"""The learned cost-to-go against a plain transcription, and where it leads a UAV."""

import dataclasses

import numpy as np
import pytest
from helpers.nominal import plain_cost
from helpers.teams import planned

from planning.objective.cost_to_go import FUTURE, cost_to_go
from planning.objective.nbo import Measure, make_objective
from planning.prediction.propagation import Nominal
from tracking.filter.kalman import Gaussian
from tracking.track import Track


@pytest.mark.parametrize("uavs", [[0], [1, 2]])
@pytest.mark.parametrize(("expected", "beta"), [(False, 0.0), (True, 0.0), (True, 0.5)])
def test_the_cost_to_go_equals_a_plain_transcription(random_team, uavs, expected, beta):
    """People are near and far; some are in view at the end, some were before, some never."""
    worth = []
    for seed in range(20):
        situation = random_team(seed, spread=15.0 + 3.0 * seed)[0]
        rng = np.random.default_rng(seed)
        controls, weights = rng.uniform(-3.5, 3.5, (3, 5, 2)), rng.uniform(0.1, 1.0, 4)
        view = Nominal(expected).predict(situation, 5, rng)._replace(weights=weights)
        measure = Measure(gains=False, cutoff=4.0, ahead=cost_to_go(situation.vehicles, 0.3))
        found = make_objective(view, controls, uavs, beta, measure=measure)(controls[None, uavs])[0]
        plain, without = (
            plain_cost(situation, controls, beta, expected=expected, weights=weights, cutoff=4.0, ahead=w)[0]
            for w in (0.3, 0.0)
        )
        assert found == pytest.approx(plain, rel=1e-6)  # marks have eight digits
        worth.append(plain / without)
    assert min(worth) > 1.01 and max(worth) > 1.5 - beta


def test_errors_to_come_grow_with_spread_and_with_the_way_to_go():
    assert np.all(np.diff(FUTURE, axis=0) >= 0.0) and np.all(np.diff(FUTURE, axis=1) >= 0.0)
    assert FUTURE.min() > 0.0 and FUTURE.max() == 15.0


def test_a_cost_to_go_leads_a_uav_towards_people_beyond_its_horizon(random_team):
    """The only person is lost, and can be in view after 8 s; plans last 3 s."""
    situation = random_team(2, uavs=1, targets=1, trees=0)[0]
    (x, y, _), reach = situation.own.position, situation.own.max_speed * situation.step
    lost = Track(1, Gaussian(np.array([x + 8.0 * reach + 10.0, y, 0.0, 0.0]), np.diag([9.0, 9.0, 0.5, 0.5])))
    situation = dataclasses.replace(situation, tracks=(lost,))
    options = "search=0, horizon=3, evaluations=2000"
    with_one = planned(f"sma-nbo-gospa({options}, cost_to_go=0.3)", [situation])[0]
    assert with_one[:, 0].sum() * situation.step > 2.5 * reach
