"""Coordination schemes against one another, single decisions and exhaustive search."""

import dataclasses
import itertools

import numpy as np
import pytest
from helpers.nominal import nominal, team_cost
from helpers.teams import knowing, planned

from planning.composed import Composed
from planning.coordination.schemes import Centralised, Decentralised, Parallel, Sequential, SequentialPartitions
from planning.optimizers.grid_search import GridSearch
from planning.planner import Plan
from planning.prediction.intent import BASE_RANGE, base_control, expect_plans, policy_of_intent
from tracking.geometry.visibility import Forest


def test_each_uav_answers_plans_before_it_and_in_parallel_all_intents(random_team):
    team = random_team(3)
    plans = planned(Composed(), team, 1)
    rng = np.random.default_rng(1)
    joint = expect_plans(team[0], 5)
    for uav, situation in enumerate(team):
        joint[uav] = Composed().decide(situation, joint, [uav], rng)[0]
    np.testing.assert_array_equal(plans, joint)
    team = random_team(6)
    plans = planned(Composed(coordination=Parallel()), team, 2)
    rng = np.random.default_rng(2)
    for uav, situation in enumerate(team):
        single = Composed().decide(situation, expect_plans(situation, 5), [uav], rng)[0]
        np.testing.assert_array_equal(plans[uav], single)


def test_the_worst_first_is_the_uav_near_the_most_uncertain_track(random_team):
    team = random_team(5)
    traces = [
        max(
            np.trace(t.belief.covariance[:2, :2])
            for t in s.tracks
            if np.hypot(*(t.belief.mean[:2] - s.own.position[:2])) <= BASE_RANGE
        )
        for s in team
    ]
    order = sorted(range(3), key=lambda i: -traces[i])
    rng, scheme = np.random.default_rng(0), Sequential("worst-first")
    assert scheme._order_team(team, rng) == [team[i] for i in order]
    team[order[0]] = dataclasses.replace(team[order[0]], tracks=())  # one without tracks comes last
    assert Sequential("worst-first")._order_team(team, np.random.default_rng(0)) == [
        team[i] for i in np.roll(order, -1)
    ]


def test_the_centre_knows_all_and_shares_its_plan_with_equal_beliefs(random_team):
    apart, centre = Composed(coordination=Decentralised()), Composed(coordination=Centralised())
    for seed in range(4):
        team = random_team(seed)
        shares = planned(apart, team, seed)
        np.testing.assert_array_equal(shares, planned(centre, team, seed))
    mixed = [team[0], dataclasses.replace(team[1], tracks=random_team(9)[1].tracks), team[2]]
    own = planned(apart, mixed, seed)
    np.testing.assert_array_equal(own[[0, 2]], shares[[0, 2]])
    assert not np.array_equal(own[1], shares[1])
    team = random_team(1)
    deaf = [dataclasses.replace(s, neighbours=()) for s in team]
    np.testing.assert_array_equal(planned(centre, deaf), planned(centre, team))


class Lazy:
    """An optimiser that keeps the first of its starts, the intents."""

    def minimise(self, objective, starts, *_):
        return starts[0]


def test_the_centre_goes_on_from_each_uavs_own_last_plan(random_team):
    last = np.random.default_rng(0).uniform(-3, 3, (3, 5, 2))
    team = knowing(random_team(0), last)
    stale = {i: Plan(np.zeros((6, 2))) for i in range(3)}
    misled = [dataclasses.replace(s, intents=stale | {s.own.id: s.intents[s.own.id]}) for s in team]
    np.testing.assert_array_equal(planned(Composed(coordination=Centralised(), optimizer=Lazy()), misled), last)


@pytest.mark.parametrize("scheme", [Sequential(), Parallel(), Decentralised(), Centralised(), SequentialPartitions(2)])
def test_without_uavs_there_are_no_plans(scheme):
    assert Composed(coordination=scheme).plan([], np.random.default_rng(0)) == []


@pytest.mark.parametrize("beta", [0.0, 0.5])
def test_the_centralised_plan_on_a_coarse_grid_is_the_exhaustive_optimum(random_team, beta):
    grid = GridSearch(6)
    for seed in range(5):
        team = knowing(random_team(seed, spread=10.0), np.zeros((3, 1, 2)))
        plans = planned(Composed(1, Centralised(), beta=beta, optimizer=grid), team)
        steps = grid.controls(5.0)
        view = nominal(team[0], 1)
        tried = [team_cost(view, np.array(joint)[:, None], beta) for joint in itertools.product(steps, repeat=3)]
        assert team_cost(view, plans, beta) <= min(tried)


def test_the_occlusion_model_is_the_planners_own(random_team):
    differing = 0
    for seed in range(6):
        team = random_team(seed, trees=75, spread=15.0)
        discs = [dataclasses.replace(s, forest=Forest(s.forest.trees, "disc")) for s in team]
        believed, usual = planned(Composed(occlusion="disc"), team), planned(Composed(), team)
        np.testing.assert_array_equal(believed, planned(Composed(), discs))
        np.testing.assert_array_equal(planned(Composed(occlusion="line_of_sight"), discs), usual)
        differing += not np.array_equal(believed, usual)
    assert differing >= 2


def test_intents_are_last_plans_shifted_and_one_base_step_or_hover(random_team):
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
    situation = random_team(0)[0]
    own = dataclasses.replace(situation.own, position=situation.own.position + np.array([1000.0, 0.0, 0.0]))
    np.testing.assert_array_equal(base_control(dataclasses.replace(situation, own=own)), np.zeros(2))
