"""Oracle of `understory track`: a mission that was exported without its truth has the same tracks, byte for byte."""

from functools import cache

import numpy as np
import pytest
from helpers.flights import recorded
from helpers.processes import python

from sim.exchange.export import export
from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight
from sim.facts.tracking_replay import replay_tracking
from sim.mission.archive import load_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario

UNKNOWN = "tracking.initial_tracks=none"
MISSIONS = {
    "default fleet, many trees": ["duration=8", "sensing.mode=ideal", "trees.density=75", UNKNOWN],
    "two clocks and a slow camera": [
        *("duration=6", "rates.sensing=10", "uavs.0.rate=5", "uavs.1.rate=2", "uavs.2.rate=0.5", UNKNOWN),
        *("sensing.false_alarms=0.3", "sensing.miss_probability=0.1", "uavs.1.mount=body", "uavs.1.tilt_deg=20"),
        "uavs.2.navigation=gnss",
    ],
    "breakdown, losses, paper's tracker": [
        *("duration=8", "sensing.mode=ideal", "uavs.1.fails_at=4.1", "network.fusion=kla", "network.range=30", UNKNOWN),
        *("tracking.management=m_of_n", "tracking.motion=ncv", "network.loss=0.3", "trees.leaf_area_density=0.4"),
    ],
}
TRACKS = [
    *("times", "measurement_offsets", "measurements", "measurement_covariances", "pixels", "bytes_sent"),
    *("track_offsets", "track_ids", "track_means", "track_covariances", "track_existence", "track_sightings", "trees"),
    "believed_cameras",
]


@pytest.fixture(scope="module")
def missions(tmp_path_factory):
    """Recording and folder of a mission by its name; each is flown once."""

    @cache
    def fly(name):
        out = tmp_path_factory.mktemp("mission")
        run_mission(Trial(load_scenario("forest", MISSIONS[name]), "greedy", 0), out / "run", video=False)
        recording = load_recording(out / "run" / "mission.npz")
        export(recording, "csv", out / "csv")
        (out / "csv" / "truth.csv").unlink()
        (out / "csv" / "tracks.csv").unlink()
        return recording, out

    return fly


@pytest.fixture(params=MISSIONS)
def mission(request, missions):
    return missions(request.param)


def test_a_mission_without_its_truth_has_the_same_tracks_byte_for_byte(mission):
    recording, out = mission
    again = track_flight(read_flight(out / "csv")).recording
    assert len(recording.track_ids) > 100
    for name in TRACKS:
        one, other = getattr(recording, name), getattr(again, name)
        assert one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes(), name
    np.testing.assert_array_equal(recording.frames_taken, again.frames_taken)
    assert not again.labelled and again.people.shape == (len(recording.times), 0, 2)
    assert again.setting.tracking == recording.setting.tracking
    assert replay_tracking(again).note == ""


def test_a_mission_in_a_bag_has_the_same_tracks_byte_for_byte(mission, tmp_path):
    pytest.importorskip("rosbags")
    recording, _ = mission
    export(recording, "rosbag", tmp_path / "out", truth=False)
    again = track_flight(read_flight(tmp_path / "out")).recording
    assert not again.labelled
    for name in (name for name in TRACKS if name != "pixels"):  # places on the ground are measured, not pixels
        assert getattr(recording, name).tobytes() == getattr(again, name).tobytes(), name
    for target in ("rosbag", "csv"):  # a flight whose people are unknown, too, which has no images
        export(again, target, tmp_path / target)
        third = track_flight(read_flight(tmp_path / target)).recording
        assert not third.labelled and third.track_means.tobytes() == recording.track_means.tobytes()


WITHOUT_ENGINE = """
import sys

sys.modules["pybullet"] = None  # so that its import fails
import understory
from sim.__main__ import main

understory.track(f"{sys.argv[1]}/csv")
understory.load(f"{sys.argv[1]}/run").table("losses")
for folder in sys.argv[1:]:
    sys.argv = ["understory", "track", f"{folder}/csv", "--out", f"{folder}/tracked"]
    try:
        main()
    except SystemExit as end:
        assert not end.code
"""


def test_flights_are_tracked_and_loaded_where_the_engine_is_missing(missions):
    """In one process, as its imports take as long as a flight."""
    flown = [missions(name) for name in MISSIONS]
    done = python("-c", WITHOUT_ENGINE, *(out for _, out in flown))
    assert done.returncode == 0, done.stderr
    for recording, out in flown:
        again = load_recording(out / "tracked" / "mission.npz")
        assert again.track_means.tobytes() == recording.track_means.tobytes()


def test_exports_hold_the_calibration_that_the_fleet_believes(tmp_path):
    wrong = ("uavs.1.camera=thermal-640", "uavs.1.camera.scale=0.25", "uavs.1.camera.believed.focal=[700, 705]")
    recording = recorded(*wrong, "sensing.mode=ideal", duration=1)
    expected = recording.setting.uavs[1].believed_camera.optics
    assert expected.fx != recording.setting.uavs[1].true_camera.optics.fx
    for name in ("csv", "rosbag"):
        export(recording, name, tmp_path / name)
        found = read_flight(tmp_path / name).setting.uavs[1].true_camera.optics
        assert found.fx == pytest.approx(expected.fx) and found.fy == pytest.approx(expected.fy), name
