"""Observations hold what situations say, nearest first, and rewards are what they claim."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.flights import fly_ideal
from helpers.teams import Spy

from sim.environments.observations import Observations
from sim.environments.rewards import compute_expected_gospa, compute_true_gospa, trace
from sim.mission.snapshot import find_reported_positions
from tracking.errors import InputError
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import ALL_ROUND, Camera
from tracking.metrics.ospa import gospa
from tracking.track import Track
from tracking.undetected import Intensity


@pytest.fixture(scope="module")
def teams():
    spy = Spy(lambda s: [[1.0 + s.own.id, 0.5]])
    fly_ideal("tracking.initial_tracks=none", "people.count=8", "network.range=20", planner=spy, seed=3)
    return spy.teams


def test_rows_are_the_nearest_with_offsets_beliefs_and_times(teams):
    full = 0
    for situation in (s for team in teams for s in team):
        found = Observations(2, tracks=2, trees=4, undetected=True).of(situation)
        here = situation.own.position
        near = sorted(situation.tracks, key=lambda t: np.linalg.norm(t.belief.mean[:2] - here[:2]))[:2]
        assert found["tracks_mask"].tolist() == [1] * len(near) + [0] * (2 - len(near))
        full += len(near)
        for row, track in zip(found["tracks"], near, strict=False):
            P = track.belief.covariance
            unseen = situation.time - track.sighting[2]
            assert 0.0 <= unseen <= situation.time
            expected = [*(track.belief.mean[:2] - here[:2]), *track.belief.mean[2:], P[0, 0], P[0, 1], P[1, 1]]
            np.testing.assert_allclose(row, [*expected, track.existence, unseen], rtol=1e-6)
        assert not found["tracks"][len(near) :].any()
        trees = sorted(situation.forest.trees, key=lambda t: math.dist((t.x, t.y), here[:2]))[:4]
        expected = [(t.x - here[0], t.y - here[1], t.canopy_radius) for t in trees]
        np.testing.assert_allclose(found["trees"], expected, rtol=1e-6)
        np.testing.assert_allclose(found["undetected"], situation.undetected.people, rtol=1e-6)
    assert full > 5


def test_where_undetected_people_are_not_estimated_none_are_expected(random_team):
    situation = random_team(0)[0]
    found = Observations(2, undetected=True).of(situation)
    assert situation.undetected is None and found["undetected"].shape == (20, 30) and not found["undetected"].any()
    assert "neighbours" not in Observations(0).of(situation)


def test_the_map_of_undetected_people_is_left_out_unless_it_is_asked_for(teams):
    sizes = []
    for given in ({}, {"undetected": True}):
        found, vector = (Observations(2, **given, flat=flat).of(teams[0][0]) for flat in (False, True))
        assert ("undetected" in found) == bool(given)
        sizes.append(len(vector))
    assert sizes[1] - sizes[0] == 600 > 3 * sizes[0]


def test_own_state_and_neighbours_come_with_their_velocities(teams):
    for k, team in enumerate(teams):
        for situation, edge in zip(team, (20.0, 25.0, 22.0), strict=True):
            found, own = Observations(2).of(situation), situation.own
            flown = [1.0 + own.id, 0.5] if k else [0.0, 0.0]
            np.testing.assert_allclose(found["own"], [*own.position, *flown, edge], rtol=1e-6)
            heard = sorted(situation.neighbours, key=lambda v: math.dist(v.position[:2], own.position[:2]))
            assert found["neighbours_mask"].sum() == len(heard) == (2 if own.id == 1 else 1)
            for row, vehicle in zip(found["neighbours"], heard, strict=False):
                flown = [1.0 + vehicle.id, 0.5] if k else [0.0, 0.0]
                np.testing.assert_allclose(row[:5], [*(vehicle.position - own.position), *flown], rtol=1e-6, atol=1e-6)


def test_scaled_rows_are_the_same_in_units_of_area_speed_and_minutes_and_cut_off(teams):
    for situation in (s for team in teams for s in team):
        plain, scaled = (Observations(2, scaled=given, undetected=True).of(situation) for given in (False, True))
        half, top = max(situation.area) / 2, situation.own.max_speed
        units = {"own": [half, half, half, top, top, half], "trees": [half] * 3, "undetected": 1.0}
        units |= {"tracks": [half, half, top, top, 100, 100, 100, 1, 60], "neighbours": [half] * 3 + [top, top, half]}
        assert plain.keys() == scaled.keys()
        for name, array in plain.items():
            expected = np.clip(array / units.get(name, 1.0), -1.0, 1.0)
            np.testing.assert_allclose(scaled[name], expected, rtol=1e-6, atol=1e-7)
            assert scaled[name].dtype == array.dtype


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ({"neighbours": 1}, "neighbours: 1 is too few for a team with UAV 2; expected the size of the fleet less one"),
        ({"neighbours": -1}, "neighbours -1 is not allowed; expected an integer, 0 to 10000"),
        ({"neighbours": 2, "trees": 2.5}, "trees 2.5 is not allowed; expected an integer, 1 to 10000"),
        ({"neighbours": 2, "flat": "no"}, "flat 'no' is not allowed; expected True or False"),
    ],
)
def test_observations_that_leave_out_uavs_or_cannot_be_are_refused(teams, rows, message):
    with pytest.raises(InputError, match=f"^{message}$"):
        Observations(**rows).of_team(teams[0])


def test_a_track_that_tells_no_sighting_is_unseen_since_the_start(teams):
    track = Track(0, Gaussian(np.zeros(4), np.eye(4)))
    assert math.isnan(track.sighting[2])
    situation = dataclasses.replace(teams[3][0], tracks=(track,))
    assert Observations(2).of(situation)["tracks"][0, -1] == situation.time == 3.0


def test_the_edge_of_an_unlimited_view_is_the_longer_of_the_area(teams):
    own = dataclasses.replace(teams[0][0].own, camera=Camera(ALL_ROUND, 128))
    situation = dataclasses.replace(teams[0][0], own=own)
    assert Observations(2).of(situation)["own"][-1] == 150.0


def believed(situation, tracks, undetected):
    people = np.full((2, 2), undetected / 4)
    return dataclasses.replace(situation, tracks=tracks, undetected=Intensity(people, (0.0, 0.0), (1.0, 1.0)))


def test_the_expected_gospa_is_the_mean_of_its_square_over_the_belief(teams):
    """Tracks far apart, one of them so vague that its error is often cut off."""
    rng = np.random.default_rng(0)
    spreads = np.array([[[0.8, 0.3], [0.3, 0.5]], [[40.0, 0.0], [0.0, 40.0]], [[3.0, 0.0], [0.0, 3.0]]])
    tracks = tuple(
        Track(i, Gaussian(np.array([100.0 * i, 0.0, 0.0, 0.0]), np.kron(np.eye(2), spreads[i])), r)
        for i, r in enumerate((0.9, 0.6, 0.2))
    )
    squares = []
    for _ in range(4000):
        there = [
            rng.multivariate_normal(track.belief.mean[:2], spread)
            for track, spread in zip(tracks, spreads, strict=True)
            if rng.random() < track.existence
        ]
        undetected = [[1e6 + 1e3 * k, 0.0] for k in range(rng.poisson(0.7))]
        squares.append(
            gospa(find_reported_positions(tracks), np.array([*there, *undetected]).reshape(-1, 2)).distance ** 2
        )
    reward = compute_expected_gospa(believed(teams[0][0], tracks, 0.7), np.zeros((0, 2)))
    assert reward**2 == pytest.approx(np.mean(squares), abs=4 * np.std(squares) / math.sqrt(len(squares)))
    assert reward < 0
    vague = tuple(Track(t.id, Gaussian(t.belief.mean, 1e9 * np.eye(4)), 1.0) for t in tracks)
    assert compute_expected_gospa(believed(teams[0][0], vague, 0.0), np.zeros((0, 2))) == pytest.approx(
        -math.sqrt(300.0)
    )


def test_the_other_rewards_are_the_trace_and_the_gospa_to_the_true_people(teams):
    tracks = (Track(0, Gaussian(np.zeros(4), np.diag([1.0, 2.0, 8.0, 8.0]))),)
    situation = believed(teams[0][0], tracks * 1, 0.0)
    assert trace(situation, np.zeros((5, 2))) == -3.0
    lost = believed(teams[0][0], (), 4.0)
    assert trace(lost, np.zeros((4, 2))) == 0.0 and compute_expected_gospa(lost, np.zeros((4, 2))) == -math.sqrt(200.0)
    people = np.array([[3.0, 4.0], [90.0, 0.0]])
    assert compute_true_gospa(situation, people) == pytest.approx(-math.sqrt(25.0 + 50.0))
    doubted = (Track(0, tracks[0].belief, 0.5),)
    assert compute_true_gospa(believed(teams[0][0], doubted, 0.0), people) == pytest.approx(-math.sqrt(50.0 + 50.0))
