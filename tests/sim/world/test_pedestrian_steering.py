import numpy as np
import pytest
from numpy.testing import assert_allclose

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
