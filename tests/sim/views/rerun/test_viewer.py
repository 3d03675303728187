"""A short mission, written for the Rerun viewer and read back: all that must be there is, and is the recording's."""

import dataclasses
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
from sim.facts.tracking_replay import replay_tracking  # noqa: E402
from sim.views.rerun import viewer as rerun_view  # noqa: E402
from sim.views.rerun.scene import find_disagreements  # noqa: E402
from tracking.errors import InputError  # noqa: E402

BROKEN_AT = 8  # the scan, of UAV 2
OVERRIDES = ("trees.density=75", "uavs.2.fails_at=1.5", "uavs.1.rate=1", "network.loss=0.6", "network.rounds=1")


@pytest.fixture(scope="module")
def recording():
    return recorded(*OVERRIDES, seed=2, duration=3)


@pytest.fixture(scope="module")
def written(recording, tmp_path_factory):
    path, scans = tmp_path_factory.mktemp("rerun") / "a.rrd", []
    took = np.linspace(0.01, 0.02, len(recording.plan_times))
    rerun_view.write(Flight(recording), path, progress=scans.append, planning_s=took.tolist())
    assert scans == list(range(len(recording.times)))
    assert [file.name for file in path.parent.iterdir()] == ["a.rrd"]
    return path


@pytest.fixture(scope="module")
def entities(written):
    return tables(RrdReader(written).stream())


def rows(entities, path, component):
    """The rows of an entity that hold a component, by scan."""
    held = [row for row in entities[path] if row.get(component) is not None and "static" not in row]
    return {row["scan"]: row[component] for row in held}


def test_porous_canopies_are_more_transparent(tmp_path, recording):
    density = np.where(np.arange(len(recording.trees)) % 2, np.inf, 0.4)
    porous = dataclasses.replace(recording, trees=np.column_stack([recording.trees, density]))
    rerun_view.write(Flight(porous), tmp_path / "a.rrd", progress=lambda scan: None)
    (canopies,) = tables(RrdReader(tmp_path / "a.rrd").stream())["/world/forest/canopies"]
    opacities = [colour & 255 for colour in canopies["colors"]]
    assert set(opacities[1::2]) == {150} and set(opacities[::2]) == {round(150 * (1 - np.exp(-0.6)))}


def test_forest_lenses_bodies_and_frusta_are_where_they_were_at_every_scan(recording, entities):
    for name in ("canopies", "trunks"):
        (cylinders,) = entities[f"/world/forest/{name}"]
        np.testing.assert_allclose(np.array(cylinders["centers"])[:, :2], recording.trees[:, :2], atol=1e-5)
    for i in range(3):
        (lens,) = (row for row in entities[f"/world/camera/{i}"] if row.get("resolution"))
        assert lens["resolution"] == [[128.0, 128.0]] and lens["static"]
    for kind, poses in (("uav", recording.poses), ("camera", recording.cameras)):
        for i in range(3):
            places = rows(entities, f"/world/{kind}/{i}", "translation")
            turns = rows(entities, f"/world/{kind}/{i}", "quaternion")
            for k in range(len(recording.times)):
                np.testing.assert_allclose(np.ravel(places[k]), poses[k, i, :3], atol=1e-5)
                np.testing.assert_allclose(np.ravel(turns[k]), poses[k, i, 3:], atol=1e-5)
    people = rows(entities, "/world/people", "translations")
    assert len(people) == len(recording.times)
    np.testing.assert_allclose(np.array(people[7])[:, :2], recording.people[7], atol=1e-5)


