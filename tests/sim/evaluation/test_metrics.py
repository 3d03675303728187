"""Figures over a recording: by hand, without absent people, and quickly."""

import dataclasses
import json
import math
import time
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import synthetic
from helpers.summaries import summary

from sim.evaluation.score import held_by, score, velocities
from sim.recording.recording import VERSION, Recorder, Recording
from sim.scenario.scenario import resolved
from tracking.metrics.gospa import gospa
from tracking.metrics.nees import nees_interval
from tracking.metrics.ospa import ospa2


def recorded(people, held, broken=()):
    """A recording of people (K, M, 2) and, per scan and UAV, tracks {id: (x, y, vx, vy)}; `broken`: scans and UAVs."""
    scans, uavs, count = len(people), len(held[0]), people.shape[1]
    cells = [cell for row in held for cell in row]
    means = [mean for cell in cells for mean in cell.values()]
    ospa = np.ones((scans, uavs, 3))
    for k, i in broken:
        ospa[k:, i] = np.nan
    return Recording(
        version=VERSION,
        scenario="{}",
        planner="hover",
        seed=0,
        interrupted=False,
        times=np.arange(scans) / 5,
        trees=np.zeros((0, 6)),
        people=people,
        headings=np.zeros((scans, count)),
        poses=np.zeros((scans, uavs, 7)),
        cameras=np.zeros((scans, uavs, 7)),
        commands=np.zeros((scans, uavs, 2)),
        measurement_offsets=np.zeros(scans * uavs + 1, dtype=np.int64),
        measurements=np.zeros((0, 2)),
        measurement_covariances=np.zeros((0, 2, 2)),
        pixels=np.zeros((0, 2)),
        track_offsets=np.cumsum([0, *map(len, cells)]),
        track_ids=np.array([id for cell in cells for id in cell], dtype=np.int64),
        track_means=np.array(means, dtype=float).reshape(-1, 4),
        track_covariances=np.tile(np.diag([0.25, 0.25, 1.0, 1.0]), (len(means), 1, 1)),
        track_existence=np.full(len(means), np.nan),
        plan_times=np.zeros(0),
        plans=np.zeros((0, uavs, 0, 2)),
        ospa=ospa,
        visible=np.zeros((scans, uavs, count), dtype=np.int64),
        matched=np.zeros((scans, uavs, count), dtype=bool),
    )


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


def test_velocities_are_central_differences_one_sided_at_the_ends_of_a_presence():
    people = np.array([[0, 1, 4, 9, np.nan, 2], [np.nan, 5, np.nan, 1, 2, 4]], float).T[..., None] * [1.0, -2.0]
    found = velocities(SimpleNamespace(people=people, times=np.arange(6) / 5))
    nan = math.nan
    np.testing.assert_allclose(found[:, 0, 0], np.array([1, 2, 4, 5, nan, nan]) * 5)
    np.testing.assert_allclose(found[:, 1, 0], np.array([nan, nan, nan, 1, 1.5, 2]) * 5)
    np.testing.assert_allclose(found[..., 1], -2 * found[..., 0])


def test_tracks_are_sorted_by_uav_scan_and_id():
    held = held_by(recorded(walk(), HELD), 0)
    assert held.ids.tolist() == [7, 8, 9]
    np.testing.assert_array_equal(held.means[3, 1], track(-30.0))
    assert np.isnan(held.means[..., 0]).tolist() == [[0, 1, 1], [0, 1, 1], [1, 1, 0], [1, 0, 0]]
    assert np.array_equal(np.isnan(held.covariances[..., 0, 0]), np.isnan(held.means[..., 0]))


def test_the_figures_match_the_hand_count():
    result = summary(recorded(walk(), HELD))
    first, second = result["uavs"]
    assert (first["switches"], first["fragmentations"]) == (1, 0)
    assert (second["switches"], second["fragmentations"]) == (0, 0)
    assert result["identity"] == {"within_m": 1.0, "switches": 0.5, "fragmentations": 0.0}
    # Presences: 4 of the first person and 2 of the second, for each of two UAVs; held: 4 of these 12.
    assert result["people_held"] == [0.5, 0.0]
    assert (result["share_held"], first["share_held"], second["share_held"]) == (4 / 12, 4 / 6, 0.0)
    # UAV 0: errors of 0.5 m, 0.5² / 0.25 = 1 each. UAV 1: 3² / 0.25 = 36. Velocities are right.
    assert (first["position_nees"], second["position_nees"]) == pytest.approx((1.0, 36.0))
    assert (first["state_nees"], second["state_nees"]) == pytest.approx((1.0, 36.0))
    assert result["nees"]["position"]["mean"] == pytest.approx(18.5)
    assert result["nees"]["position"]["errors"] == 2  # the rounded mean of 4 and 1
    assert result["nees"]["state"]["interval_95"] == list(nees_interval(2, 4))
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


def test_a_uav_that_breaks_down_counts_until_then():
    people, held = walk(), [[dict(a), dict(a)] for a, _ in HELD]
    whole = summary(recorded(people, held))
    assert whole["uavs"][0] == whole["uavs"][1]
    broken = recorded(people, held, broken=[(2, 1)])
    result = summary(broken)
    assert result["uavs"][0] == whole["uavs"][0]
    short = summary(recorded(people[:2], [row[:1] for row in held[:2]]))
    assert result["uavs"][1] == short["uavs"][0]
    assert result["identity"]["switches"] == 0.5
    assert result["share_held"] == (4 + 2) / (6 + 2)
    never = summary(recorded(people, held, broken=[(0, 1)]))
    assert never["identity"]["switches"] == 1.0 and never["ospa2_m"] == whole["ospa2_m"]
    assert never["uavs"][1]["ospa2_m"] is None and never["uavs"][1]["ospa_m"] is None


@pytest.mark.parametrize("options", [{"people": 0}, {"scans": 1}, {"uavs": 1}])
def test_the_figures_are_strict_json_for_any_mission(options):
    json.dumps(summary(synthetic_recording(**{"scans": 11, **options})), allow_nan=False)
    gone = dataclasses.replace(recorded(walk(), HELD), ospa=np.full((4, 2, 3), np.nan))
    result = summary(gone)
    json.dumps(result, allow_nan=False)
    assert result["gospa"]["mean_m"] is result["ospa2_m"] is result["share_held"] is None


def synthetic_recording(scans, **options):
    setting = synthetic.scenario(**options)
    trees = synthetic.forest(setting)
    recorder = Recorder()
    for snapshot in synthetic.snapshots(setting, trees, scans):
        recorder.add(snapshot)
    return recorder.recording(scenario=resolved(setting), planner="hover", seed=0, forest=trees)


def test_the_figures_are_those_of_the_library_scan_by_scan():
    recording = synthetic_recording(21)
    for i in range(3):
        found = score(recording, i)
        for k in range(21):
            tracks = np.array([t.belief.mean[:2] for t in recording.tracks_at(k, i)])
            people = recording.people[k][~np.isnan(recording.people[k, :, 0])]
            np.testing.assert_allclose(found.gospa[k], gospa(tracks, people, 10.0))
        paths = np.array([[t.belief.mean[:2] for t in recording.tracks_at(k, i)] for k in range(21)])
        assert found.ospa2 == ospa2(paths, recording.people).distance


def test_a_mission_of_40_s_is_summed_up_in_a_third_of_a_second():
    recording = synthetic_recording(201)
    spent = []
    for _ in range(3):
        start = time.perf_counter()
        summary(recording)
        spent.append(time.perf_counter() - start)
    assert min(spent) < 0.3
