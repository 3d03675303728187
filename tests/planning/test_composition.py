"""A composed planner judges commands by mean velocities under lag."""

import dataclasses

import numpy as np
import pytest
from helpers.teams import planned, refitted

from planning.composed import Composed
from planning.objective.nbo import make_objective
from planning.planner import Plan
from planning.prediction.intent import base_policy_plans, expect_plans
from planning.prediction.propagation import Nominal
from planning.prediction.response import mean_velocities, response

COMMANDS = np.random.default_rng(5).uniform(-5, 5, (40, 1, 3, 2))
EASE = np.array([1.5])  # m/s


class Asking:
    """An optimiser that asks for the costs of fixed commands, also with wider fields of view, and keeps them."""

    def __init__(self):
        self.values = []

    def minimise(self, objective, starts, max_speeds, rng, in_reach=None):
        asked = COMMANDS[:, :, : starts.shape[2]]
        self.values += [objective(asked), objective(asked, EASE)]
        return asked[0]


class Told(Composed):
    """Has a term without a cost that keeps the velocities at which it is told that all fly."""

    @property
    def terms(self):
        return (self,)

    def objective(self, situation, velocities, uavs):
        object.__setattr__(self, "velocities", velocities)


@pytest.mark.parametrize("actions", ["all", "first"])
def test_commands_are_judged_by_the_mean_velocities_of_uavs_that_lag(random_team, actions):
    """UAVs 0, 3 and 4, each with a lag and a velocity of its own."""
    ids, rng = {0: 0, 1: 3, 2: 4}, np.random.default_rng(2)
    velocities = rng.uniform(-2.5, 2.5, (3, 2))
    team = refitted(
        random_team(4, spread=12.0),
        lambda v: dataclasses.replace(v, id=ids[v.id], lag=0.3 + 0.3 * v.id, max_speed=4.0, velocity=velocities[v.id]),
    )
    intents = {i: Plan(rng.uniform(-2.5, 2.5, (4, 2))) for i in ids.values()}
    team = [dataclasses.replace(s, intents=intents) for s in team]
    asking = Asking()
    told = Told(horizon=3, optimizer=asking, actions=actions, beta=0.5)
    planned(told, team[:1])
    situation, uavs = team[0], [0]
    expected = expect_plans(situation, 3)
    belief = Nominal().predict(situation, 3, rng)
    plans = COMMANDS
    if actions == "first":
        plans = base_policy_plans(situation, situation.own, COMMANDS[:, 0, :1], 3)[:, None]
    others = mean_velocities(response(situation.vehicles, situation.step), expected[None])[0]
    flown = mean_velocities(response([situation.own], situation.step), plans)
    np.testing.assert_array_equal(told.velocities, others)
    of_tracks = make_objective(belief, others, uavs, 0.5)
    np.testing.assert_allclose(asking.values, [of_tracks(flown), of_tracks(flown, EASE)], rtol=1e-12)
    assert np.any(asking.values[0] != asking.values[1])
    assert np.mean(np.abs(asking.values[0] - make_objective(belief, expected, uavs, 0.5)(plans)) > 1e-6) > 0.5
