import math
from functools import cache

import numpy as np
import pytest
from scipy import stats

from sim.scenario.environment import Area, People, Trees
from sim.world import walkers
from sim.world.forest import grow
from sim.world.pedestrian_steering import SEPARATION
from sim.world.walkers import MARGIN, TRUNK_CLEARANCE, draw_paces, walk
from tracking.geometry.visibility import Forest

AREA = Area()
BARE = Forest(())
RATE = 60


def walked(seed, *, people=None, trees=None, area=AREA, duration=40.0):
    """Positions (K, M, 2) and the forest of one seed."""
    return _walked(seed, people or People(), trees or Trees(), area, duration)


@cache
def _walked(seed, people, trees, area, duration):
    rng = np.random.default_rng(seed)
    forest = grow(trees, area, rng)
    return walk(people, area, forest, duration=duration, rng=rng).positions, forest


def velocities(positions):
    return np.diff(positions, axis=0) * RATE


def levy(exponent, slowest=1.0, fastest=3.0):
    """Distribution function of the truncated power law."""
    power = 1 - exponent
    return lambda v: (np.asarray(v) ** power - slowest**power) / (fastest**power - slowest**power)


def separation(positions):
    pairs = zip(*np.triu_indices(positions.shape[1], 1), strict=True)
    return min(np.hypot(*(positions[:, i] - positions[:, j]).T).min() for i, j in pairs)


def assert_allowed(positions, forest, area=AREA):
    assert np.all(np.abs(positions) <= np.array([area.width, area.height]) / 2 - MARGIN)
    speed = np.hypot(*np.moveaxis(velocities(positions), -1, 0))
    assert speed.min() >= 1.0 - 1e-9 and speed.max() <= 3.0 + 1e-9
    for tree in forest.trees:
        away = np.hypot(positions[..., 0] - tree.x, positions[..., 1] - tree.y).min()
        assert away >= tree.trunk_radius + TRUNK_CLEARANCE
    assert separation(positions) >= SEPARATION


def test_paces_of_independent_walkers_are_truncated_levy_at_any_instant():
    speeds = draw_paces(People(count=4000), 10, np.random.default_rng(1))
    for instant in (0, 9):
        assert stats.kstest(speeds[instant], levy(2.0)).pvalue > 0.01


@pytest.mark.parametrize("seeds", [20, pytest.param(40, marks=pytest.mark.slow)])
def test_step_lengths_of_walks_are_truncated_levy(seeds):
    people = People(count=20, paths=())
    walks = [walked(seed, people=people, trees=Trees(density=15), duration=2.0)[0] for seed in range(seeds)]
    lengths = np.concatenate([np.hypot(*(p[72] - p[60]).T) for p in walks])
    assert stats.kstest(lengths / 0.2, levy(2.0)).pvalue > 0.01


@pytest.mark.parametrize("density", [45, 75])
@pytest.mark.parametrize("seeds", [range(5), pytest.param(range(5, 120), marks=pytest.mark.slow)])
def test_walkers_stay_in_the_area_and_touch_neither_trunks_nor_each_other(density, seeds):
    for seed in seeds:
        assert_allowed(*walked(seed, trees=Trees(density=density)))


def test_a_narrow_forest_is_walked_through_and_a_crowd_keeps_apart():
    for seed in range(3):
        assert_allowed(*walked(seed, trees=Trees(density=600, canopy_radius=1.0)))
    positions, forest = walked(3, people=People(count=30, paths=()), area=Area(80.0, 60.0), duration=20.0)
    assert_allowed(positions, forest, Area(80.0, 60.0))


def test_accelerations_are_those_of_walking_people():
    accelerations = []
    for seed in range(20):
        steps = np.diff(velocities(walked(seed)[0]), axis=0) * RATE
        accelerations.append(np.hypot(steps[..., 0], steps[..., 1]).ravel())
    accelerations = np.concatenate(accelerations)
    assert 0.15 < np.sqrt(np.mean(accelerations**2)) < 0.3 and np.mean(accelerations > 1) < 0.005
    assert accelerations.max() < 5


