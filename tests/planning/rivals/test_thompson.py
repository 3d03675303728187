"""Worlds drawn by Thompson sampling against the beliefs they are drawn from, and goals against plain enumeration."""

import dataclasses
import math

import numpy as np
from helpers.porous import make_porous, plain_detectabilities
from helpers.teams import refitted
from scipy.stats import chisquare, norm, skellam

from planning.planner import Plan
from planning.prediction.field_of_view import IMAGE_POINTS, points_shown, view_quadrangle
from planning.rivals.thompson import DrawnWorld, Thompson, draw_world
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.undetected import Intensity


def sprinkled(people):
    rows, columns = people.shape
    return Intensity(people, (-2.5 * columns, -2.5 * rows), (5.0, 5.0))


def test_drawn_people_are_as_many_and_where_the_intensity_has_them(random_team):
    rng = np.random.default_rng(4)
    people = rng.random((4, 6)) * (rng.random((4, 6)) < 0.7) * 0.4
    situation = dataclasses.replace(random_team(0, targets=0)[0], undetected=sprinkled(people))
    worlds = [draw_world(situation, rng) for _ in range(4000)]
    counts = np.bincount([len(w.states) for w in worlds], minlength=20)
    each = np.exp(-people.sum()) * people.sum() ** np.arange(20) / [math.factorial(n) for n in range(20)]
    assert (
        chisquare(np.append(counts[:8], counts[8:].sum()), 4000 * np.append(each[:8], 1 - each[:8].sum())).pvalue > 0.01
    )
    places = np.concatenate([w.states for w in worlds])
    columns, rows = np.floor((places[:, :2] - situation.undetected.low) / 5.0).astype(int).T
    found = np.bincount(6 * rows + columns, minlength=24)
    expected = people.ravel() / people.sum() * len(places)
    assert found[expected == 0].sum() == 0
    assert chisquare(found[expected > 0], expected[expected > 0]).pvalue > 0.01
    within = (places[:, :2] - situation.undetected.low) / 5.0 % 1.0
    for axis in within.T:
        assert chisquare(np.histogram(axis, 10, (0, 1))[0]).pvalue > 0.01
    assert np.all(np.isinf(np.concatenate([w.errors for w in worlds]))) and not places[:, 2:].any()


def test_drawn_tracks_have_the_beliefs_moments_and_their_probability_of_existence(random_team):
    situation = random_team(1, targets=2)[0]
    tracks = tuple(dataclasses.replace(t, existence=e) for t, e in zip(situation.tracks, (1.0, 0.3), strict=True))
    situation, rng = dataclasses.replace(situation, tracks=tracks), np.random.default_rng(0)
    worlds = [draw_world(situation, rng) for _ in range(4000)]
    assert abs(np.mean([len(w.states) for w in worlds]) - 1.3) < 4 * math.sqrt(0.21 / 4000)
    first = np.array([w.states[0] for w in worlds])
    root = np.linalg.inv(np.linalg.cholesky(tracks[0].belief.covariance))
    white = (first - tracks[0].belief.mean) @ root.T
    assert np.abs(white.mean(axis=0)).max() < 0.08 and np.abs(np.cov(white.T) - np.eye(4)).max() < 0.12
    np.testing.assert_allclose([w.errors[0] for w in worlds], first - tracks[0].belief.mean, atol=1e-12)


def meeting_place(situation, state, spot):
    """The place from which a UAV, flying as few steps as suffice, has a person at a spot of its image."""
    after = state[:2] + np.arange(1, 101)[:, None] * situation.step * state[2:] - spot
    gaps = np.linalg.norm(after - situation.own.position[:2], axis=1)
    (suffice,) = np.nonzero(gaps <= np.arange(1, 101) * situation.own.max_speed * situation.step)
    return after[min([*suffice, 99])]


