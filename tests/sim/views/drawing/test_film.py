"""The video plays in browsers, shows things where they are, and is there whole or not at all."""

import dataclasses
import os

import av
import numpy as np
import pytest
from helpers import synthetic
from helpers.films import decoded
from msgspec import structs

from sim.facts.metrics.holding import HOLDS
from sim.views.drawing.film import HEIGHT, WIDTH, Film, Video
from sim.views.drawing.layout import Box, arrange_parts
from sim.views.drawing.map_view import MapView
from sim.views.palette import (
    FAINT,
    INK,
    LOST,
    NOT_FOUND_YET,
    PANEL,
    track_colour,
    uav_colour,
)
from sim.views.scene import MARGIN, SceneMaker
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest
from tracking.track import Track

OPEN, ALONE = Forest(()), synthetic.scenario(uavs=1)
SCALE = 540 / (100 + 2 * MARGIN)  # pixels a metre
RINGS = {"lost": LOST, "not found yet": NOT_FOUND_YET}


@pytest.fixture(scope="module")
def mission():
    setting = synthetic.scenario()
    trees = synthetic.forest(setting)
    return setting, trees, list(synthetic.snapshots(setting, trees, 8))


def write_video(path, mission, frames=8):
    setting, trees, snapshots = mission
    with Video(path, Film(setting, trees, planner="hover"), fps=5) as video:
        for snapshot in snapshots[:frames]:
            video.add(snapshot, synthetic.frames(setting, trees, snapshot))


def empty(uavs=3, **changes):
    """A snapshot with UAVs and nothing else."""
    first = next(synthetic.snapshots(synthetic.scenario(uavs, people=0), OPEN, 1))
    changes |= {"matched": changes["visible"] > 0} if "visible" in changes else {}
    return dataclasses.replace(first, plans=None, **changes)


def drawn(mission, snapshot, frames=None):
    """A snapshot as the first picture of a film."""
    setting, trees, _ = mission
    return Film(setting, trees, planner="hover").draw(snapshot, frames)


def changed_near(image, before, x, y, reach):
    """True if something changed, and only within `reach` pixels of (x, y)."""
    rows, columns = np.nonzero(np.any(image != before, axis=2))
    assert len(rows) > 0
    return max(abs(rows + 0.5 - y).max(), abs(columns + 0.5 - x).max()) <= reach


