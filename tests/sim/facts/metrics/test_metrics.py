"""Figures and summary over a recording: by hand, without absent people, and as tables."""

import dataclasses
import json
import math
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from helpers.flights import recorded as recorded_mission
from helpers.recordings import bare, record
from helpers.summaries import SECONDS, hand_made, shown, summary

from sim.facts.metrics.score import estimate_velocities, find_reported_tracks, score
from sim.mission.fault import Fault
from sim.mission.stopwatch import STAGES
from sim.scenario.scenario import encode_scenario
from tracking.metrics.nees import nees_interval


def recorded(people, held, broken=(), found=()):
    """A recording of people and tracks; `broken`: scans and UAVs from which on these have broken down.

    found: (scan, UAV, person, place) of each detection, in this order; all have the variance 0.1 m².
    """
    uavs = len(held[0])
    ospa = np.ones((len(people), uavs, 3))
    for k, i in broken:
        ospa[k:, i] = np.nan
    matched = np.zeros((len(people), uavs, people.shape[1]), dtype=bool)
    for k, i, m, _ in found:
        matched[k, i, m] = True
    recording = bare(
        people,
        held,
        ospa=ospa,
        matched=matched,
        measurement_offsets=np.concatenate([[0], np.cumsum(matched.sum(axis=2))]),
        measurements=np.array([place for *_, place in found], dtype=float).reshape(-1, 2),
        measurement_covariances=np.tile(0.1 * np.eye(2), (len(found), 1, 1)),
        pixels=np.full((len(found), 2), np.nan),
    )
    spread = np.diag([0.25, 0.25, 1.0, 1.0])
    return dataclasses.replace(recording, track_covariances=np.tile(spread, (len(recording.track_ids), 1, 1)))


def walk(scans=4):
    """One person going east at 1 m/s, and one at rest 40 m north and comes at scan 2."""
    people = np.zeros((scans, 2, 2))
    people[:, 0, 0] = 0.2 * np.arange(scans)
    people[:, 1, 1] = 40.0
    people[:2, 1] = np.nan
    return people


def track(x, y=0.0):
    return (x, y, 1.0, 0.0)


# UAV 0: half a metre north of the first person throughout, under another id from scan 2 on; a ghost at scan 3.
# UAV 1: nothing but at scan 1, and then 3 m off.
HELD = [
    [{7: track(0.0, 0.5)}, {}],
    [{7: track(0.2, 0.5)}, {7: track(0.2, 3.0)}],
    [{9: track(0.4, 0.5)}, {}],
    [{8: track(-30.0), 9: track(0.6, 0.5)}, {}],
]


def test_a_fleet_that_never_works_has_no_bytes_rather_than_an_error():
    zeros = np.zeros((4, 2), dtype=np.int64)
    found = recorded(walk(), HELD, broken=[(0, 0), (0, 1)])
    found = dataclasses.replace(found, bytes_sent=zeros, plan_bytes=zeros, plan_times=found.times[:1])
    result = summary(dataclasses.replace(found, plans=np.zeros((1, 2, 1, 2)), plan_rounds=np.ones(4, dtype=np.int64)))
    assert result["network"]["bytes_per_scan_max"] is None and result["network"]["plans"]["bytes_total"] is None
    assert result["ospa"]["mean_m"] is None and shown(result)


