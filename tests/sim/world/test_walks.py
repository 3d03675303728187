import math

import numpy as np
import pytest

from sim.scenario.environment import Area, People, Trees
from sim.world.forest import grow
from sim.world.pedestrian_steering import SEPARATION
from sim.world.walkers import MARGIN, TRUNK_CLEARANCE, _draw_presence, walk
from sim.world.walks import Itinerary, Paths
from tracking.geometry.visibility import Forest

AREA, RATE = Area(), 60
HALF = np.array([AREA.width, AREA.height]) / 2 - MARGIN
BARE = Forest(())


def walked(people, *, seed=0, forest=BARE, duration=40.0):
    return walk(people, AREA, forest, duration=duration, rng=np.random.default_rng(seed)).positions


def speeds(positions):
    return np.hypot(*np.moveaxis(np.diff(positions, axis=0), -1, 0)) * RATE


def gaps(positions, i, j):
    return np.hypot(*(positions[:, i] - positions[:, j]).T)


def test_waypoint_walkers_turn_at_places_all_over_the_area():
    positions = np.hstack(
        [walked(People(count=10, walks=("waypoints",)), seed=seed, duration=120.0) for seed in (1, 2)]
    )
    headings = np.unwrap(np.arctan2(*np.moveaxis(np.diff(positions[::RATE], axis=0), -1, 0)[::-1]), axis=0)
    assert np.mean(np.ptp(headings, axis=0) > 1) > 0.9 and speeds(positions).min() >= 1.0 - 1e-9
    for axis, side in ((0, AREA.width), (1, AREA.height)):
        assert np.ptp(positions[..., axis]) > 0.8 * side


def test_people_who_stop_and_go_stand_still_for_a_part_of_the_time():
    pace = speeds(walked(People(count=20, walks=("stop-and-go",)), seed=3))
    still = pace < 0.1
    assert 0.2 < still.mean() < 0.5 and np.all(pace[~still].mean() > 1) and pace.max() <= 3.0
    assert np.mean(still.any(axis=0)) > 0.9 and np.abs(np.diff(pace, axis=0)).max() * RATE < 3


def test_groups_stay_together_and_part_later():
    positions = walked(People(count=12, walks=("groups",)), seed=4)
    for first in range(0, 12, 3):
        for i, j in ((first, first + 1), (first, first + 2), (first + 1, first + 2)):
            apart = gaps(positions, i, j)
            assert apart[: 12 * RATE].max() < 6 and apart.min() >= SEPARATION and apart[-1] > apart[0]
    others = [gaps(positions, i, j)[:12].mean() for i in range(0, 12, 3) for j in range(0, i, 3)]
    assert np.mean(others) > 20


def test_people_are_shared_out_among_ways_and_keep_clear_of_trunks():
    people = People(count=13, walks=("groups", "levy", "stop-and-go"), paths=())
    forest = grow(Trees(density=75), AREA, np.random.default_rng(5))
    positions = walked(people, forest=forest, seed=5)
    still = (speeds(positions) < 0.1).any(axis=0)
    assert not still[:9].any() and still[9:].sum() >= 3
    assert np.all(np.abs(positions) <= np.array([AREA.width, AREA.height]) / 2 - MARGIN)
    for tree in forest.trees:
        away = np.hypot(positions[..., 0] - tree.x, positions[..., 1] - tree.y)
        assert away.min() >= tree.trunk_radius + TRUNK_CLEARANCE


def test_people_appear_and_leave_once_and_stay_as_long_as_asked():
    people = People(count=60, walks=("waypoints",), stay=15.0)
    positions = walked(people, seed=6, duration=30.0)
    there = ~np.isnan(positions[..., 0])
    changes = np.diff(there.astype(int), axis=0)
    assert np.all((changes == 1).sum(axis=0) <= 1) and np.all((changes == -1).sum(axis=0) <= 1)
    whole = ~there[0] & ~there[-1] & there.any(axis=0)
    stays = there[:, whole].sum(axis=0) / RATE
    assert whole.sum() >= 10 and stays.min() > 7.4 and stays.max() < 22.6
    assert np.array_equal(there, ~np.isnan(positions[..., 1]))


@pytest.mark.parametrize("stay", [0.5, 1.0, 4.0])
def test_as_many_people_are_there_at_the_start_as_later(stay):
    there = _draw_presence(8000, RATE + 1, stay, np.random.default_rng(7))
    # In a mission of 1 s those who stay for s seconds are there at any time with probability s / (s + 1).
    expected = 1 - math.log((1.5 * stay + 1) / (0.5 * stay + 1)) / stay
    assert there[[0, RATE // 2, RATE]].mean(axis=1) == pytest.approx([expected] * 3, abs=0.02)


class Straight:
    """People on straight ways to the east."""

    def itineraries(self, people, half, paces, rng):
        lines = np.linspace(-20, 20, paces.shape[1])
        return [Itinerary(np.array([[-30, y], [60, y]]), np.ones(len(paces))) for y in lines]


class Backwards(Paths):
    def itineraries(self, people, half, paces, rng):
        return [Itinerary(np.zeros((0, 2)), -pace) for pace in paces.T]


def test_a_way_of_walking_from_outside_says_where_people_go():
    positions = walked(People(count=3, walks=(f"{__name__}:Straight",)), duration=20.0)
    ahead = positions[-1] - positions[0]
    assert np.allclose(ahead[:, 0], 20, atol=0.1) and np.allclose(ahead[:, 1], 0, atol=0.3)


def test_what_a_way_from_outside_does_wrong_is_named():
    said = "a pace is not 61 finite numbers above zero"
    with pytest.raises(ValueError, match=rf"^people\.walks: '{__name__}:Backwards' .*{said}"):
        walked(People(count=3, walks=(f"{__name__}:Backwards",)), duration=1.0)
