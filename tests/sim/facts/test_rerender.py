"""Frames rendered again are those flown; what is drawn on them is where it is; wrong input leaves nothing."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from helpers import synthetic
from helpers.flights import PAIR, filmed
from helpers.recordings import record

from sim.facts.flight import find_scans
from sim.facts.rerender import Rerenderer
from sim.mission.archive import save
from sim.views.drawing.tiles import BORDER
from sim.views.frames import frame_panels
from sim.views.frames.annotation import annotate
from sim.views.frames.frame_facts import FrameFacts, make_frame_facts
from sim.views.frames.frame_panels import write_frames
from sim.views.palette import track_colour, uav_colour
from sim.views.scene import mark_track, outline_ellipse
from tracking.errors import InputError
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree
from tracking.track import Track


@pytest.fixture(scope="module")
def mission():
    """A mission, and its images."""
    return filmed(PAIR.format("body"))


def test_where_a_slow_camera_took_no_image_the_truth_is_what_geometry_tells():
    recording, _ = filmed("uavs.0.rate=1", "trees.density=0", duration=2)
    taken, idle = (make_frame_facts(recording, k, 0) for k in (5, 6))
    assert any(p.status == "seen" for p in taken.people)
    assert {p.status for p in idle.people} <= {"in view", "out of view"}
    assert any(p.status == "in view" for p in idle.people)


def northwards(degrees):
    """A pose 10 m up, tilted from looking down towards the north."""
    half = math.radians(degrees) / 2
    return Pose(np.array([0.0, 0.0, 10.0]), np.array([math.sin(half), 0.0, 0.0, math.cos(half)]))


def scene(*, tracks=(), trees=(), pose=None):
    """A sight of one UAV with 20 m on the ground in 128 pixels."""
    setting = synthetic.scenario(uavs=1)
    trees, pose = Forest(tuple(trees)), pose or Pose.level(0.0, 0.0, setting.uavs[0].altitude)
    uav, marks = setting.uavs[0], [mark_track(track, track.id) for track in tracks]
    return FrameFacts(0, 0.0, uav.true_camera, pose, uav.believed_camera, pose, trees, None, (), (), tuple(marks))


def test_a_track_is_drawn_with_its_ellipse_where_the_camera_would_see_it():
    belief = Gaussian(np.array([3.0, -2.0, 0.0, 0.0]), np.diag([1.0, 0.25, 1.0, 1.0]))
    seen = scene(tracks=(Track(2, belief),))
    view, shown = annotate(np.full((128, 128, 3), 90, np.uint8), seen, 1024)
    assert shown == {"track, 95 % ellipse"}
    ring = outline_ellipse(belief.mean[:2], belief.covariance[:2, :2])
    points = np.column_stack([ring, np.full(len(ring), TARGET_HEIGHT)])
    on_it = 8 * seen.camera.project(seen.pose, points)[0]
    right = [tuple(view[y, x].tolist()) == track_colour(2) for x, y in np.floor(on_it).astype(int)]
    assert np.mean(right) > 0.8 and np.ptp(on_it[:, 0]) == pytest.approx(2 * np.ptp(on_it[:, 1]), rel=0.01)


RIM, HIDING = "rim of what trees hide", "tree that hides a person"
FOUND = {"truth: person", "detection", "measurement, 95 % ellipse", "track, 95 % ellipse"}


@pytest.mark.parametrize(
    ("options", "marks"),
    [
        ({}, {RIM, *FOUND}),
        ({"people": 0}, {RIM}),
        ({"mode": "ideal"}, {RIM, *FOUND} - {"detection"}),
        ({"people": 30}, {RIM, HIDING, *FOUND}),
    ],
)
def test_a_page_holds_the_view_with_marks_of_what_is_there_and_of_nothing_else(options, marks):
    recording = record(3, seed=0, **options)
    with Rerenderer(recording) as again:
        page = frame_panels.draw_frame_page(again, 2, 1, size=300)
        frame, sight = again.image(2, 1), make_frame_facts(recording, 2, 1)
    view, shown = annotate(frame, sight, 300)
    assert shown == marks and view.shape == (256, 256, 3)
    row, column = np.argwhere(np.all(page == uav_colour(1), axis=2)).min(axis=0) + BORDER
    np.testing.assert_array_equal(page[row : row + 256, column : column + 256], view)
    plain = np.repeat(np.repeat(frame, 2, axis=0), 2, axis=1)  # 128 pixels, enlarged
    changed = np.any(view != plain, axis=2)
    for person in sight.people:  # a mark around each in the image
        middle = 2.0 * sight.camera.project(sight.pose, np.array([[*person.place, TARGET_HEIGHT]]))[0][0]
        if np.all((middle > 20) & (middle < 236)):
            x, y = middle.astype(int)
            assert person.in_image and changed[y - 14 : y + 15, x - 14 : x + 15].any()
    if "people" in options and not options["people"]:
        bare, _ = annotate(frame, dataclasses.replace(sight, forest=Forest(())), 300)
        assert np.mean(np.any(bare != plain, axis=2)) < 0.05  # a scale bar and an arrow


def test_a_view_of_the_horizon_has_the_rim_of_a_crown_where_the_crown_is():
    """A crown of 5 m radius, 3 to 6 m high and 20 m away, seen from 10 m."""
    seen = scene(trees=[Tree(0.0, 20.0)], pose=northwards(90))
    view, shown = annotate(np.zeros((128, 128, 3), np.uint8), seen, 256)
    assert view.shape == (256, 256, 3) and shown == {RIM}
    assert not view[:128].any()  # the sky
    drawn = view.min(axis=2) > 128  # without the dark border of lines
    drawn[222:, :72] = drawn[190:, 190:] = False  # scale bar and arrow
    rows, columns = np.nonzero(drawn)
    focal = 128 / math.tan(math.radians(30))
    side = focal * math.tan(math.asin(5 / 20))
    assert (columns.min(), columns.max()) == (pytest.approx(128 - side, abs=4), pytest.approx(127 + side, abs=4))
    top, bottom = 128 + focal * (10 - 6) / (20 + 5), 128 + focal * (10 - 3) / (20 - 5)
    assert (rows.min(), rows.max()) == (pytest.approx(top, abs=4), pytest.approx(bottom, abs=4))
    assert not drawn[170:220, 75:180].any()  # within the rim


def test_scans_are_those_in_a_window_and_a_failure_leaves_no_folder(mission, tmp_path, monkeypatch):
    recording, _ = mission
    assert find_scans(recording, 0.0, None) == [0] and find_scans(recording, 1.07, None) == [5]
    assert find_scans(recording, 4.0, None) == [20] and find_scans(recording, 0.6, 1.2) == [3, 4, 5, 6]
    assert find_scans(recording, 3.9, 4.0) == [20]
    with pytest.raises(InputError, match=r"no scan lies between 1.05 and 1.15 s; the nearest are at 1, 1.2 s"):
        find_scans(recording, 1.05, 1.15)
    monkeypatch.setattr(
        frame_panels, "draw_frame_page", lambda rerenderer, k, uav, size: np.zeros((9, 9, 3), np.uint8)[: 9 // (k < 2)]
    )
    with pytest.raises(ZeroDivisionError):
        write_frames(mission[0], [0, 1, 2], 0, tmp_path / "deep" / "out", size=256, progress=lambda k: None)
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_one_picture_a_scan_also_of_ideal_sensing(call, tmp_path):
    (tmp_path / "run").mkdir()
    save(record(mode="ideal", seed=0), tmp_path / "run" / "mission.npz")
    code, out, err = call("frames", "run", "--uav", "1", "--time", "0.4:0.8", "--size", "256")
    assert (code, err) == (0, "")
    names = [f"uav1-scan000{k}-0.{2 * k}s.png" for k in (2, 3, 4)]
    assert sorted(path.name for path in (tmp_path / "run" / "frames-uav1-0.4-0.8s").iterdir()) == names
    assert names[0] in out
    assert call("frames", "run/mission.npz", "--uav", "1", "--time", "0.4:0.8", "--size", "256")[0] == 0
    first, second = (tmp_path / "run" / f"frames-uav1-0.4-0.8s{suffix}" / names[0] for suffix in ("", "-2"))
    assert first.read_bytes() == second.read_bytes() and cv2.imread(str(first)).shape[1] == 256 + 8 + 340 + 30
    assert call("frames", "run", "--uav", "0", "--time", "1", "--out", "deep/new")[0] == 0
    assert [path.name for path in (tmp_path / "deep" / "new").iterdir()] == ["uav0-scan0005-1.0s.png"]
    code, out, err = call("frames", "run", "--uav", "0", "--time", "1", "--out", "deep/new")
    assert (code, out) == (2, "") and err.startswith("understory: --out: deep/new exists")