def test_velocities_are_central_differences_and_tracks_sorted_by_uav_and_scan():
    people = np.array([[0, 1, 4, 9, np.nan, 2], [np.nan, 5, np.nan, 1, 2, 4]], float).T[..., None] * [1.0, -2.0]
    found = estimate_velocities(SimpleNamespace(people=people, times=np.arange(6) / 5))
    nan = math.nan
    np.testing.assert_allclose(found[:, 0, 0], np.array([1, 2, 4, 5, nan, nan]) * 5)
    np.testing.assert_allclose(found[:, 1, 0], np.array([nan, nan, nan, 1, 1.5, 2]) * 5)
    np.testing.assert_allclose(found[..., 1], -2 * found[..., 0])
    flown = recorded(walk(), HELD)
    held = find_reported_tracks(flown, 0)
    assert held.ids.tolist() == [7, 8, 9]
    np.testing.assert_array_equal(held.means[3, 1], track(-30.0))
    assert np.isnan(held.means[..., 0]).tolist() == [[0, 1, 1], [0, 1, 1], [1, 1, 0], [1, 0, 0]]
    assert np.array_equal(held.rows < 0, np.isnan(held.means[..., 0]))
    np.testing.assert_array_equal(flown.track_means[held.rows[held.rows >= 0]], held.means[held.rows >= 0])


def test_tracks_that_are_not_reported_count_in_no_figure_of_tracking():
    doubted = recorded(walk(), HELD)
    rows = doubted.track_ids == 8
    doubted = dataclasses.replace(doubted, track_existence=np.where(rows, 0.5, [np.nan, 1.0, 0.51, 0.8, 0.9, 0.9]))
    without = [[{id: mean for id, mean in cell.items() if id != 8} for cell in row] for row in HELD]
    one, other = summary(doubted), summary(recorded(walk(), without))
    assert one["gospa"] == other["gospa"] and one["uavs"] == other["uavs"] and one["tracks"] == other["tracks"]
    assert summary(recorded(walk(), HELD))["gospa"] != other["gospa"]


def test_the_figures_match_the_hand_count():
    people = walk()
    result = summary(recorded(people, HELD, found=[(k, 0, 0, people[k, 0]) for k in range(4)]))
    first, second = result["uavs"]
    assert (first["switches"], first["fragmentations"]) == (1, 0)
    assert (second["switches"], second["fragmentations"]) == (0, 0)
    assert result["identity"] == {"within_m": 1.0, "switches": 0.5, "fragmentations": 0.0}
    # Presences: 4 of the first person and 2 of the second, for each of two UAVs; held: 4 of these 12.
    assert result["people_held"] == [0.5, 0.0]
    assert (result["share_held"], first["share_held"], second["share_held"]) == (4 / 12, 4 / 6, 0.0)
    # UAV 0: errors of 0.5 m, 0.5² / 0.25 = 1 each; velocities are right. The ghost, and UAV 1's track, took nothing.
    assert (first["position_nees"], second["position_nees"]) == (pytest.approx(1.0), None)
    assert (first["state_nees"], second["state_nees"]) == (pytest.approx(1.0), None)
    assert result["nees"]["position"] == {
        "mean": pytest.approx(1.0),
        "errors": 4,
        "interval_95": list(nees_interval(4, 2)),
    }
    assert result["nees"]["left_out_share"] == 2 / 6
    assert result["nees"]["state"]["interval_95"] == list(nees_interval(4, 4))
    # Missed: UAV 0 the second person twice, UAV 1 (1 - 0) + 0 + 2 + 2; false: the ghost. Of 8 pairs of scan and UAV.
    assert result["gospa"]["missed"] == pytest.approx((2 + 5) / 8)
    assert result["gospa"]["false"] == pytest.approx(1 / 8)
    # Localisation is 0.5 m for UAV 0, and 3 m at one scan for UAV 1.
    assert result["gospa"]["localisation_m"] == pytest.approx((4 * 0.5 + 3) / 8)
    missed = math.sqrt(50)
    uav0 = [0.5, 0.5, math.sqrt(0.25 + 50), math.sqrt(0.25 + 100)]
    assert first["gospa_m"] == pytest.approx(np.mean(uav0))
    assert second["gospa_m"] == pytest.approx((missed + 3 + 2 * math.sqrt(2) * missed) / 4)
    assert result["gospa"]["mean_m"] == pytest.approx((first["gospa_m"] + second["gospa_m"]) / 2)
    # Track 7 is 0.5 m off half of the time and missing the other, track 9 as far from the second person as it is at
    # both scans of theirs, track 8 false.
    off = (math.hypot(0.4, 39.5) + math.hypot(0.6, 39.5)) / 2
    assert first["ospa2_m"] == pytest.approx(math.sqrt((25.25**2 + off**2 + 50**2) / 3))
    assert result["ospa2_m"] == pytest.approx((first["ospa2_m"] + second["ospa2_m"]) / 2)


