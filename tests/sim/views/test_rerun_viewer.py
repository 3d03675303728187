"""A short mission, written for the Rerun viewer and read back."""

import os

import cv2
import numpy as np
import pytest

rr = pytest.importorskip("rerun")

from helpers.flights import recorded  # noqa: E402
from helpers.rerun_files import tables  # noqa: E402
from rerun.chunk import RrdReader  # noqa: E402

from sim.facts.flight import Flight  # noqa: E402
from sim.facts.rerender import Rerenderer  # noqa: E402
from sim.views import rerun_viewer  # noqa: E402
from tracking.errors import InputError  # noqa: E402

BROKEN_AT = 8  # the scan, of UAV 2
OVERRIDES = ("trees.density=75", "uavs.2.fails_at=1.5", "uavs.1.rate=1", "tracking.initial_tracks=none")


@pytest.fixture(scope="module")
def recording():
    return recorded(*OVERRIDES, seed=2, duration=3)


@pytest.fixture(scope="module")
def entities(recording, tmp_path_factory):
    path, scans = tmp_path_factory.mktemp("rerun") / "a.rrd", []
    rerun_viewer.write(Flight(recording), path, progress=scans.append)
    assert scans == list(range(len(recording.times)))
    assert [file.name for file in path.parent.iterdir()] == ["a.rrd"]
    return tables(RrdReader(path).stream())


def rows(entities, path, component):
    """The rows of an entity that hold a component, by scan."""
    held = [row for row in entities[path] if row.get(component) is not None and "static" not in row]
    return {round(5 * row["time"]): row[component] for row in held}


def test_forest_cameras_uavs_people_and_tracks_are_where_they_were(recording, entities):
    (cylinders,) = entities["/world/forest"]
    np.testing.assert_allclose(
        np.array(cylinders["centers"])[:, :2], np.tile(recording.trees[:, :2], (2, 1)), atol=1e-5
    )
    people = rows(entities, "/world/people", "centers")
    names = rows(entities, "/world/people", "labels")
    assert names[0] == [f"person {m} not found yet" for m in range(4)]
    for k in range(len(recording.times)):
        np.testing.assert_allclose(np.array(people[k])[:, :2], recording.people[k], atol=1e-5)
    for i in range(3):
        (lens,) = (row for row in entities[f"/world/camera/{i}"] if row.get("resolution"))
        assert lens["resolution"] == [[128.0, 128.0]] and lens["static"]
        places, told = rows(entities, f"/world/uav/{i}", "positions"), rows(entities, f"/world/uav/{i}", "labels")
        turns = rows(entities, f"/world/camera/{i}", "quaternion")
        tracks = rows(entities, f"/world/tracks/{i}", "labels")
        intents = rows(entities, f"/world/intents/{i}", "strips")
        for k in range(len(recording.times)):
            works = bool(recording.working[k, i])
            np.testing.assert_allclose(np.ravel(places[k]), recording.poses[k, i, :3], atol=1e-5)
            np.testing.assert_allclose(np.ravel(turns[k]), recording.cameras[k, i, 3:], atol=1e-5)
            numbers = [recording.track_numbers[track.id] for track in recording.tracks_at(k, i)]
            assert [int(name.rstrip("?")) for name in tracks.get(k) or []] == numbers
            assert told[k] == [f"UAV {i}" if works else f"UAV {i}: broken down"] and bool(intents[k]) == works


def test_each_frame_taken_has_its_image_and_detections(recording, entities):
    taken = {i: np.flatnonzero(recording.frames_taken[:, i]).tolist() for i in range(3)}
    assert {i: len(scans) for i, scans in taken.items()} == {0: 16, 1: 4, 2: BROKEN_AT}
    with Rerenderer(recording) as again:
        for i, scans in taken.items():
            images = rows(entities, f"/world/camera/{i}/image", "blob")
            boxes = rows(entities, f"/world/camera/{i}/detections", "centers")
            assert sorted(images) == scans == sorted(boxes)
            for k in scans:
                np.testing.assert_allclose(np.reshape(boxes[k], (-1, 2)), recording.pixels_at(k, i), atol=1e-4)
            shown = cv2.imdecode(np.array(images[scans[-1]][0], dtype=np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
            assert np.abs(shown.astype(int) - again.image(scans[-1], i)).mean() < 8  # of 255, by compression


def test_curves_and_events_are_those_of_the_recording(recording, entities):
    for i in range(3):
        for path, wanted in (("ospa", recording.ospa[:, i, 0]), ("bytes", recording.bytes_sent[:, i])):
            values = rows(entities, f"/{path}/uav{i}", "scalars")
            np.testing.assert_array_equal(np.ravel([values[k] for k in range(16)]), wanted)
    told = sorted((round(row["time"], 6), row["text"][0]) for row in entities["/events"])
    assert told == sorted((round(e.time, 6), f"{e.time:.1f} s: {e.sentence}") for e in Flight(recording).events)


def test_what_fails_or_is_not_written_to_its_end_leaves_nothing(recording, tmp_path, monkeypatch):
    def fail(k):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rerun_viewer.write(Flight(recording), tmp_path / "a.rrd", progress=fail)
    assert list(tmp_path.iterdir()) == []

    def full(stream):
        raise RuntimeError("File-writer thread shut down prematurely")  # what a full disk comes to

    monkeypatch.setattr(rr.RecordingStream, "flush", full)
    with pytest.raises(OSError, match=r"cannot be written.*a\.rrd"):
        rerun_viewer.write(Flight(recording), tmp_path / "a.rrd", progress=lambda k: None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="displays of Linux")
def test_without_a_display_no_viewer_is_started(recording, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=r"needs a display.*--rerun FILE\.rrd"):
        rerun_viewer.spawn(Flight(recording), progress=lambda k: None)