def plain_goal(planner, situation, world):
    """The best place and its gain per step, by plain enumeration."""
    own, start = situation.own, situation.own.position[:2]
    spots, rates = points_shown(own, IMAGE_POINTS), []
    places = [start, *(meeting_place(situation, state, spot) for state in world.states for spot in spots)]
    for place in places:
        steps, total = max(1, math.ceil(np.hypot(*(place - start)) / own.max_speed)), 0.0
        for state, error in zip(world.states, world.errors, strict=True):
            point = np.array([*state[:2] + steps * state[2:], TARGET_HEIGHT])
            camera = np.array([*place, own.position[2]])
            if own.camera.sees(Pose(camera, own.attitude), point)[0]:
                share = plain_detectabilities(situation.forest, camera, point, view_quadrangle(own)[4, 2], 0.0)[0]
                total += share * min(np.hypot(*(error[:2] + steps * error[2:])), planner.cutoff)
        rates.append(total / steps)
    return places[int(np.argmax(rates))], max(rates)


def test_the_goal_is_the_place_of_most_error_per_step_by_plain_enumeration(random_team):
    planner, away = Thompson(), 0
    for seed in range(15):
        situation = dataclasses.replace(
            random_team(seed, trees=120, spread=30.0)[0], undetected=sprinkled(np.full((20, 30), 0.005))
        )
        if seed % 2:
            forest = make_porous(situation.forest, np.random.default_rng(seed))
            situation = dataclasses.replace(situation, forest=forest)
        world = draw_world(situation, np.random.default_rng(seed))
        place, rate = plain_goal(planner, situation, world)
        np.testing.assert_allclose(planner.goal(situation, world), place, rtol=1e-12)
        away += rate > 0 and np.hypot(*(place - situation.own.position[:2])) > 5.0
    assert away >= 8


def test_goals_fall_as_often_to_a_place_as_it_holds_more_people(random_team):
    """Two cells at equal distance: the one with more people drawn is flown to, the first of two equal ones."""
    team = random_team(0, uavs=1, targets=0, trees=0)
    (situation,) = refitted(team, lambda v: dataclasses.replace(v, position=np.array([0.0, 0.0, 20.0])))
    people = np.zeros((1, 21))
    people[0, 0], people[0, 20] = 1.2, 0.7
    situation = dataclasses.replace(situation, undetected=sprinkled(people))
    planner, rng, west, east = Thompson(horizon=100), np.random.default_rng(1), 0, 0
    for _ in range(1500):
        controls = planner.plan([situation], rng)[0].controls
        west, east = west + (controls[0, 0] < 0), east + (controls[0, 0] > 0)
    more, fewer = skellam.sf(0, 1.2, 0.7), skellam.cdf(-1, 1.2, 0.7)
    for found, least, most in ((west, more, 1 - fewer - math.exp(-1.9)), (east, fewer, 1 - more - math.exp(-1.9))):
        assert least - 0.04 < found / 1500 < most + 0.04
    assert abs((west + east) / 1500 - (1 - math.exp(-1.9))) < norm.ppf(0.999) * math.sqrt(0.13 / 1500)


def test_a_flight_ends_with_the_person_in_view_and_is_kept_until_then(random_team):
    situation = random_team(2, uavs=1, targets=0, trees=0)[0]
    state = np.array([[30.0, -20.0, -1.0, 0.5]])
    world = DrawnWorld(state, np.full((1, 4), math.inf))
    planner = Thompson(horizon=50)
    goal, start = planner.goal(situation, world), situation.own.position
    steps = math.ceil(np.hypot(*(goal - start[:2])) / 5.0)
    point = np.array([*state[0, :2] + steps * state[0, 2:], TARGET_HEIGHT])
    assert situation.own.camera.sees(Pose(np.array([*goal, start[2]]), situation.own.attitude), point)[0]
    flight = np.random.default_rng(0).uniform(-3, 3, (4, 2))
    flying = dataclasses.replace(situation, intents={0: Plan(flight)})
    for left in (3, 2, 1):
        (plan,) = planner.plan([flying], np.random.default_rng(left))
        np.testing.assert_array_equal(plan.controls, flight[-left:])
        flying = dataclasses.replace(situation, intents={0: plan})
    (plan,) = planner.plan([flying], np.random.default_rng(0))  # nothing is left, and no person is believed anywhere
    np.testing.assert_array_equal(plan.controls, np.zeros((1, 2)))
