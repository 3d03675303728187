"""Sequential planning: its identities with single-UAV planning and its monotonicity."""

import dataclasses

import numpy as np
import pytest

from planning.belief import outlook
from planning.intent import BASE_RANGE, base_control, policy_of_intent
from planning.nbo import costs, team_cost
from planning.optimizers import CrossEntropy
from planning.planner import Plan
from planning.sma import SMA, pursuits


def test_with_one_uav_the_plan_is_the_single_uav_plan(random_team):
    team = random_team(4, uavs=1)
    planned = SMA(horizon=3).plan(team, np.random.default_rng(9))[0].controls
    view = outlook(team[0], 3)
    intent = policy_of_intent(team[0], team[0].own, 3)[None]
    alone = CrossEntropy().minimise(
        lambda c: costs(view, intent, 0, c, 0.5),
        np.concatenate([intent, pursuits(view, 0, team[0].own)]),
        5.0,
        np.random.default_rng(9),
    )
    np.testing.assert_array_equal(planned, alone)


@pytest.mark.parametrize(("cost_to_go", "beta"), [("none", 0.0), ("mwtp", 0.5)])
def test_no_step_of_the_sequence_raises_the_teams_objective(random_team, cost_to_go, beta):
    lowered = 0
    for seed in range(10):
        team = random_team(seed)
        view = outlook(team[0], 5)
        joint = np.array([policy_of_intent(team[0], s.own, 5) for s in team])
        plans = SMA(cost_to_go=cost_to_go).plan(team, np.random.default_rng(seed))
        before = first = team_cost(view, joint, beta)
        for uav, plan in enumerate(plans):
            joint[uav] = plan.controls
            after = team_cost(view, joint, beta)
            assert after <= before + 1e-9 * abs(before)
            before = after
        lowered += before < first
    assert lowered == 10


def test_the_last_plan_is_a_start_that_is_never_made_worse(random_team):
    team = random_team(2)
    plans = SMA().plan(team, np.random.default_rng(0))
    lazy = CrossEntropy(population=1, elites=1, rounds=1)
    intents = {s.own.id: Plan(np.vstack([np.zeros((1, 2)), p.controls])) for s, p in zip(team, plans, strict=True)}
    again = [dataclasses.replace(s, intents=intents) for s in team]
    view = outlook(team[0], 5)
    cost = team_cost(view, np.array([p.controls for p in plans]), 0.5)
    kept = SMA(optimizer=lazy).plan(again, np.random.default_rng(1))
    assert team_cost(view, np.array([p.controls for p in kept]), 0.5) <= cost * (1 + 1e-9)


def test_the_policy_of_intent_is_the_last_plan_shifted_and_one_base_step(random_team):
    situation = random_team(7, trees=0)[0]
    last = np.arange(10.0).reshape(5, 2) / 5
    situation = dataclasses.replace(situation, intents={0: Plan(last)})
    intent = policy_of_intent(situation, situation.own, 5)
    np.testing.assert_array_equal(intent[:4], last[1:])
    end = situation.own.position[:2] + last[1:].sum(axis=0)
    near = [t for t in situation.tracks if np.hypot(*(t.belief.mean[:2] + 5 * t.belief.mean[2:] - end)) <= BASE_RANGE]
    worst = max(near, key=lambda t: np.trace(t.belief.covariance[:2, :2]))
    gap = worst.belief.mean[:2] + 5 * worst.belief.mean[2:] - end
    np.testing.assert_allclose(intent[4], gap * min(1.0, 5.0 / np.hypot(*gap)), rtol=1e-12)


def test_the_base_policy_hovers_where_no_track_is_within_its_range(random_team):
    situation = random_team(0)[0]
    far = situation.own.position[:2] + np.array([1000.0, 0.0])
    np.testing.assert_array_equal(base_control(situation.own, far, situation.tracks, 0.0, 1.0), np.zeros(2))