def test_nees_pairs_a_track_with_the_person_whose_detection_it_took_last():
    people = np.zeros((4, 2, 2))
    people[:, 1, 0] = 4.0
    here, there = (0.0, 0.5, 0.0, 0.0), (4.0, 0.5, 0.0, 0.0)
    before, after = {1: here, 2: there}, {1: there, 2: here}
    exchanged, seen = (
        [[before], [before], [after], [after]],
        [(k, 0, m, people[k, m]) for k in range(4) for m in (0, 1)],
    )
    found = score(recorded(people, exchanged, found=seen), 0)
    assert (found.switches, found.left_out) == (2, 0)
    np.testing.assert_allclose(found.position_nees, np.ones(8))  # 0.5 m is the deviation
    unseen = score(recorded(people, exchanged, found=seen[:4]), 0)  # exchanged where nobody is detected
    np.testing.assert_allclose(np.sort(unseen.position_nees), [1.0] * 4 + [65.0] * 4)
    between = score(recorded(people, [[{1: (2.0, 0.0, 0.0, 0.0)}]] * 4, found=seen), 0)  # which took nothing
    assert (len(between.position_nees), between.left_out) == (0, 4)


@pytest.mark.parametrize(("pose_errors", "off"), [("ignore", 3.0), ("estimate", 0.0)])
def test_a_detection_is_of_the_track_that_believes_or_corrects_it(pose_errors, off):
    """A pose that errs by 3 m: tracks of exchanged people err alike, or their tracker has found the error."""
    people = np.zeros((4, 2, 2))
    people[:, 1, 0] = 4.0
    here, there = (off, 0.5, 0.0, 0.0), (4.0 + off, 0.5, 0.0, 0.0)
    tracks = [[{1: here, 2: there}]] * 2 + [[{1: there, 2: here}]] * 2
    exact = recorded(people, tracks, found=[(k, 0, m, people[k, m] + [3.0, 0.0]) for k in range(4) for m in (0, 1)])
    tracking = msgspec.structs.replace(exact.setting.tracking, pose_errors=pose_errors)
    cameras = np.tile([0.0, 0.0, 20.0, 0.0, 0.0, 0.0, 1.0], (4, 1, 1))
    erring = dataclasses.replace(
        exact,
        scenario=encode_scenario(msgspec.structs.replace(exact.setting, tracking=tracking)),
        cameras=cameras,
        believed=cameras + np.append([3.0], np.zeros(6)),
    )
    np.testing.assert_allclose(score(erring, 0).position_nees, np.full(8, 1.0 + 4.0 * off**2), atol=1e-9)


def test_a_track_known_at_the_start_is_of_its_person_however_far_it_coasts():
    people = np.zeros((4, 1, 2))
    tracks = [[{3: (x, 0.0, 0.0, 0.0), 4: (x, 9.0, 0.0, 0.0)}] for x in (0.5, 0.5, 5.0, 50.0)]
    found = score(recorded(people, tracks), 0)
    np.testing.assert_allclose(found.position_nees, [1.0, 1.0, 100.0, 10000.0])
    assert found.left_out == 4  # those of the other track


def test_a_detection_is_the_persons_track_s_even_if_the_track_of_a_hidden_person_is_nearer():
    people = np.zeros((4, 2, 2))
    tracks = [[{1: (0.5, 0.0, 0.0, 0.0), 2: (0.0, float(y), 0.0, 0.0)}] for y in (0.5, 0.1, 0.1, 3.0)]
    people[:, 1, 1] = [0.5, 0.6, 0.6, 3.5]
    seen = [(0, 0, 0, people[0, 0]), (1, 0, 0, people[1, 0]), (2, 0, 0, people[2, 0])]
    found = score(recorded(people, tracks, found=seen), 0)
    np.testing.assert_allclose(found.position_nees, [1, 0, 1, 1, 1, 1, 1, 1])


