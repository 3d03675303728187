"""Pages of annotated frames: the frame, and a panel with time, field of view, people and tracks."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from sim.facts.metrics.summary import format_recording_title
from sim.facts.rerender import Rerenderer
from sim.facts.sightings import Sighting, tell_pose_error
from sim.facts.words import TextGroup
from sim.mission.atomic_files import make_new_folder
from sim.mission.recording import Recording
from sim.views.drawing.layout import GAP
from sim.views.drawing.lettering import TextStyle, lay_out_groups, write
from sim.views.drawing.tiles import BORDER
from sim.views.frames.annotation import annotate, find_marks
from sim.views.frames.frame_facts import FrameFacts, make_frame_facts
from sim.views.palette import PANEL, PAPER, uav_colour
from sim.views.scene import find_half_axes, looks_down
from tracking.geometry.camera import Camera, Pose
from tracking.numerics.arrays import Image

_WIDTH = 340  # pixels, width of the panel
MARK = 36  # pixels, height of a mark in the legend
_TITLE = TextStyle(20, bold=True)
_MOST = 12  # largest number of people or tracks that are listed

_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 6]  # less than half the size of OpenCV's default


def draw_frame_page(rerenderer: Rerenderer, k: int, uav: int, *, size: int) -> Image:
    """The annotated frame of one UAV at scan k, RGB, with its panel; `size` as in `annotate`."""
    recording, scenario = rerenderer.recording, rerenderer.recording.setting
    sight = make_frame_facts(recording, k, uav)
    view, shown = annotate(rerenderer.image(k, uav), sight, size)
    height, width = (edge + 2 * BORDER for edge in view.shape[:2])
    mount = {"gimbal": "camera on a gimbal", "body": "camera fixed to the body"}[scenario.uavs[uav].mount]
    notes = [format_recording_title(recording), f"scan {k} (0 to {len(recording.times) - 1}), {mount}"]
    notes += tell_pose_error(recording, k, uav)
    if recording.frames is not None:
        notes.append("drawn by the map of trees, not the flight's image")
    elif not scenario.sensing.renders:
        notes.append("ideal sensing: this image was not used")
    elif not recording.frames_taken[k, uav]:
        notes.append("the camera took no image at this scan")
    looked = scenario.sensing.renders and recording.frames_taken[k, uav]
    near = [sighting.person for sighting in sight.people if sighting.pixels] if looked else []
    whole = {person: rerenderer.count_whole(k, uav, person) for person in near}
    distance, localisation, cardinality = recording.errors[k, uav]
    if recording.labelled:
        notes += [f"OSPA {distance:.2f} m", f"localisation {localisation:.2f} m, cardinality {cardinality:.2f} m"]
    panel = _draw_panel(sight, notes, whole, shown, height=height)
    page = np.full((panel.shape[0] + 2 * GAP, width + _WIDTH + 3 * GAP, 3), PAPER, dtype=np.uint8)
    page[GAP:-GAP, -GAP - _WIDTH : -GAP] = panel
    framed = page[GAP : GAP + height, GAP : GAP + width]
    framed[:] = uav_colour(uav)
    framed[BORDER:-BORDER, BORDER:-BORDER] = view
    return page


def encode_png(image: Image) -> bytes:
    """The content of a PNG file of an image (H, W, 3) RGB."""
    done, data = cv2.imencode(".png", image[..., ::-1], _PNG)
    assert done
    return data.tobytes()


def write_frames(
    recording: Recording, scans: list[int], uav: int, out: Path, *, size: int, progress: Callable[[int], None]
) -> None:
    """Write a UAV's annotated frames as PNG files into the new folder `out`, all or none; `progress` gets each scan."""
    with make_new_folder(out) as folder, Rerenderer(recording) as rerenderer:
        for k in scans:
            name = f"uav{uav}-scan{k:04d}-{recording.times[k]:.1f}s.png"
            (folder / name).write_bytes(encode_png(draw_frame_page(rerenderer, k, uav, size=size)))
            progress(k)


