"""Sequences of MOTChallenge with their oddities, and the metrics on them, which are those of py-motmetrics."""

import re
import shutil

import numpy as np
import pytest

from sim.exchange.export import export
from sim.exchange.mot import read_sequence
from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight
from sim.facts.metrics.score import find_reported_tracks
from sim.mission.archive import load_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT

SETTINGS = ["duration=10", "sensing.mode=ideal", "trees.density=75", "tracking.initial_tracks=none"]
INFO = "[Sequence]\nname=walk\nframeRate=25\nseqLength=5\nimWidth=1920\nimHeight=1080\n"


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A mission as sequences of MOTChallenge, whose gt.txt has the usual oddities."""
    out = tmp_path_factory.mktemp("mot")
    run_mission(Trial(load_scenario("forest", SETTINGS), "greedy", 1), out / "run", video=False)
    recording = load_recording(out / "run" / "mission.npz")
    export(recording, "mot", out / "flight")
    export(recording, "csv", out / "csv")
    for name in ("poses.csv", "cameras.csv", "trees.csv", "scenario.toml"):
        shutil.copy(out / "csv" / name, out / "flight" / name)
    for uav in range(3):
        gt = out / "flight" / f"uav{uav}" / "gt" / "gt.txt"
        rows = [line.split(",") for line in gt.read_text().splitlines()]
        # Person 2 returns twice, person 3 is there for single frames, and person 4 is not to be considered at times.
        rows = [r for r in rows if not (r[1] == "2" and 12 <= int(r[0]) <= 20) and not (r[1] == "3" and int(r[0]) % 2)]
        for row in rows:
            row[6] = "0" if row[1] == "4" and 30 <= int(row[0]) <= 33 else row[6]
        gt.write_bytes("\r\n".join(map(",".join, rows[::-1])).encode() + b"\r\n\r\n")
        det = out / "flight" / f"uav{uav}" / "det" / "det.txt"
        rows = [line.split(",") for line in det.read_text().splitlines()]
        rows = [[*r[:6], "-1", *r[7:]] for r in rows if int(r[0]) % 7]  # gaps, and confidences that are not given
        det.write_bytes("\r\n".join(map(",".join, rows)).encode())
    return out / "flight"


def test_people_are_where_and_when_the_file_has_them(flight):
    people = track_flight(read_flight(flight)).recording.people
    rows = np.loadtxt(flight / "uav0" / "gt" / "gt.txt", delimiter=",")
    rows = rows[rows[:, 6] > 0]
    ids = dict.fromkeys(rows[np.argsort(rows[:, 0], kind="stable"), 1])  # in order of appearance
    expected = np.full((51, len(ids), 2), np.nan)
    for frame, id_, *_, x, y, _ in rows:
        expected[int(frame) - 1, list(ids).index(id_)] = x, y
    np.testing.assert_array_equal(people, expected)


def test_a_part_of_a_flight_is_tracked_alone(flight):
    whole, part = (read_flight(flight, overrides=overrides) for overrides in ((), ("duration=4",)))
    assert len(part.frames) == 21 and len(whole.frames) == 51
    np.testing.assert_array_equal(part.people.positions, whole.people.positions[:21])


def test_metrics_on_a_file_are_those_of_py_motmetrics(flight):
    mm = pytest.importorskip("motmetrics")
    outcome = track_flight(read_flight(flight))
    recording, switches, fragmentations = outcome.recording, 0, 0
    for i, score in enumerate(outcome.scores):
        held, reference = find_reported_tracks(recording, i), mm.MOTAccumulator(auto_id=True)
        for k, people in enumerate(recording.people):
            present, reported = ~np.isnan(people[:, 0]), ~np.isnan(held.means[k, :, 0])
            gaps = np.linalg.norm(people[present, None] - held.means[k][reported][None, :, :2], axis=2)
            gaps[gaps > recording.setting.loss_distance] = np.nan
            reference.update(np.flatnonzero(present), held.ids[reported], gaps)
        names = ["num_switches", "num_fragmentations", "num_misses", "num_objects", "num_false_positives"]
        found = mm.metrics.create().compute(reference, metrics=names).iloc[0].to_dict()
        assert score.switches == found["num_switches"]
        assert score.fragmentations == found["num_fragmentations"]
        assert score.present.sum() == found["num_objects"]
        assert (score.present & ~score.held).sum() == found["num_misses"]
        reported = (~np.isnan(held.means[:, :, 0])).sum()
        assert reported - score.held.sum() == found["num_false_positives"]
        switches, fragmentations = switches + score.switches, fragmentations + score.fragmentations
    assert fragmentations > 5


def walk(folder, **files):
    """A sequence in a folder, with files by name."""
    for name, text in {"info": INFO, "det": "", **files}.items():
        place = folder / ("seqinfo.ini" if name == "info" else f"{name}/{name}.txt")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
    return folder


def test_boxes_in_wide_images_become_places_on_the_ground(tmp_path):
    camera, pose = Camera(np.radians(40), 1080), Pose.level(0.0, 0.0, 30.0)
    place = np.array([[3.0, -5.0]])
    u, v = camera.project(pose, np.column_stack([place, [[TARGET_HEIGHT]]]))[0][0]
    box = f"{u + 420 - 10 + 1},{v - 30 + 1},20,60"  # the first pixel is 1, and the square begins at column 420
    beside = "2,3,1,500,20,60,1"  # the camera's square, which is the middle of the wide image
    walk(tmp_path, det=f"2,-1,{box},-1\n{beside}\n", gt=f"2,7,{box},1,1,0.9\n3,8,{box},1,7,0.9\n3,9,{box},0,1,1\n")
    (tmp_path / "poses.csv").write_text("time_s,x_m,y_m,z_m\n0,0,0,30\n1,0,0,30\n")
    (tmp_path / "cameras.csv").write_text("fov_deg,pixels\n40,1080\n")
    log = read_flight(tmp_path)
    assert log.setting.rates.sensing == 25 and log.frames.sum() == 5
    there = camera.ground_points(pose, np.array([[10.0 - 420.0, 529.0]]), TARGET_HEIGHT)
    np.testing.assert_allclose(log.observed[1, 0].scan.measurements, np.vstack([place, there]), atol=1e-9)
    assert [len(log.observed[k, 0].scan.measurements) for k in range(5)] == [0, 2, 0, 0, 0]
    np.testing.assert_allclose(log.people.positions[1], place, atol=1e-9)
    assert np.isnan(log.people.positions[[0, 2, 3, 4]]).all() and log.people.positions.shape == (5, 1, 2)
    (tmp_path / "cameras.csv").write_text("fov_deg,pixels\n40,128\n")
    with pytest.raises(InputError, match=r"images have 1920 × 1080 pixels, but the camera in .* has 128; give it 1080"):
        read_flight(tmp_path)


def test_rows_after_the_last_frame_are_left_out_with_a_remark(tmp_path):
    det, gt = ("".join(f"{k},{n},3.5,4,20,60,1\n" for k in (4, 5, *late)) for n, late in ((1, (6, 6, 9)), (2, (7,))))
    found = read_sequence(walk(tmp_path / "late", det=det, gt=gt))
    assert [len(frame.detections) for frame in found.frames] == [0, 0, 0, 1, 1]
    assert [frame.time for frame in found.people] == [3 / 25, 4 / 25]
    (remark,) = found.remarks
    assert remark.endswith(
        "seqinfo.ini: left out: rows after frame 5, which is seqLength: 3 of det.txt and 1 of gt.txt"
    )
    only_people = read_sequence(walk(tmp_path / "gt", det="5,1,3.5,4,20,60,1\n", gt=gt))
    assert only_people.remarks[0].endswith("which is seqLength: 1 of gt.txt") and len(only_people.frames) == 5
    assert not read_sequence(walk(tmp_path / "in", det="5,1,3.5,4,20,60,1\n")).remarks
    for info in (INFO.replace("seqLength=5\n", ""), INFO.replace("seqLength=5", "seqLength=0")):
        every = read_sequence(walk(tmp_path / "all", info=info, det=det, gt=gt))
        assert len(every.frames) == 9 and not every.remarks


@pytest.mark.parametrize(
    ("files", "complaint"),
    [
        ({"det": "0,1,1,1,5,5,1\n"}, "line 1, column frame: 0 is not allowed; frames count from 1"),
        ({"det": "1,1,1,1,-1,-1,1\n"}, "line 1, column width: a box of -1 × -1 pixels is none, and there is no place"),
        ({"gt": "1,1,1,1,5,5,1\n1,1,1,1,5,5,1\n"}, "line 2, column id: 1 has another row of this frame in line 1"),
        ({"det": "1e9,1,1,1,5,5,1\n"}, "frame: 1000000000 is not allowed; frames count from 1"),
        ({"info": INFO.replace("1080", "high")}, "seqinfo.ini: imheight is no number from 0 to"),
        (
            {"det": "6,1,1,1,5,5,1\n8,1,1,1,5,5,1\n"},
            "frame 5, which is seqLength: 2 of det.txt; so no detection is left",
        ),
        ({"info": "[Sequence]\nseqLength=5\n"}, "seqinfo.ini: frameRate is missing"),
    ],
)
def test_a_sequence_that_cannot_be_is_refused_in_one_line(tmp_path, files, complaint):
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_sequence(walk(tmp_path, **files))
    assert "\n" not in str(told.value)
