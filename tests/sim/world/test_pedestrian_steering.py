import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.world import pedestrian_steering
from sim.world.pedestrian_steering import (
    SEPARATION,
    simulate,
)

HALF = np.array([74.0, 49.0])
NO_TRUNKS = np.zeros((0, 3))
SECONDS = 20


def steered(starts, speeds, goals, trunks=NO_TRUNKS, half=HALF):
    """Positions (K, M, 2) of people on straight routes from starts to goals."""
    starts, goals = np.array(starts, dtype=float), np.array(goals, dtype=float)
    ahead = goals - starts
    states = np.column_stack([starts, np.arctan2(ahead[:, 1], ahead[:, 0]), np.zeros(len(starts))])
    routes = starts[:, None] + np.linspace(0, 1, 100)[:, None] * ahead[:, None]
    paces = np.tile(np.array(speeds, dtype=float), (SECONDS * 60, 1))
    return simulate(states, paces, np.zeros_like(paces), routes, np.array(trunks, dtype=float), half)


def lateral_acceleration(walk):
    steps = np.diff(walk, axis=0) * 60
    headings = np.unwrap(np.arctan2(steps[..., 1], steps[..., 0]), axis=0)
    return np.abs(np.diff(headings, axis=0)) * 60 * np.hypot(steps[1:, :, 0], steps[1:, :, 1])


def test_ways_are_straight_where_free_and_out_of_pockets_of_trunks():
    walk = steered([(-30, -20)], [1.5], [(30, 25)])[:, 0]
    direction = np.array([60, 45]) / 75
    t = np.arange(len(walk)) / 60
    assert_allclose(walk, [-30, -20] + 1.5 * t[:, None] * direction, atol=1e-9)
    walk = steered([(-10, 0.0)], [2.0], [(60, 0)], [(0.0, 0.55, 0.6), (0.0, -0.55, 0.6), (-0.8, 0.0, 0.6)])
    for x, y in [(0.0, 0.55), (0.0, -0.55), (-0.8, 0.0)]:
        assert np.hypot(walk[:, 0, 0] - x, walk[:, 0, 1] - y).min() >= 0.6
    assert walk[-1, 0, 0] > 20


@pytest.mark.parametrize("speed", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("offset", [0.0, 0.3, -0.5])
def test_a_trunk_in_the_way_is_passed_near_and_smoothly(speed, offset):
    walk = steered([(-10, 0)], [speed], [(60, 0)], [(0.0, offset, 0.6)])
    away = np.hypot(walk[:, 0, 0], walk[:, 0, 1] - offset)
    assert 0.6 <= away.min() < 1.3 and lateral_acceleration(walk).max() < 1.05 and abs(walk[-1, 0, 1]) < 0.25


@pytest.mark.parametrize("speeds", [(1, 1), (3, 3), (1, 3)])
@pytest.mark.parametrize("shift", [0.0, 0.2, -0.4])
def test_people_on_a_collision_course_pass_each_other(speeds, shift):
    walk = steered([(-12, 0), (12, shift)], speeds, [(60, 0), (-60, shift)])
    away = np.hypot(*(walk[:, 0] - walk[:, 1]).T)
    assert SEPARATION <= away.min() < 1.5 and lateral_acceleration(walk).max() < 1.05


def test_fast_walkers_overtake_and_routes_out_of_the_area_end_smoothly():
    walk = steered([(-10, 0), (-4, 0)], [2.5, 1.0], [(70, 0), (70, 0)])
    assert np.hypot(*(walk[:, 0] - walk[:, 1]).T).min() >= SEPARATION and walk[-1, 0, 0] > walk[-1, 1, 0] + 15
    walk = steered([(40, 30), (0, 40)], [3.0, 1.5], [(140, 130), (0, 140)])
    assert np.all(np.abs(walk) <= HALF) and lateral_acceleration(walk).max() < 1.05


def test_the_heading_that_people_choose_is_that_of_rating_all_headings():
    """Most headings are never rated, because what they cost without any conflict is more than the best one costs."""
    rng = np.random.default_rng(5)
    turned = set()
    for _ in range(300):
        state = np.array([*rng.uniform(-HALF, HALF), *rng.uniform(-4.0, 4.0, 2)])
        hazards = np.column_stack(
            [state[:2] + rng.normal(0.0, 3.0, (6, 2)), rng.normal(0.0, 1.0, (6, 2)), np.full(6, 0.6)]
        )
        goal, decision, pace = state[2] + rng.normal(0.0, 1.0), state[2] + rng.normal(0.0, 1.0), rng.uniform(0.5, 3.0)
        given = goal, decision, pace, hazards[: rng.integers(7)], HALF
        found, costs = pedestrian_steering._decide(state, *given), rate_all(state, *given)
        best, offset = int(np.argmin(costs)), 0.0
        if 0 < best < 24:
            before, after = costs[best - 1] - costs[best], costs[best + 1] - costs[best]
            offset = 0.5 * (before - after) / max(before + after, 1e-12)
        assert found == state[2] + (best - 12 + offset) * math.radians(9.0)
        turned.add(best)
    assert len(turned) > 15


def rate_all(state, goal, decision, pace, hazards, half):
    """Costs (25,) of all headings that a person may turn to."""
    costs = []
    for n in range(25):
        heading = state[2] + (n - 12) * math.radians(9.0)
        to_goal, to_decision = ((heading - to + math.pi) % (2 * math.pi) - math.pi for to in (goal, decision))
        costs.append(to_goal * to_goal + 0.5 * to_decision * to_decision)
        costs[-1] += pedestrian_steering._rate_conflict(state, heading, pace, hazards, half)
    return costs
