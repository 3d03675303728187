"""Escapes of lost people, against enumeration and closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.scenes import track
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from planning.planner_check import CHECKS, check_planner
from planning.planner_loading import load_planner
from tracking.geometry.camera import Camera, Look, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree
from tracking.management.escapes import Escapes
from tracking.management.reacquisition import turned_density
from tracking.parameters import LossRule

TIME = 25.0  # s, mean time until people turn
PLACE = np.array([-3.0, 2.0])  # m, of the last detection, at 1 s
HALF = 12.0  # m, half the edge of what a camera sees
CAMERA = Camera(2.0 * math.atan(HALF / 20.0), 128)


def look(x, y):
    return Look(CAMERA, Pose.level(x, y, 20.0 + TARGET_HEIGHT))


def lost(existence=0.9, since=1.0):
    return replace(track(3, 5.0, 5.0, 0.0, 0.0), existence=existence, sighting=np.array([*PLACE, since]))


def split(escapes, time, *looks, one=None, trees=()):
    return escapes.split(time, [one or lost()], looks, Forest(trees), (150.0, 100.0))


def test_people_turn_at_a_constant_rate_while_nobody_looks():
    escapes = Escapes(TIME)
    for time in np.arange(1.5, 11.6, 0.5):
        kept, *turned = split(escapes, time)
        share = 1.0 - math.exp(-(time - 1.0) / TIME)
        assert kept.existence == pytest.approx(0.9 * (1.0 - share), abs=1e-9)
        # Parts of less than one per cent are left out.
        assert sum(part.existence for part in turned) == pytest.approx(0.9 * share if share > 0.067 else 0.0, abs=1e-9)
    means = np.array([part.belief.mean for part in turned])
    assert np.mean(means[:, :2], axis=0) == pytest.approx(PLACE, abs=1e-9)
    assert means[:, :2] - PLACE == pytest.approx(10.5 * means[:, 2:])  # they have walked straight on since
    before = lost().belief
    assert np.array_equal(kept.belief.mean, before.mean)
    assert kept.belief.covariance == pytest.approx(0.5 * before.covariance)  # the rest is that of people who turn
    assert [part.id for part in (kept, *turned)] == [3] * 7


def test_people_whose_tracks_fade_turn_as_by_the_integral_of_their_odds():
    """Odds that fall from 9 to 1 in 10 s; up to the first decision they count as they are then."""

    def odds(time):
        return max(9.0 - 0.8 * (time - 1.0), 1.0)

    def density(time):
        return odds(time) * math.exp(-(time - 1.0) / TIME) / TIME

    escapes, first, end = Escapes(TIME), 1.4, 11.4
    for time in np.linspace(first, end, 21):
        kept, *turned = split(escapes, time, one=lost(odds(time) / (1.0 + odds(time))))
    expected = odds(first) * (1.0 - math.exp(-(first - 1.0) / TIME)) + quad(density, first, end)[0]
    there = odds(end) * math.exp(-(end - 1.0) / TIME)
    assert len(turned) == 6  # no part is left out
    assert sum(part.existence for part in turned) == pytest.approx(expected / (1.0 + expected + there), rel=1e-3)
    assert kept.existence == pytest.approx(there / (1.0 + expected + there), rel=1e-3)


def test_while_nobody_looks_people_are_where_association_has_them():
    """Planners have the people who turned in six Gaussians and at no more than 3 m/s, association in one."""
    now = 6.0  # s
    _, *turned = split(Escapes(10.0), now)  # 10 s is association's mean time until people turn
    x, y = (axis.ravel() for axis in np.meshgrid(*[np.arange(-25.0, 25.0, 0.5)] * 2))
    places, R = PLACE + np.column_stack([x, y]), np.tile(0.01 * np.eye(2), (len(x), 1, 1))
    last, existence = np.array([[*PLACE, 1.0]]), np.array([0.9])
    expected = turned_density(last, existence, places, R, (now - 0.2, now), LossRule(0.2, 3.0))
    beliefs = [multivariate_normal(part.belief.mean[:2], part.belief.covariance[:2, :2]) for part in turned]
    found = sum(part.existence * belief.pdf(places) for part, belief in zip(turned, beliefs, strict=True))
    assert found.sum() == pytest.approx(expected.sum(), rel=2e-3)  # of those beyond the raster
    reached = np.hypot(x, y) <= 15.0
    for limit in (5.0, 7.5, 10.0, 12.5):
        within = np.hypot(x, y) <= limit
        share = expected[within].sum() / expected[reached].sum()
        assert found[within].sum() / found.sum() == pytest.approx(share, abs=0.06)


def enumerate_turns(looks, existence):
    """Probabilities at the last look that the person has turned, by sextant of direction, and of the track.

    looks: time [s] and place of the camera (2,) m of each frame. People who turned have one of 216 velocities, whose
    components have a standard deviation of 1.5 m/s up to 3 m/s; each interval between looks adds those who turn in it.
    """
    angles, speeds = np.radians(np.arange(5.0, 360.0, 10.0)), np.arange(0.25, 3.0, 0.5)
    velocities = np.array([[v * math.cos(a), v * math.sin(a)] for a in angles for v in speeds])
    likely = np.tile([v * math.exp(-0.5 * (v / 1.5) ** 2) for v in speeds], 36)
    odds = existence / (1.0 - existence)
    times = [1.0, *(look[0] for look in looks)]
    kept = [odds * math.exp(-(t - 1.0) / TIME) for t in times]
    each = (kept[0] - kept[-1]) * likely / likely.sum()
    for time, camera in looks:
        offset = np.abs(PLACE + velocities * (time - 1.0) - camera)
        each[np.all(offset < HALF, axis=1)] *= 0.01
    whole = 1.0 + kept[-1] + each.sum()
    states = np.hstack([PLACE + velocities * (times[-1] - 1.0), velocities]).reshape(6, -1, 4)
    return kept[-1] / whole, each.reshape(6, -1) / whole, states


@pytest.mark.parametrize("existence", [0.9, 0.7])
def test_frames_rule_out_where_people_are_not_as_by_enumeration(existence):
    looks = [
        (2.0, PLACE + np.array([HALF - 1.0, 0.0])),
        (4.0, PLACE + np.array([HALF + 0.4, 3.0])),
        (5.5, np.array([60.0, 40.0])),
        (9.0, PLACE - np.array([0.0, HALF])),
    ]
    escapes = Escapes(TIME)
    for time, place in looks:
        parts = split(escapes, time, look(*place), one=lost(existence))
    kept, each, states = enumerate_turns(looks, existence)
    turned = each.sum(axis=1)
    assert parts[0].existence == pytest.approx(kept, abs=1e-9)
    assert [part.existence for part in parts[1:]] == pytest.approx(turned[turned > 0.01], abs=1e-9)
    assert 1 <= np.sum(turned < 0.01) <= 4 and turned.max() > 0.02  # frames ruled out some directions
    spread = np.diag([0.3 + 0.01 * 8.0**2] * 2 + [0.1] * 2)  # of what is between the directions and speeds, after 8 s
    for part, weights, state in zip(parts[1:], each[turned > 0.01], states[turned > 0.01], strict=True):
        np.testing.assert_allclose(part.belief.mean, np.average(state, axis=0, weights=weights), rtol=1e-9)
        covariance = np.cov(state.T, aweights=weights, ddof=0) + spread
        np.testing.assert_allclose(part.belief.covariance, covariance, rtol=1e-9, atol=1e-12)


def test_trees_hide_people_from_frames():
    canopy = Tree(*PLACE, canopy_radius=30.0)
    assert len(split(Escapes(TIME), 5.0, look(*PLACE))) < 4
    assert len(split(Escapes(TIME), 5.0, look(*PLACE), trees=(canopy,))) == 7


def test_nobody_leaves_the_area():
    escapes = Escapes(TIME)
    parts = escapes.split(11.0, [lost()], (), Forest(()), (6.0, 100.0))  # the western edge is where the person was
    assert all(abs(part.belief.mean[0]) < 3.0 for part in parts[1:]) and 1 < len(parts) < 7


def test_a_new_detection_begins_anew_and_others_are_left_as_they_are():
    escapes = Escapes(TIME)
    split(escapes, 5.0, look(*PLACE))
    assert len(split(escapes, 6.0, one=lost(since=5.9))) == 1
    again, fresh = (split(one, 16.0, one=lost(since=5.9)) for one in (escapes, Escapes(TIME)))
    assert [part.existence for part in again] == [part.existence for part in fresh] and len(fresh) == 7
    unknown = track(4, 0.0, 0.0, 0.0, 0.0)  # of a tracker that gives no sightings
    for one in (unknown, replace(unknown, sighting=np.array([0.0, 0.0, -np.inf]))):
        (never,) = split(escapes, 17.0, one=one)
        assert never is one


def test_planners_that_search_for_escaped_people_remember_frames_until_a_reset(random_team):
    findings = check_planner("sma-nbo-gospa(escape=20, evaluations=64)")
    assert [str(finding) for finding in findings if finding.passed is False] == [] and len(findings) == len(CHECKS)
    planner = load_planner("sma-nbo-gospa(escape=20, evaluations=64)")
    team = [
        replace(s, time=5.0, tracks=(lost(),), looks=(look(5.0, 2.0),), forest=Forest(()))
        for s in random_team(1, uavs=2, targets=1)
    ]
    later = [replace(s, time=9.0, looks=(look(9.0, 8.0),)) for s in team]

    def plan(one):
        return np.array([plan.controls for plan in planner.plan(one, np.random.default_rng(3))])

    planner.reset(0)
    without = plan(later)
    plan(team)
    assert not np.array_equal(plan(later), without)
    planner.reset(0)
    assert np.array_equal(plan(later), without)
    assert not load_planner("sma-nbo-gospa").stateful