def cross(p, q):
    """True if two paths (K, 2) cross, seen at each second."""
    a, b = p[::RATE], q[::RATE]
    da, db = np.diff(a, axis=0), np.diff(b, axis=0)

    def side(points, start, step):
        return np.sign(
            step[:, None, 0] * (points[None, :, 1] - start[:, None, 1])
            - step[:, None, 1] * (points[None, :, 0] - start[:, None, 0])
        )

    of_b, of_a = side(b, a[:-1], da), side(a, b[:-1], db)
    return bool(np.any((of_b[:, :-1] * of_b[:, 1:] < 0) & (of_a[:, :-1] * of_a[:, 1:] < 0).T))


@pytest.mark.parametrize("seeds", [20, pytest.param(30, marks=pytest.mark.slow)])
def test_the_default_four_cross_bend_and_part(seeds):
    crossed, converged = [], []
    for seed in range(seeds):
        positions, _ = walked(seed)
        pairs = [(i, j) for i in range(4) for j in range(i)]
        crossed.append(sum(cross(positions[:, i], positions[:, j]) for i, j in pairs) >= 2)
        way = np.hypot(*np.moveaxis(np.diff(positions, axis=0), -1, 0)).sum(axis=0)
        assert np.all(np.hypot(*(positions[-1] - positions[0]).T) > 0.8 * way)
        spread = np.ptp(positions[..., 1], axis=1)
        converged.append(spread.min() < 0.8 * min(spread[0], spread[-1]))
    # Now and then a person is late, so that two meet after the others have parted.
    assert np.mean(crossed) >= 0.9 and np.mean(converged) >= 0.9


def test_people_set_out_for_their_second_waypoint():
    positions, _ = walked(0, trees=Trees(density=0), people=People(count=1, paths=(((-40, 0), (-20, 30), (60, -40)),)))
    east, north = positions[30, 0] - positions[0, 0]
    assert math.degrees(math.atan2(north, east)) == pytest.approx(56, abs=12)


def test_people_without_a_path_wander_and_same_seeds_walk_alike():
    positions, forest = walked(5, people=People(count=6, paths=()))
    assert_allowed(positions, forest)
    headings = np.unwrap(np.arctan2(*np.moveaxis(velocities(positions), -1, 0)[::-1]), axis=0)
    assert np.all(np.ptp(headings, axis=0) > 0.2)
    _walked.cache_clear()
    first = walked(6)[0]
    _walked.cache_clear()
    assert np.array_equal(first, walked(6)[0]) and not np.array_equal(walked(6)[0], walked(7)[0])


def test_walks_cover_any_duration_and_begin_as_shorter_ones():
    for duration in (0.01, 3.3, 40.0):
        walks = walk(People(), AREA, BARE, duration=duration, rng=np.random.default_rng(0))
        assert walks.times[0] == 0 and duration <= walks.times[-1] < duration + 2 / RATE
        assert not np.any(np.isnan(walks.at(duration)[0]))
    forest = grow(Trees(), Area(), np.random.default_rng(1))
    short, long = (walk(People(), Area(), forest, duration=d, rng=np.random.default_rng(3)) for d in (5.0, 12.0))
    np.testing.assert_array_equal(short.positions, long.positions[: len(short.positions)])
    assert walked(0, people=People(count=0))[0].shape == (2401, 0, 2)


@pytest.mark.parametrize(
    "people, area, complaint",
    [
        (People(), Area(50.0, 50.0), r"people\.paths\[0\]: \(-30, -18\) is not inside the area"),
        (People(paths=(((0.0, 0.0),),)), AREA, r"people\.paths\[0\]: expected two or more waypoints, got 1"),
        (People(count=500, paths=()), Area(10.0, 10.0), r"people\.count = 500: no free place"),
        (People(paths=()), Area(4.0, 20.0), "area: 4 x 20 m; people need 10 m"),
    ],
)
def test_people_and_areas_that_allow_no_walk_are_named(people, area, complaint):
    with pytest.raises(ValueError, match=complaint):
        walk(people, area, BARE, duration=1.0, rng=np.random.default_rng(0))


def test_smooth_noise_is_the_moving_average_of_white_noise_to_the_bit():
    rng = np.random.default_rng(2)
    white, kernel = rng.normal(size=(700, 3)), rng.uniform(size=41)
    expected = np.zeros((660, 3))
    for n, weight in enumerate(kernel):
        expected += weight * white[n : n + 660]
    np.testing.assert_array_equal(walkers._smooth(white, kernel), expected)
