"""A flight whose people are unknown: what commands, page, film and tables show, and what they do not."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.films import frames_of

import understory
from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import name_flight, track_flight
from sim.facts.flight import Flight
from sim.facts.metrics.summary import format_recording_title
from sim.facts.sightings import tell_fade
from sim.views.page.data import make_page_data
from sim.views.palette import DETECTION
from sim.views.scene import make_scenes
from tracking.errors import InputError

TREE = "x_m,y_m,canopy_radius_m,canopy_base_m,canopy_top_m,trunk_radius_m"


def write_flight(folder, until=4.0, tree=True):
    """A person walks east below two UAVs: detected until a time, then hidden by a crown, or missed without one."""
    folder.mkdir(exist_ok=True)
    times = np.arange(0, 12, 0.2).round(1).tolist()
    poses = [f"{t},{i},{40 * i},0,30" for t in times for i in (0, 1)]
    found = [f"{t},0,{1.2 * t - 5},0,0.01,0,0.01" if t <= until else f"{t},0,,,,," for t in times]
    files = {
        "poses.csv": ["time_s,uav,x_m,y_m,z_m", *poses],
        "detections.csv": ["time_s,uav,x_m,y_m,xx_m2,xy_m2,yy_m2", *found, *(f"{t},1,,,,," for t in times)],
        "cameras.csv": ["uav,fov_deg,pixels", "0,40,256", "1,40,256"],
        "trees.csv": [TREE, *["5,0,5,3,8,0.2"] * tree],
    }
    for name, lines in files.items():
        (folder / name).write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    out = tmp_path_factory.mktemp("fades")
    return {
        name: track_flight(read_flight(write_flight(out / name, tree=name == "hidden"))).recording
        for name in ("hidden", "missed")
    }


def test_a_track_fades_behind_a_crown_or_in_view_without_a_detection(recordings):
    for name, words in (("missed", "in view in"), ("hidden", "hidden by tree 0 in")):
        recording = recordings[name]
        scans, _ = recording.cells(recording.track_offsets)
        (id_,) = set(recording.track_ids.tolist())
        last = int(scans.max())
        told = tell_fade(recording, id_, last)
        assert re.match(rf"no sure detection since 4\.0 s, for UAV 0 {words} (\d+) of (\d+) frames", told), told
        assert told.endswith("out of view of UAV 1")
        frames = recording.frames_taken[: last + 1, 0] & (recording.times[: last + 1] > 4.0)
        assert f"of {frames.sum()} frames" in told
    missed = np.diff(recordings["missed"].track_offsets).reshape(-1, 2)[:, 0] > 0
    hidden = np.diff(recordings["hidden"].track_offsets).reshape(-1, 2)[:, 0] > 0
    assert 4 < recordings["missed"].times[missed].max() < 5 < recordings["hidden"].times[hidden].max()


def test_nothing_is_compared_with_people_who_are_unknown(recordings):
    flight = Flight(recordings["missed"])
    kinds = [event.kind for event in flight.events]
    assert kinds.count("track deleted") == 1 and not {"false track", "person lost"} & {*kinds}
    (held,) = (event for event in flight.events if event.kind == "track held")
    assert (held.track, held.time) == (0, 0.2) and 4 < held.until < 5
    (deleted,) = (event for event in flight.events if event.kind == "track deleted")
    assert "in view in" in deleted.sentence
    assert "unknown people" in repr(flight) and "OSPA mean –" in repr(flight)
    assert all(len(flight.columns(name)["time_s"]) == 0 for name in ("people", "sightings", "ospa"))
    for figure in (flight.ospa_figure, flight.timeline_figure):
        with pytest.raises(InputError, match="the people of this flight are unknown, so it has no"):
            figure()


def test_the_command_leaves_what_others_read(tmp_path, call):
    write_flight(tmp_path / "walk", tree=False)
    code, out, err = call("track", "walk", "--set", "tracking.survival=0.99")
    assert code == 0 and "1 track in 11.8 s" in out and "each frame of UAV" not in err
    folder = tmp_path / "runs" / "track-walk"
    names = {path.name for path in folder.iterdir()}
    assert names == {"mission.npz", "mission.mp4", "mission.html", "summary.json"}
    assert frames_of(folder / "mission.mp4")[1] == 60
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["scenario"]["tracking"]["survival"] == 0.99
    assert summary["ospa"]["mean_m"] is summary["gospa"]["mean_m"] is summary["tracks"]["false"] is None
    assert summary["network"]["bytes_total"] > 0
    page = (folder / "mission.html").read_text()
    assert "Tracks that faded: 1" in page and "no sure detection since 4.0 s" in page and "OSPA mean" not in page
    told = call("explain", str(folder))[1]
    assert "tracks that faded" in told and "in view in" in told
    assert "track-walk --track 0" in told.replace("\n", "")
    story = call("explain", str(folder), "--track", "0")[1]
    assert "measurements from UAV 0" in story and "false alarm" not in story and "no sure detection since" in story
    code, _, err = call("explain", str(folder), "--target", "0")
    assert code == 2 and "--target: '0' is not allowed; the people of this flight are unknown" in err


def test_a_flight_is_tracked_from_python(tmp_path):
    folder = write_flight(tmp_path / "walk")
    flight = understory.track(folder, settings={"tracking.survival": 0.99, "duration": 5})
    titles = [name_flight(Path(name)) for name in ("walk", "flight", "runs/flight-7")]
    assert titles == ["flight walk", "flight", "flight-7"] and format_recording_title(flight.recording) == titles[0]
    scenes = [*make_scenes(flight.recording, flight.people.hold_states)]
    found = [len(flight.recording.scan_at(k, 0).measurements) for k in range(26)]
    assert (
        [len(scene.detections) for scene in scenes] == found == [*map(len, make_page_data(flight, None)["detections"])]
    )
    picture = flight.map_figure(2.0).axes[0].get_images()[0].get_array()
    assert (picture == DETECTION).all(axis=2).any()
    assert flight.scenario.tracking.survival == 0.99 and len(flight.recording.times) == 26
    assert flight.recording.planner == "flight walk" and len(flight.columns("tracks")["time_s"]) > 20
    with pytest.raises(InputError, match=r"tracking\.sigma: unknown key"):
        understory.track(folder, settings={"tracking": {"sigma": 1}})


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["walk", "--origin", "3"], "--origin: '3' is not allowed; expected two numbers"),
        (["walk", "--set", "tracking.sigma=1"], "tracking.sigma: unknown key"),
    ],
)
def test_wrong_input_is_one_line_and_leaves_nothing(tmp_path, refused, arguments, complaint):
    write_flight(tmp_path / "walk")
    assert complaint in refused("track", *arguments)
