"""The policy of intent of a fleet, against that of each of its UAVs alone and against its last plan."""

import dataclasses

import numpy as np
import pytest
from helpers.teams import refitted

from planning.planner import Plan
from planning.prediction.intent import base_policy_plans, expect_plans, policy_of_intent


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