def test_nees_does_not_depend_on_people_who_are_never_detected():
    """Strangers beside the tracks of those who leave; with them, tracks were paired with the nearest."""
    rng, setting = np.random.default_rng(0), ("sensing.mode=ideal", "tracking.initial_tracks=none")
    flown = recorded_mission(*setting, duration=10)
    people = flown.people.copy()
    people[30:, 0], people[20:, 1] = np.nan, np.nan
    gone = dataclasses.replace(flown, people=people, matched=flown.matched & ~np.isnan(people[:, None, :, 0]))
    strangers = flown.people + rng.normal(0, 3, flown.people.shape)
    none = np.zeros_like(flown.matched)
    eight = msgspec.structs.replace(flown.setting, people=msgspec.structs.replace(flown.setting.people, count=8))
    more = dataclasses.replace(
        gone,
        people=np.concatenate([people, strangers], axis=1),
        matched=np.concatenate([gone.matched, none], axis=2),
        scenario=encode_scenario(eight),
    )
    for uav in range(3):
        alone, among = score(gone, uav), score(more, uav)
        assert np.array_equal(alone.position_nees, among.position_nees) and alone.left_out == among.left_out > 20
        assert np.array_equal(alone.state_nees, among.state_nees) and len(alone.state_nees) > 50


@pytest.mark.parametrize(("spacing", "low", "high"), [(1.0, 0.55, 0.7), (3.0, 0.93, 0.99), (6.0, 0.97, 1.03)])
def test_people_nearer_to_one_another_than_their_noise_bias_nees_as_the_page_says(spacing, low, high):
    """Grids of nine people, by the standard deviation, 100 m from grid to grid; tracks are the detections of 20 scans.

    Whose a detection is, is known by nearness alone; a track that goes on keeps its person as long as that may be.
    """
    rng, deviation = np.random.default_rng(0), math.sqrt(0.1)
    grid = np.stack(np.meshgrid(np.arange(3), np.arange(3)), axis=-1).reshape(-1, 2) * spacing * deviation
    people = (grid + 100.0 * np.arange(11)[:, None, None] * [1, 0]).reshape(-1, 2)
    places = people + deviation * rng.normal(size=(20, len(people), 2))
    seen = [(k, 0, m, xy) for k, at in enumerate(places) for m, xy in enumerate(at)]
    means = []
    for renamed in (True, False):
        tracks = [
            [{k * renamed * len(people) + i: (*xy, 0, 0) for i, xy in enumerate(at)}] for k, at in enumerate(places)
        ]
        recording = recorded(np.tile(people, (20, 1, 1)), tracks, found=seen)
        spread = np.tile(0.1 * np.eye(4), (len(recording.track_ids), 1, 1))
        found = score(dataclasses.replace(recording, track_covariances=spread), 0)
        assert found.left_out < 0.01 * places[..., 0].size
        means.append(found.position_nees.mean() / 2)
    assert low < means[0] < high and 0.95 < means[1] < 1.3


def test_a_uav_that_breaks_down_counts_until_then():
    people, held = walk(), [[dict(a), dict(a)] for a, _ in HELD]
    whole = summary(recorded(people, held))
    assert whole["uavs"][0] == whole["uavs"][1]
    broken = recorded(people, held, broken=[(2, 1)])
    result = summary(broken)
    assert result["uavs"][0] == whole["uavs"][0]
    short = summary(recorded(people[:2], [row[:1] for row in held[:2]]))
    assert result["uavs"][1] == short["uavs"][0] and result["identity"]["switches"] == 0.5
    assert result["share_held"] == (4 + 2) / (6 + 2)
    never = summary(recorded(people, held, broken=[(0, 1)]))
    assert never["identity"]["switches"] == 1.0 and never["ospa2_m"] == whole["ospa2_m"]
    assert never["uavs"][1]["ospa2_m"] is None and never["uavs"][1]["ospa_m"] is None