def test_each_frame_taken_has_its_image_and_marks(recording, entities):
    scenario = recording.setting
    taken = {i: [k for k in range(16) if recording.working[k, i] and scenario.has_frame(i, k)] for i in range(3)}
    assert {i: len(scans) for i, scans in taken.items()} == {0: 16, 1: 4, 2: BROKEN_AT}
    with Rerenderer(recording) as again:
        for i, scans in taken.items():
            images = rows(entities, f"/world/camera/{i}/image", "blob")
            assert sorted(images) == [*scans, *([BROKEN_AT] if i == 2 else [])]  # at the end, what stands for one
            for k in scans[::3]:
                content = np.array(images[k][0], dtype=np.uint8)
                shown = cv2.cvtColor(cv2.imdecode(content, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
                assert np.abs(shown.astype(int) - again.image(k, i)).mean() < 8  # of 255, by compression
            found, marked = (rows(entities, f"/world/camera/{i}/{n}", "labels") for n in ("association", "tracks"))
            boxes = rows(entities, f"/world/camera/{i}/detections", "centers")
            assert set(scans) <= set(marked) and set(scans) <= set(boxes) and set(scans) <= set(found)
            for k in scans:
                np.testing.assert_allclose(np.reshape(boxes[k], (-1, 2)), recording.pixels_at(k, i), atol=1e-4)


def test_weights_are_those_of_the_association(recording, entities):
    lines = 0
    for k in range(BROKEN_AT):
        told = replay_tracking(recording).association(k, 2)
        numbers = recording.numbers_of(told.ids)
        (text,) = rows(entities, "/association/2", "text")[k]
        for number, missed in zip(numbers, told.after.missed, strict=True):
            assert f"| {number} | {missed:.2f} |" in text
        labels = rows(entities, "/world/camera/2/association", "labels")[k]
        assert all(any(label == f"{n}: {w:.2f}" for n, b in zip(numbers, told.weights(), strict=True) for w in b)
                   for label in labels)  # fmt: skip
        lines += len(labels)
    assert lines > 5


def test_beliefs_and_intents_are_drawn(recording, entities):
    numbers = recording.track_numbers
    for i in range(3):
        drawn = rows(entities, f"/world/tracks/{i}/ellipses", "labels")
        for k in np.flatnonzero(recording.working[:, i]).tolist():
            assert drawn[k] == [f"track {numbers[t.id]}" for t in recording.tracks_at(k, i)]
        intents = rows(entities, f"/world/intents/{i}", "strips")
        np.testing.assert_allclose(intents[5][0][0], recording.poses[5, i, :3], atol=1e-5)
    apart = rows(entities, "/world/agreement", "labels")
    for k in range(16):
        assert len(apart[k]) == len(find_disagreements(recording, k))
    assert max(pair.metres for k in range(16) for pair in find_disagreements(recording, k)) > 0.01


def test_curves_have_a_value_at_every_scan(recording, entities):
    curves = [path for path in entities if path.startswith("/plots/")]
    kinds = {path.split("/")[2] for path in curves}
    assert kinds == {"ospa", "covariance", "agreement", "bytes", "visible", "planning"}
    for path in curves:
        values = rows(entities, path, "scalars")
        assert sorted(values) == (list(range(0, 16, 5)) if path == "/plots/planning" else list(range(16)))
    for i in range(3):
        ospa, sent = (rows(entities, f"/plots/{p}/uav{i}", "scalars") for p in ("ospa", "bytes/tracks"))
        np.testing.assert_array_equal(np.ravel([ospa[k] for k in range(16)]), recording.ospa[:, i, 0])
        np.testing.assert_array_equal(np.ravel([sent[k] for k in range(16)]), recording.bytes_sent[:, i])
    seen = rows(entities, "/plots/visible/person1", "scalars")
    np.testing.assert_array_equal(np.ravel([seen[k] for k in range(16)]), recording.visible[:, :, 1].sum(axis=1))
    np.testing.assert_allclose(rows(entities, "/plots/planning", "scalars")[15], [20.0])


def test_people_not_found_yet_and_uavs_that_break_down_early_are_shown_as_such(tmp_path):
    broken = ("uavs.0.fails_at=0.5", "uavs.1.fails_at=0")
    recording = recorded("tracking.initial_tracks=none", *broken, duration=1)
    rerun_view.write(Flight(recording), tmp_path / "a.rrd", progress=lambda k: None)
    entities = tables(RrdReader(tmp_path / "a.rrd").stream())
    names = rows(entities, "/world/people/lost", "labels")[0]
    assert names == [f"person {m} not found yet" for m in range(4)]
    assert [sorted(rows(entities, f"/world/camera/{i}/image", "blob"))[-1] for i in (0, 1)] == [3, 0]
    assert [sorted(rows(entities, f"/association/{i}", "is_recursive")) for i in (0, 1)] == [[3], [0]]
    shown = [rows(entities, f"/world/tracks/{i}/means", "show_labels") for i in (0, 2)]
    assert [shown[0][k] for k in range(3)] == 3 * [[True]]
    assert [shown[1][k] for k in range(6)] == 3 * [[False]] + 3 * [[True]]


def test_events_are_logged_at_their_times_and_it_opens_well_laid_out(recording, entities, written):
    told = sorted((round(row["time"], 6), row["text"][0]) for row in entities["/events"])
    events = Flight(recording).events
    assert told == sorted((round(e.time, 6), f"{e.time:.1f} s: {e.sentence}") for e in events)
    assert {e.kind for e in events} >= {"track born", "breakdown", "messages lost"}
    assert entities["/people/0/tracks"]
    reader = RrdReader(written)
    (blueprint,) = reader.blueprints()
    views = [row["class_identifier"][0] for table in tables(reader.stream(store=blueprint)).values()
             for row in table if row.get("class_identifier")]  # fmt: skip
    counts = {kind: views.count(kind) for kind in views}
    assert counts == {"3D": 1, "2D": 3, "TimeSeries": 6, "StateTimeline": 1, "TextLog": 1, "TextDocument": 3}
    (only,) = reader.recordings()
    assert only.application_id == "understory"


def test_what_fails_or_is_not_written_to_its_end_leaves_nothing(recording, tmp_path, monkeypatch):
    def fail(k):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rerun_view.write(Flight(recording), tmp_path / "a.rrd", progress=fail)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match=r"--rerun: .*nowhere.*: No such file"):
        rerun_view.write(Flight(recording), tmp_path / "nowhere" / "a.rrd", progress=fail)

    def full(stream):
        raise RuntimeError("File-writer thread shut down prematurely")  # what a full disk comes to

    monkeypatch.setattr(rr.RecordingStream, "flush", full)
    with pytest.raises(OSError, match=r"cannot be written.*a\.rrd"):
        rerun_view.write(Flight(recording), tmp_path / "a.rrd", progress=lambda k: None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="displays of Linux")
def test_without_a_display_no_viewer_is_started(recording, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=r"needs a display.*--rerun FILE\.rrd"):
        rerun_view.spawn(Flight(recording), progress=lambda k: None)
