"""The policy of intent of a fleet, against that of each of its UAVs alone and against its last plan."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.teams import refitted

from planning.planner import Plan
from planning.prediction.field_of_view import aim_point
from planning.prediction.intent import BASE_RANGE, base_policy_plans, expect_plans, policy_of_intent


@pytest.mark.parametrize("known", [0, 2, 6])
def test_each_uav_of_a_fleet_is_expected_to_fly_as_it_would_alone(random_team, known):
    """UAVs with lags, velocities and speeds of their own; plans of `known` steps, but for the first UAV's."""
    rng, apart = np.random.default_rng(known), 0
    for seed in range(4):
        velocities = rng.uniform(-2.5, 2.5, (4, 2))
        team = refitted(
            random_team(seed, uavs=4, spread=15.0),
            lambda v: dataclasses.replace(v, lag=0.3 * v.id, max_speed=3.0 + v.id, velocity=velocities[v.id]),  # noqa: B023
        )
        intents = {i: Plan(rng.uniform(-2.5, 2.5, (known, 2))) for i in range(1, 4)} if known else {}
        situation = dataclasses.replace(team[0], intents=intents)
        together = expect_plans(situation, 5)
        for i, vehicle in enumerate(situation.vehicles):
            given = intents[i].controls[1:6] if i in intents else np.empty((0, 2))
            np.testing.assert_array_equal(together[i, : len(given)], given)
            np.testing.assert_array_equal(together[i], policy_of_intent(situation, vehicle, 5))
            np.testing.assert_array_equal(together[i], base_policy_plans(situation, vehicle, given[None], 5)[0])
            apart += np.abs(together[i] - together[i - 1]).max() > 0.1
        decided = {2: np.ones((5, 2))}
        mixed = expect_plans(situation, 5, decided)
        np.testing.assert_array_equal(mixed[2], decided[2])
        np.testing.assert_array_equal(np.delete(mixed, 2, axis=0), np.delete(together, 2, axis=0))
    assert apart > 8


def pursue(situation, vehicle, given, horizon):
    """The controls `given` and then the base policy, with the places of a first-order lag in closed form."""
    place, v, step, lag = vehicle.position[:2].copy(), vehicle.velocity, situation.step, vehicle.lag
    v = v * min(1.0, vehicle.max_speed / max(np.linalg.norm(v), 1e-12))
    means, F = [track.belief.mean for track in situation.tracks], situation.motion.F
    traces = [track.belief.covariance[0, 0] + track.belief.covariance[1, 1] for track in situation.tracks]
    plan = []
    for h in range(horizon):
        means = [F @ mean for mean in means]
        control = given[h] if h < len(given) else np.zeros(2)
        if h >= len(given):
            ways = [mean[:2] - place - aim_point(vehicle) for mean in means]
            near = [t for t in range(len(ways)) if np.linalg.norm(ways[t]) <= BASE_RANGE]
            if near:
                way = ways[max(near, key=lambda t: traces[t])]
                control = way / step * min(1.0, vehicle.max_speed * step / np.linalg.norm(way))
        left = math.exp(-step / lag)
        place = place + control * step + (v - control) * lag * (1.0 - left)
        v = control + (v - control) * left
        plan.append(control)
    return plan


@pytest.mark.parametrize("known", [0, 1, 3])
def test_plans_go_on_to_the_most_uncertain_target_in_reach(random_team, known):
    """Targets that walk are led; several beginnings of a UAV's plan are each as one alone."""
    rng = np.random.default_rng(known)
    for seed in range(4):
        situation = random_team(seed, uavs=2, targets=4, spread=15.0)[0]
        vehicle = dataclasses.replace(situation.own, lag=0.7, max_speed=4.0, velocity=rng.uniform(-2.0, 2.0, 2))
        given = rng.uniform(-2.5, 2.5, (3, known, 2))
        found = base_policy_plans(situation, vehicle, given, 6)
        expected = [pursue(situation, vehicle, beginning, 6) for beginning in given]
        np.testing.assert_allclose(found, expected, atol=1e-9)
        assert np.abs(found[:, known:]).max() > 0.1