@pytest.mark.parametrize("options", [{"people": 0}, {"scans": 1}, {"uavs": 1}])
def test_the_figures_are_strict_json_for_any_mission(options):
    json.dumps(summary(record(**options)), allow_nan=False)
    gone = dataclasses.replace(recorded(walk(), HELD), ospa=np.full((4, 2, 3), np.nan))
    result = summary(gone)
    json.dumps(result, allow_nan=False)
    assert result["gospa"]["mean_m"] is result["ospa2_m"] is result["share_held"] is None


def test_the_summary_matches_the_hand_count():
    result = summary(hand_made())
    assert result["ospa"] == {"mean_m": 1.5, "median_m": 0.75, "share_under_1m": 0.5}
    # Shown with a pixel or more: 6 pairs, 4 of them detected; 5 detections, 4 of them people.
    assert result["detection"] == {"recall": pytest.approx(4 / 6), "precision": pytest.approx(4 / 5)}
    assert (result["planner"], result["seed"], result["scenario"]["people"]) == ("hover", 7, {"count": 3})
    assert (result["duration_s"], result["interrupted"], result["faults"]) == (0.2, False, [])
    assert result["seconds"] == SECONDS
    # Person 0: held by both UAVs at scan 0, by none at 1. Person 1: a track at 2 m. Person 2: present at scan 1 only.
    assert summary(hand_made())["people_held"] == [0.5, 0.0, 0.5]
    gone = dataclasses.replace(hand_made(), people=np.full((2, 3, 2), np.nan))
    assert summary(gone)["people_held"] == [None, None, None]
    assert summary(hand_made())["real_time_factor"] == pytest.approx(0.2 / (14 - 4))
    started = summary(hand_made(), seconds={**SECONDS, "start_up": 5.0, "page": 3.0})
    assert started["real_time_factor"] == pytest.approx(0.2 / (14 - 4 - 5 - 3))
    assert started["seconds"]["start_up"] == 5.0
    assert summary(hand_made(), wall_s=4.0)["real_time_factor"] is None
    ideal = dataclasses.replace(
        hand_made(),
        pixels=np.full((5, 2), np.nan),
        visible=np.zeros((2, 2, 3), dtype=int),
        matched=np.zeros((2, 2, 3), dtype=bool),
    )
    assert summary(ideal)["detection"] == {"recall": None, "precision": None}


def test_the_summary_is_strict_json():
    result = summary(hand_made(), faults=[Fault(1.0, 0, "NaN"), Fault(2.0, None, "error")])
    assert result["faults"][0] == {"time": 1.0, "uav": 0, "message": "NaN"}
    assert json.loads(json.dumps(result, allow_nan=False)) == result and list(result["seconds"]) == list(STAGES)


def test_the_table_shows_every_number_and_interruptions():
    text = shown(summary(hand_made(), wall_s=4.025))
    pieces = ("hover, seed 7", "1.50 m", "0.75 m", "50.0 %", "66.7 %", "80.0 %", "8.0", *STAGES, "3.00 s")
    pieces += ("GOSPA mean", "people held", "30.0 %", "identity switches", "NEES of positions (consistent: 2)")
    for piece in pieces:
        assert piece in text
    assert "interrupted" not in text
    factors = [line.split("│")[1:3] for line in text.splitlines() if "factor" in line]
    assert [[word.strip() for word in row] for row in factors] == [
        ["real-time factor without start-up, film, page", "8.0"],
        ["wall-clock factor with these", "0.0"],
    ]
    result = summary(dataclasses.replace(hand_made(), interrupted=True))
    text = shown({**result, "detection": {"recall": None, "precision": None}})
    assert "interrupted" in text