def _describe_view(camera: Camera, pose: Pose) -> list[str]:
    """Numbers of a view: altitude, tilt, edges on the ground, and ground sample distance at the centre."""
    tilt = np.degrees(np.arccos(np.clip(pose.rotation[2, 2], -1.0, 1.0)))
    height = f"altitude {pose.position[2]:.1f} m, {tilt:.1f}° off nadir"
    lines = [_describe_camera(camera), height]
    if not looks_down(camera, pose):
        return [*lines, "reaches the horizon"]
    ground = camera.ground_points(pose, camera.shown(camera.corners))
    edges = np.hypot(*(np.roll(ground, -1, axis=0) - ground).T)
    bottom, right, top, left = (f"{edge:.1f}" for edge in edges)
    if np.ptp(edges) < 0.05:
        lines.append(f"edges {bottom} m on the ground")
    else:
        lines += ["edges on the ground:", f"bottom {bottom}, right {right}, top {top}, left {left} m"]
    centre = np.array(camera.size) / 2 + np.array([[-0.5, 0.0], [0.5, 0.0], [0.0, -0.5], [0.0, 0.5]])
    points = 100 * camera.ground_points(pose, centre)
    across, along = np.hypot(*(points[1] - points[0])), np.hypot(*(points[3] - points[2]))
    return [*lines, f"{across:.1f} × {along:.1f} cm a pixel in the middle"]


def _describe_camera(camera: Camera) -> str:
    width, height = camera.size
    ends = camera.slopes(camera.shown(np.array([[0.0, height / 2], [width, height / 2]])))[:, 0]
    angle = np.degrees(np.subtract(*np.arctan(ends[::-1])))
    size = f"{width} pixels" if width == height else f"{width} × {height} pixels"
    return f"{size}, {angle:.0f}°" + ", bent by its lens" * camera.is_bent


def _draw_panel(sight: FrameFacts, notes: list[str], whole: dict[int, int], shown: set[str], *, height: int) -> Image:
    """The panel (H, 340, 3) RGB of a view, at least `height` pixels high.

    notes: the beginning of its first section; whole: pixels of each person shown in an image, if nothing hid it;
    shown: the names of the marks in its legend.
    """
    lines, bottom = lay_out_groups(_make_sections(sight, notes, whole), _WIDTH - 28, 44.0)
    marks = find_marks(shown)
    image = np.full((max(height, round(bottom) + len(marks) * MARK), _WIDTH, 3), PANEL, dtype=np.uint8)
    write(image, f"{sight.time:.1f} s", (14, 22), _TITLE)
    write(image, f"UAV {sight.uav}", (_WIDTH - 14, 22), _TITLE, align=1.0)
    for text, y, style in lines:
        write(image, text, (14, y), style)
    for k, (text, mark) in enumerate(reversed(marks)):
        middle = image.shape[0] - (k + 0.5) * MARK
        mark(image, np.array([34.0, middle]))
        write(image, text, (72, middle), TextStyle())
    return image


def _make_sections(sight: FrameFacts, notes: list[str], whole: dict[int, int]) -> list[TextGroup]:
    tracks = [
        f"track {track.name}: ± {major:.2f} × {minor:.2f} m"
        for track in sight.tracks
        for minor, major in [find_half_axes(track.covariance)[0].tolist()]
    ]
    return [
        TextGroup("mission", notes),
        TextGroup("field of view", _describe_view(sight.camera, sight.pose)),
        TextGroup("truth", _describe_people(sight, whole)),
        TextGroup("tracks, 95 %", _shorten(tracks)),
    ]


def _describe_people(sight: FrameFacts, whole: dict[int, int]) -> list[str]:
    """Lines about people: those in the view one by one, the others together."""
    near = [sighting for sighting in sight.people if sighting.in_image]
    lines = _shorten([_describe_sighting(sighting, whole.get(sighting.person)) for sighting in near])
    for status in ("out of view", "absent"):
        others = [str(sighting.person) for sighting in sight.people if sighting.status == status]
        lines += [f"{status}: {', '.join(others)}"] if others else []
    return lines


def _describe_sighting(sighting: Sighting, whole: int | None) -> str:
    text = f"person {sighting.person}: {sighting.status}"
    if sighting.looked and sighting.pixels and whole:
        text += f", {sighting.pixels} px, {100 * sighting.pixels / whole:.0f} % visible"
    return text


def _shorten(lines: list[str]) -> list[str]:
    return lines if len(lines) <= _MOST else [*lines[:_MOST], f"and {len(lines) - _MOST} more"]
