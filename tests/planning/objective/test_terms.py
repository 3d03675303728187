"""Terms of the objective: search for undetected people against a plain transcription, and UAVs that keep apart."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.flights import fly
from helpers.porous import make_porous, plain_detectabilities
from helpers.teams import planned, refitted
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from planning.objective.connectivity import Connectivity
from planning.objective.terms import (
    Search,
    Separation,
    _Cells,
    _count_steps_to_go,
    _make_sights,
)
from planning.planner_loading import load_planner
from planning.prediction.field_of_view import view_quadrangle
from planning.prediction.intent import expect_plans
from planning.prediction.quadrangle import shortest_move
from planning.prediction.response import camera_paths
from tracking.geometry.person import TARGET_HEIGHT
from tracking.undetected import Intensity

NONE = Intensity(np.zeros((20, 30)), (-75.0, -50.0), (5.0, 5.0))


def unaware(situation, people=NONE.people):
    return dataclasses.replace(situation, undetected=dataclasses.replace(NONE, people=people))


def found(situation, uav, place):
    """Part of each cell that a UAV sees from a place, by four points, times the probability of a find."""
    vehicle, points = situation.vehicles[uav], np.full((600, 4, 3), TARGET_HEIGHT)
    quarters = [(a, b) for a in (-1.25, 1.25) for b in (-1.25, 1.25)]
    points[..., :2] = situation.undetected.centres().reshape(-1, 1, 2) + quarters
    camera = np.array([*place, vehicle.position[2]])
    view = view_quadrangle(vehicle)
    shown = np.all((points[..., :2] - place) @ view[:4, :2].T <= view[:4, 2], axis=-1)
    shows = np.zeros(shown.shape)
    shows[shown] = plain_detectabilities(situation.forest, camera, points[shown], view[4, 2], 0.0)
    return 0.99 * shows.mean(axis=1)


def transcribed(situation, controls, uavs, candidate):
    """People not found, summed over steps, and beyond them the mean over UAVs of the steps to each of them."""
    plans = controls.copy()
    plans[list(uavs)] = candidate
    belief = situation.undetected
    start = np.array([v.position[:2] for v in situation.vehicles])
    left, total = belief.people.ravel().copy(), 0.0
    others = left.copy()
    for step in range(1, controls.shape[1] + 1):
        for i in range(len(plans)):
            place = start[i] + plans[i, :step].sum(axis=0)
            if i in uavs:  # what is in view is taken from places 5 m apart
                place = start[i] + 5.0 * np.round((place - start[i]) / 5.0)
            missed = 1.0 - found(situation, i, place)
            left *= missed
            others *= 1.0 if i in uavs else missed
        total += left.sum()
    halves = np.array([(v.position[2] - TARGET_HEIGHT) * math.tan(v.camera.fov / 2) for v in situation.vehicles])
    steps = []
    for i, plan in zip(uavs, candidate, strict=True):
        ends = start + controls.sum(axis=1)
        ends[i] = start[i] + 5.0 * np.round(plan.sum(axis=0) / 5.0)
        gaps = np.linalg.norm(belief.centres().reshape(-1, 1, 2) - ends, axis=-1) - halves
        steps.append(np.maximum(gaps.min(axis=1), 0.0) / 5.0)
    return total + others @ np.mean(steps, axis=0)


@pytest.mark.parametrize("uavs", [[0], [1], [0, 2]])
def test_the_term_is_people_not_found_and_the_steps_to_them(random_team, uavs):
    rng = np.random.default_rng(uavs[-1])
    for seed in range(2):
        people = np.where(rng.random((20, 30)) < 0.15, rng.random((20, 30)), 0.0)
        situation = unaware(random_team(seed, trees=75)[0], people)
        if seed:
            situation = dataclasses.replace(situation, forest=make_porous(situation.forest, rng))
        controls = expect_plans(situation, 3)
        candidates = rng.uniform(-3.5, 3.5, (3, len(uavs), 3, 2))
        costs = Search(7.0).objective(situation, controls, uavs)(candidates)
        by_hand = [7.0 * transcribed(situation, controls, uavs, c) for c in candidates]
        np.testing.assert_allclose(costs, by_hand, rtol=1e-9)


@pytest.mark.parametrize("uavs", [[1], [0, 2]])
def test_a_plan_costs_the_same_alone_and_after_many_others(random_team, uavs):
    rng = np.random.default_rng(0)
    situation = unaware(random_team(0, trees=75)[0], rng.random((20, 30)))
    controls, candidates = expect_plans(situation, 5), rng.uniform(-3.5, 3.5, (20_000, len(uavs), 5, 2))
    costs, some = Search(7.0).objective(situation, controls, uavs), candidates[::200]
    alone = [Search(7.0).objective(situation, controls, uavs)(plan[None])[0] for plan in some]
    np.testing.assert_array_equal(costs(candidates)[::200], alone)
    np.testing.assert_array_equal(costs(some), alone)


@pytest.mark.parametrize("tilt", [0, 20, 30, 45])
def test_steps_to_an_undetected_target_are_none_only_where_it_is_in_view(random_team, tilt):
    """They are at least as many as bring its cell into the image, at most as many as bring it into the middle."""
    attitude = Rotation.from_euler("ZY", [35, -tilt], degrees=True).as_quat()
    own = dataclasses.replace(random_team(0)[0].own, attitude=attitude)
    centres, view = NONE.centres().reshape(-1, 2), view_quadrangle(own)
    ahead = [_Cells(centre[None], np.zeros((4, 2)), np.ones((1, 1))) for centre in centres]
    alone = own.position[None].astype(float)
    steps = np.array([_count_steps_to_go(alone, 0, alone, one, _make_sights(view[None], [5.0]))[0] for one in ahead])
    least = [np.hypot(*shortest_move(view[None], 0, *cell)) / 5.0 for cell in centres - own.position[:2]]
    most = np.linalg.norm(centres - own.position[:2] - view[4, :2], axis=1) / 5.0
    assert np.all(steps >= np.array(least) - 1e-9) and np.all(steps <= most)
    assert np.mean(steps - least) < 2.5 and np.sum(steps == 0) > 5


@pytest.mark.parametrize("coordination", ["sequential", "parallel", "decentralised", "centralised"])
def test_the_nearest_uav_flies_to_where_an_undetected_target_must_be(random_team, coordination):
    people = np.zeros((20, 30))
    people[10, 28] = 1.0
    team = [unaware(s, people) for s in random_team(2, targets=0, trees=0)]
    ways = NONE.centres()[10, 28] - [s.own.position[:2] for s in team]
    flown = planned(f"sma-nbo-mwtp(search=100, coordination={coordination})", team).sum(axis=1)
    gaps, left = (np.linalg.norm(way, axis=1) for way in (ways, ways - flown))
    assert (gaps - left)[np.argmin(gaps)] > 20.0  # of the 25 m that it can fly


def test_two_do_not_look_in_the_same_place(random_team):
    """The second of a sequence goes for what the first leaves."""
    people = np.zeros((20, 30))
    people[9:11, [2, 27]] = 1.0
    team = [unaware(s, people) for s in random_team(0, uavs=2, targets=0, trees=0, spread=3.0)]
    east = planned("sma-nbo(search=100)", team)[..., 0].sum(axis=1)
    assert sorted(np.sign(east)) == [-1.0, 1.0] and min(np.abs(east)) > 15.0


def undetected_people(*overrides, **options):
    """People that each UAV expects where no camera has looked, at the end of a mission, and its faults."""
    mission, _ = fly("sensing.mode=ideal", *overrides, **options)
    assert mission.faults == []
    return np.array([undetected.belief.people for undetected in mission._knowledge._undetected])


UNKNOWN = ("tracking.initial_tracks=none", "trees.density=0")


def test_each_uav_infers_what_is_undetected_from_the_cameras_it_hears_of():
    together, apart, alone, more = (
        undetected_people(*UNKNOWN, *overrides, duration=0.2)
        for overrides in ((), ("network.range=1",), ("people.count=1",), ("tracking.undetected=9",))
    )
    np.testing.assert_array_equal(together[1:], together[[0, 0]])
    np.testing.assert_allclose(together[0], np.prod(apart, axis=0) / (4.0 / 600) ** 2, rtol=1e-12)
    np.testing.assert_array_equal(alone, together)
    assert more[0].sum() == pytest.approx(2.25 * together[0].sum())


def test_with_all_targets_known_none_is_undetected():
    assert not undetected_people(planner="sma-nbo-mwtp", duration=3).any()


def test_options_choose_the_terms():
    text = "sma-nbo(separation=3, search=25, connectivity=9)"
    assert load_planner(text).terms == (Search(25), Separation(3), Connectivity(9))
    assert load_planner("sma-nbo").terms == ()


def level(team, places):
    """The team at one height, at these places (n, 2) m."""
    return refitted(team, lambda v: dataclasses.replace(v, position=np.array([*places[v.id], 19.0])))


def nearest(team, plans):
    """Least distance [m] at any time between UAVs that fly straight from step to step."""
    now = np.array([s.own.position for s in team])
    way = np.concatenate([now[:, None], camera_paths(now, plans, 1.0)], axis=1)
    times = np.linspace(0, way.shape[1] - 1, 2001)
    flown = np.array([[np.interp(times, np.arange(way.shape[1]), w[:, axis]) for axis in range(3)] for w in way])
    pairs = [np.linalg.norm(flown[i] - flown[j], axis=0).min() for i in range(len(flown)) for j in range(i)]
    return min(pairs)


@pytest.mark.parametrize("coordination", ["sequential", "centralised"])
def test_planned_paths_stay_the_separation_apart(random_team, coordination):
    crowded = 0
    for seed in range(8):
        team = level(random_team(seed, targets=2, spread=6.0), [(-15.0, 0.0), (0.0, 12.0), (15.0, 0.0)])
        free = planned(f"sma-nbo-mwtp(coordination={coordination})", team, seed)
        kept = planned(f"sma-nbo-mwtp(coordination={coordination}, separation=5)", team, seed)
        assert nearest(team, kept) >= 5.0 - 1e-3
        crowded += nearest(team, free) < 5.0
    assert crowded >= 2


def test_height_counts_as_distance(random_team):
    """UAVs 2 m above one another keep 1.9 m whatever they do."""
    team = refitted(random_team(0), lambda v: dataclasses.replace(v, position=np.array([0.0, 0.0, 15.0 + 2.0 * v.id])))
    np.testing.assert_array_equal(planned("sma-nbo-mwtp(separation=1.9)", team), planned("sma-nbo-mwtp", team))


@pytest.mark.parametrize("deciding", [[1], [0, 3], [0, 1, 2, 3, 4]])
def test_connectivity_counts_the_uavs_outside_the_connected_component(random_team, deciding):
    team = random_team(3, uavs=5)
    team = refitted(team, lambda v: dataclasses.replace(v, position=np.append(v.position[:2], 17.0 + v.id)))
    situation = dataclasses.replace(team[0], radio_range=15.0)
    rng = np.random.default_rng(0)
    velocities, candidates = rng.normal(size=(5, 4, 2)) * 6, rng.normal(size=(40, len(deciding), 4, 2)) * 6
    expected = np.zeros(40)
    for c, candidate in enumerate(candidates):
        plans = velocities.copy()
        plans[deciding] = candidate
        paths = camera_paths(np.array([v.position for v in situation.vehicles]), plans, situation.step)
        for places in np.moveaxis(paths, 1, 0):
            gaps = np.linalg.norm(places[:, None] - places, axis=-1)
            _, labels = connected_components(gaps <= 15.0)
            expected[c] += np.mean([np.count_nonzero(labels != labels[i]) for i in deciding])
    assert len(set(expected)) > 3
    found = Connectivity(7.0).objective(situation, velocities, deciding)(candidates)
    np.testing.assert_allclose(found, 7.0 * expected)


@pytest.mark.parametrize("above", [14.0, 16.0])
@pytest.mark.parametrize("spread", [0.3, 5.0])  # m/s, of plans: all of them near the other UAV, or some
@pytest.mark.parametrize("deciding", [[0], [0, 1]])
def test_radios_reach_as_far_upwards_as_sideways(random_team, deciding, spread, above):
    """A UAV above another one; radios reach 15 m."""
    team = refitted(
        random_team(0, uavs=2), lambda v: dataclasses.replace(v, position=np.array([2.0, 3.0, 17.0 + above * v.id]))
    )
    situation = dataclasses.replace(team[0], radio_range=15.0)
    candidates = np.random.default_rng(0).uniform(-spread, spread, (60, len(deciding), 3, 2))
    found = Connectivity(7.0).objective(situation, np.zeros((2, 3, 2)), deciding)(candidates)
    apart = np.cumsum(candidates[:, 0] - (candidates[:, 1] if len(deciding) == 2 else 0.0), axis=1)
    unlinked = np.sum(np.sum(apart**2, axis=2) + above**2 > 15.0**2, axis=1)
    np.testing.assert_array_equal(found, 7.0 * unlinked)
    assert len(set(unlinked)) > 1 or spread < 1.0 or above > 15.0


def test_a_pair_out_of_range_flies_together_if_that_is_worth_more(random_team):
    """Two UAVs 40 m apart whose radios reach 30 m, and no people."""
    team = [
        dataclasses.replace(s, radio_range=30.0, tracks=())
        for s in level(random_team(1, uavs=2), [(-20.0, 0.0), (20.0, 0.0)])
    ]
    kept = camera_paths(np.array([s.own.position for s in team]), planned("sma-nbo(connectivity=30)", team), 1.0)
    assert np.linalg.norm(kept[0, -1] - kept[1, -1]) <= 30.0
    far = [dataclasses.replace(s, radio_range=1000.0) for s in team]
    np.testing.assert_array_equal(planned("sma-nbo(connectivity=30)", far), planned("sma-nbo", far))


def test_where_uavs_are_too_near_the_plan_that_parts_them_soonest_costs_least(random_team):
    team = level(random_team(1, uavs=2), [(0.0, 0.0), (1.0, 0.0)])
    still, away, toward = np.zeros((1, 2, 2)), np.full((1, 2, 2), [-5.0, 0.0]), np.full((1, 2, 2), [0.5, 0.0])
    cost = Separation(4.0).objective(team[0], np.zeros((2, 2, 2)), [0])(np.array([still, away, toward]))
    # The first step starts 1 m off in any case; the second 1 m, 6 m and 0.5 m off.
    np.testing.assert_allclose(cost, [6e6, 3e6, 3.5e6 + 4e6], rtol=1e-9)
