"""Planners on a grid of controls against brute force: of first actions, which the base policy follows, and of MCR."""

import dataclasses
import itertools

import numpy as np
import pytest
from helpers.nominal import team_cost
from helpers.teams import knowing, planned

from planning.composed import Composed
from planning.optimizers.grid_search import GridSearch
from planning.prediction.intent import base_control, base_policy_plans, expect_plans
from planning.prediction.propagation import MonteCarlo
from planning.prediction.response import vehicle_after
from tracking.filter.kalman import Gaussian


def moved(track, seconds):
    """The track where its person is at a constant velocity so much later, as sure of it as now."""
    belief = Gaussian(track.belief.mean + seconds * np.r_[track.belief.mean[2:], 0, 0], track.belief.covariance)
    return dataclasses.replace(track, belief=belief)


def rolled_out(situation, uav, firsts, horizon):
    """First controls (h, 2) and what the base policy makes of the steps after them, one by one."""
    vehicle, controls = situation.vehicles[uav], list(np.asarray(firsts))
    for first in controls:
        vehicle = vehicle_after(vehicle, first, 1.0)
    for k in range(len(controls), horizon):
        tracks = tuple(moved(track, float(k)) for track in situation.tracks)
        controls.append(base_control(dataclasses.replace(situation, own=vehicle, tracks=tracks)))
        vehicle = vehicle_after(vehicle, controls[-1], 1.0)
    return np.array(controls)


@pytest.mark.parametrize("given", [1, 3])
def test_the_base_policy_aims_from_where_a_lag_has_brought_the_uav(random_team, given):
    velocity, rng, apart = np.array([3.0, -2.0]), np.random.default_rng(0), 0
    for seed in range(6):
        (situation, *_) = random_team(seed, spread=15.0)
        lagging = dataclasses.replace(situation.own, velocity=velocity, lag=0.65)
        situation = dataclasses.replace(situation, own=lagging)
        firsts = rng.uniform(-3.0, 3.0, (2, given, 2))
        plans = base_policy_plans(situation, lagging, firsts, 5)
        expected = [rolled_out(situation, 0, controls, 5) for controls in firsts]
        np.testing.assert_allclose(plans, expected, atol=1e-9)
        at_once = base_policy_plans(situation, dataclasses.replace(lagging, lag=0.0), firsts, 5)
        apart += np.abs(plans - at_once).max() > 0.1
    assert apart > 3


@pytest.mark.parametrize("horizon", [1, 2, 5])
def test_the_first_action_on_a_grid_is_the_best_by_brute_force(random_team, horizon):
    """Each UAV in turn: no control of the grid, with the base policy after it, is better on the same trajectories."""
    grid = GridSearch(16)
    for seed in range(6):
        team = knowing(random_team(seed, spread=15.0), np.zeros((3, horizon, 2)))
        pieces = Composed(horizon, propagation=MonteCarlo(6), beta=0.0, optimizer=grid, actions="first")
        plans = planned(pieces, team, seed)
        rng, joint = np.random.default_rng(seed), expect_plans(team[0], horizon)
        for uav, situation in enumerate(team):
            view = MonteCarlo(6).predict(situation, horizon, rng)
            np.testing.assert_allclose(plans[uav], rolled_out(situation, uav, plans[uav, :1], horizon), atol=1e-9)
            costs = {}
            for first in [*map(tuple, grid.controls(5.0)), tuple(plans[uav, 0])]:
                tried = joint.copy()
                tried[uav] = rolled_out(situation, uav, [first], horizon)
                costs[first] = team_cost(view, tried, 0.0, 6)
            assert costs[tuple(plans[uav, 0])] <= min(costs.values()) * (1 + 1e-12)
            joint[uav] = plans[uav]


def test_mcr_with_the_penalty_finds_the_best_of_all_sequences(random_team):
    """Each UAV in turn, by the mean over its own sampled trajectories, each with its cost-to-go."""
    sequences = np.array(list(itertools.product(GridSearch().controls(5.0), repeat=2)))
    changed = 0
    for seed in range(6):
        team = knowing(random_team(seed, uavs=2, spread=25.0), np.zeros((2, 2, 2)))
        plans = planned("mcr(beta=0.5, samples=6, horizon=2, optimizer=grid)", team, seed)
        rng, joint = np.random.default_rng(seed), expect_plans(team[0], 2)
        for uav, situation in enumerate(team):
            view = MonteCarlo(6).predict(situation, 2, rng)
            tried = np.repeat(joint[None], len(sequences), axis=0)
            tried[:, uav] = sequences
            costs, truncated = ([team_cost(view, each, beta, 6) for each in tried] for beta in (0.5, 0.0))
            joint[uav] = plans[uav]
            assert team_cost(view, joint, 0.5, 6) <= min(costs) * (1 + 1e-12)
            changed += costs[np.argmin(truncated)] > min(costs) * 1.001
    assert changed > 3


def test_with_one_step_the_first_action_is_the_whole_plan(random_team):
    for name in ("mcr(samples=4, evaluations=512, horizon=1", "sma-nbo-mwtp(evaluations=512, horizon=1"):
        whole, first = planned(f"{name})", random_team(2)), planned(f"{name}, actions=first)", random_team(2))
        np.testing.assert_array_equal(first, whole)
