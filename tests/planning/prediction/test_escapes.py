"""Escapes of lost people, against enumeration and closed forms."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from planning.planner_check import CHECKS, check_planner
from planning.planner_loading import load_planner
from planning.prediction.escapes import Escapes
from tracking.geometry.visibility import Forest, Tree

TIME = 25.0  # s, mean time until people turn
AWAY = np.array([60.0, 40.0])  # m, where no camera sees the people of these tests
PLACE = np.array([-3.0, 2.0])  # m, of the last detection, at 1 s


def lose(situation, time, existence=0.9, at=AWAY, since=1.0):
    """The situation at a time, with its UAVs `at` a place and one track that was last detected at `PLACE`."""
    track = replace(situation.tracks[0], existence=existence, sighting=np.array([*PLACE, since]))
    team = [replace(v, position=np.array([*at, v.position[2]])) for v in situation.vehicles]
    own, *neighbours = team
    return replace(situation, time=time, tracks=(track,), own=own, neighbours=tuple(neighbours))


@pytest.fixture
def situation(random_team):
    made = random_team(0, uavs=2, targets=1)[0]
    return replace(made, forest=Forest(()), area=(150.0, 100.0))


def test_people_turn_at_a_constant_rate_while_nobody_looks(situation):
    escapes = Escapes(TIME)
    for time in np.arange(1.5, 11.6, 0.5):
        kept, *turned = escapes.split(lose(situation, time))
        share = 1.0 - math.exp(-(time - 1.0) / TIME)
        assert kept.existence == pytest.approx(0.9 * (1.0 - share), abs=1e-4)
        # Parts of less than one per cent are left out.
        assert sum(part.existence for part in turned) == pytest.approx(0.9 * share if share > 0.067 else 0.0, abs=1e-4)
    means = np.array([part.belief.mean for part in turned])
    assert np.mean(means[:, :2], axis=0) == pytest.approx(PLACE, abs=1e-9)
    assert means[:, :2] - PLACE == pytest.approx(10.5 * means[:, 2:])  # they have walked straight on since
    before = situation.tracks[0].belief
    assert np.array_equal(kept.belief.mean, before.mean)
    assert kept.belief.covariance == pytest.approx(0.7 * before.covariance)  # the rest is that of people who turn
    assert [part.id for part in (kept, *turned)] == list(range(7))


def enumerate_turns(looks, existence):
    """Probabilities at the last look that the person has turned, by sextant of direction, and of the track.

    looks: time [s], place of the camera (2,) m and half the width of its view [m], for each frame. People who turned
    have one of 216 velocities each; each interval between looks adds those who turn in it.
    """
    angles, speeds = np.radians(np.arange(5.0, 360.0, 10.0)), np.arange(0.25, 3.0, 0.5)
    velocities = np.array([[v * math.cos(a), v * math.sin(a)] for a in angles for v in speeds])
    odds = existence / (1.0 - existence)
    kept = [odds * math.exp(-(t - 1.0) / TIME) for t in (1.0, *(look[0] for look in looks))]
    times = [1.0, *(look[0] for look in looks)]
    mass = sum((b - a) / TIME * (kept[k] + kept[k + 1]) / 2 for k, (a, b) in enumerate(pairwise(times)))
    each = np.full(len(velocities), mass / len(velocities))
    for time, camera, half in looks:
        offset = np.abs(PLACE + velocities * (time - 1.0) - camera)
        each[np.all(offset < half, axis=1)] *= 0.01
    whole = 1.0 + kept[-1] + each.sum()
    return kept[-1] / whole, each.reshape(6, -1).sum(axis=1) / whole


@pytest.mark.parametrize("existence", [0.9, 0.7])
def test_frames_rule_out_where_people_are_not_as_by_enumeration(situation, existence):
    lens = situation.own.camera
    half = (situation.own.position[2] - 0.85) * math.tan(lens.fov / 2.0)
    looks = [
        (2.0, PLACE + np.array([half - 1.0, 0.0])),
        (4.0, PLACE + np.array([half + 0.4, 3.0])),
        (5.5, AWAY),
        (9.0, PLACE - np.array([0.0, half])),
    ]
    own = replace(situation.own, attitude=np.array([0.0, 0.0, 0.0, 1.0]))
    alone = replace(situation, own=own, neighbours=())
    escapes = Escapes(TIME)
    for time, camera in looks:
        parts = escapes.split(lose(alone, time, existence, at=camera))
    kept, turned = enumerate_turns([(t, camera, half) for t, camera in looks], existence)
    assert parts[0].existence == pytest.approx(kept, abs=1e-9)
    assert [part.existence for part in parts[1:]] == pytest.approx(turned[turned > 0.01], abs=1e-9)
    assert 1 <= np.sum(turned < 0.01) <= 4 and turned.max() > 0.02  # frames ruled out some directions


def test_trees_hide_people_from_frames(situation):
    canopy = Forest((Tree(*PLACE, canopy_radius=30.0),))
    assert len(Escapes(TIME).split(lose(situation, 5.0, at=PLACE))) < 4
    assert len(Escapes(TIME).split(lose(replace(situation, forest=canopy), 5.0, at=PLACE))) == 7


def test_frames_of_uavs_that_are_not_heard_do_not_count(situation):
    near = lose(situation, 5.0)
    near = replace(near, neighbours=(replace(near.neighbours[0], position=np.array([*PLACE, 30.0])),))
    assert len(Escapes(TIME).split(near)) < len(Escapes(TIME).split(replace(near, reception=((),)))) == 7


def test_a_new_detection_begins_anew_and_others_are_left_as_they_are(situation):
    escapes = Escapes(TIME)
    escapes.split(lose(situation, 5.0, at=PLACE))
    assert len(escapes.split(lose(situation, 6.0, since=5.9))) == 1
    again = escapes.split(lose(situation, 16.0, since=5.9))
    fresh = Escapes(TIME).split(lose(situation, 16.0, since=5.9))
    assert [part.existence for part in again] == [part.existence for part in fresh] and len(fresh) == 7
    (never,) = escapes.split(replace(situation, tracks=situation.tracks[:1]))  # a tracker that gives no sightings
    assert never.existence == situation.tracks[0].existence and never.belief is situation.tracks[0].belief


def test_planners_that_search_for_escaped_people_remember_frames_until_a_reset(random_team):
    findings = check_planner("sma-nbo-gospa(escape=40, evaluations=64)")
    assert [str(finding) for finding in findings if finding.passed is False] == [] and len(findings) == len(CHECKS)
    planner = load_planner("sma-nbo-gospa(escape=40, evaluations=64)")
    team = [lose(s, 5.0, at=PLACE + np.array([8.0, 0.0])) for s in random_team(1, uavs=2, targets=1)]
    later = [lose(s, 9.0, at=PLACE + np.array([12.0, 6.0])) for s in team]

    def plan(one):
        return np.array([plan.controls for plan in planner.plan(one, np.random.default_rng(3))])

    planner.reset(0)
    without = plan(later)
    plan(team)
    assert not np.array_equal(plan(later), without)
    planner.reset(0)
    assert np.array_equal(plan(later), without)
    assert not load_planner("sma-nbo-gospa").stateful