def test_the_file_is_h264_in_real_time_with_its_index_first(tmp_path, mission):
    write_video(tmp_path / "mission.mp4", mission)
    with av.open(str(tmp_path / "mission.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert stream.codec_context.colorspace == 6  # BT.601, as OpenCV converts; browsers would take BT.709
        assert (stream.width, stream.height) == (WIDTH, HEIGHT) == (1280, 720)
        assert float(stream.duration * stream.time_base) == pytest.approx(8 / 5)
        times = [float(frame.pts * frame.time_base) for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(8) / 5)
    content = (tmp_path / "mission.mp4").read_bytes()
    assert 0 < content.index(b"moov") < content.index(b"mdat")


def test_decoded_pictures_are_the_drawn_ones_also_of_a_video_closed_early(tmp_path, mission):
    setting, trees, snapshots = mission
    write_video(tmp_path / "mission.mp4", mission)
    film = Film(setting, trees, planner="hover")
    for snapshot, shown in zip(snapshots, decoded(tmp_path / "mission.mp4")[0], strict=True):
        image = film.draw(snapshot, synthetic.frames(setting, trees, snapshot))
        assert np.abs(shown.astype(float) - image).mean() < 3.0
        # The orange border of UAV 1, and what the other usual matrix would make of it.
        border = np.median(shown[300:440, -13:-10].reshape(-1, 3), axis=0)
        assert np.linalg.norm(border - uav_colour(1)) < 10 < np.linalg.norm(border - (238, 149, 0))
    write_video(tmp_path / "mission.mp4", mission, frames=1)
    assert [frame.shape for frame in decoded(tmp_path / "mission.mp4")[0]] == [(720, 1280, 3)]
    assert os.listdir(tmp_path) == ["mission.mp4"]


def test_frames_people_and_views_that_are_missing_are_not_drawn(mission):
    blank, first = drawn(mission, empty()), mission[2][0]
    assert sum(map(len, first.pixels)) > 0 and np.any(drawn(mission, first)[:, -200:] != blank[:, -200:])
    absent = empty(people=np.full((2, 2), np.nan), headings=np.zeros(2), visible=np.zeros((3, 2), int))
    np.testing.assert_array_equal(drawn(mission, absent), blank)
    tilted = [Pose(np.array([0.0, 0.0, 20.0]), np.array([np.sin(0.5), 0.0, 0.0, np.cos(0.5)]))] * 3
    assert drawn(mission, dataclasses.replace(first, cameras=tilted, poses=tilted)).shape == (HEIGHT, WIDTH, 3)


def one_uav(above=(500.0, 500.0), **changes):
    """A snapshot of a UAV above a place and of nothing else."""
    pose = Pose.level(*above, 17.32)
    return empty(1, poses=[pose], cameras=[pose], **changes)


def mapped(snapshot, holds=None, forest=OPEN, size=(790, 540)):
    view = MapView(ALONE, forest, size)
    assert view.scale == pytest.approx(SCALE * size[1] / 540)
    holds = np.full(len(snapshot.people), HOLDS.index("held")) if holds is None else holds
    return view.draw(SceneMaker(ALONE).add(snapshot, holds))[0]


def pixel(x, y):
    """Column and row of a place."""
    return round(395 + x * SCALE - 0.5), round(270 - y * SCALE - 0.5)


def test_people_tracks_and_uavs_stand_where_they_are():
    before, (x, y) = mapped(one_uav()), pixel(40.0, 20.0)
    image = mapped(one_uav(people=np.array([[40.0, 20.0]]), headings=np.zeros(1), visible=np.ones((1, 1), int)))
    assert changed_near(image, before, 395 + 40 * SCALE, 270 - 20 * SCALE, 12) and image[y, x].max() < 60
    ring = Gaussian(np.array([40.0, 20.0, 0.0, 0.0]), np.diag([4.0, 1.0, 1.0, 1.0]))
    image = mapped(one_uav(tracks=[(Track(1, ring),)]))
    # The ellipse that holds 95 % of a planar Gaussian reaches 2.4477 standard deviations.
    for dx, dy in ((2.4477 * 2.0, 0.0), (0.0, 2.4477)):
        column, row = pixel(40.0 + dx, 20.0 + dy)
        assert np.abs(image[row, column].astype(int) - track_colour(0)).max() < 60
    image = mapped(one_uav((40.0, 20.0)))
    np.testing.assert_array_equal(image[y, x], uav_colour(0))
    edge = image[pixel(40.0, 10.0)[1], x + 20]
    assert np.abs(edge.astype(int) - uav_colour(0)).max() < 60


@pytest.mark.parametrize(
    ("visible", "above", "hold", "colour"),
    [(5, (15.0, 5.0), "held", INK), (0, (15.0, 5.0), "lost", PANEL), (0, (60.0, 5.0), "not found yet", FAINT)],
)
def test_people_are_marked_as_seen_hidden_out_of_view_and_lost(visible, above, hold, colour):
    there = {"people": np.array([[10.0, 5.0]]), "headings": np.zeros(1), "visible": np.array([[visible]])}
    image, (x, y) = mapped(one_uav(above, **there), np.array([HOLDS.index(hold)])), pixel(10.0, 5.0)
    assert np.abs(image[y, x].astype(int) - colour).max() < 60
    ring = image[y - 12 : y + 13, x - 12 : x + 13].reshape(-1, 3)
    assert {name for name, c in RINGS.items() if np.any(np.all(ring == c, axis=1))} == {hold} & set(RINGS)


def test_a_slow_camera_keeps_no_other_cameras_people_in_view():
    slow, fast = synthetic.scenario(uavs=2).uavs
    setting = structs.replace(synthetic.scenario(uavs=2), uavs=(structs.replace(slow, rate=1), fast))
    view, scenes = MapView(setting, OPEN, (790, 540)), SceneMaker(setting)
    there = {"people": np.array([[10.0, 5.0]]), "headings": np.zeros(1)}
    for k, colour in enumerate((INK, FAINT)):
        above = [Pose.level(-60.0, 0.0, 17.32), Pose.level(10.0 + 50 * k, 5.0, 17.32)]
        shown = np.array([[0], [1 - k]])
        snapshot = empty(2, time=0.2 * k, poses=above, cameras=above, visible=shown, **there)
        image, _ = view.draw(scenes.add(snapshot))
        x, y = pixel(10.0, 5.0)
        assert np.abs(image[y, x].astype(int) - colour).max() < 60


@pytest.mark.parametrize("aspect", [0.2, 0.7, 1.46, 3.0, 8.0])
@pytest.mark.parametrize("layout", ["map+cameras", "map", "cameras", "last"])
def test_map_and_tiles_stay_inside_the_panel_and_apart(aspect, layout):
    panel = Box(10, 48, 1260, 632)
    for uavs in range(1, 21):
        view = arrange_parts(panel, aspect, uavs, layout.replace("last", f"uav{uavs - 1}"))
        assert list(view.tiles) == {"map": [], "last": [uavs - 1]}.get(layout, list(range(uavs)))
        assert (view.map is None) == (layout == "cameras")
        taken = np.zeros((720, 1280), dtype=np.int8)
        for box in [*view.tiles.values(), *([] if view.map is None else [view.map])]:
            assert panel.x <= box.x and box.x + box.width <= panel.x + panel.width
            assert panel.y <= box.y and box.y + box.height <= panel.y + panel.height
            taken[box.slices] += 1
        assert taken.max() <= 1
        if layout == "map+cameras":
            assert view.map.width / view.map.height == pytest.approx(aspect, rel=0.02)
            assert all(box.width == box.height >= 80 for box in view.tiles.values())


def test_a_video_appears_when_it_is_closed_and_never_after_an_error(tmp_path, mission):
    setting, trees, snapshots = mission
    film = Film(setting, trees, planner="p")
    with pytest.raises(ZeroDivisionError), Video(tmp_path / "a.mp4", film, fps=5) as video:
        video.add(snapshots[0], None)
        raise ZeroDivisionError
    write_video(tmp_path / "b.mp4", mission, frames=0)
    assert os.listdir(tmp_path) == []
    video = Video(tmp_path / "mission.mp4", film, fps=5)
    video.add(snapshots[0], None)
    assert not (tmp_path / "mission.mp4").exists()
    video.close()
    assert os.listdir(tmp_path) == ["mission.mp4"]
