"""Scenes of a recorded mission for the Rerun viewer, in a file or in the viewer itself."""

import errno
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from sim.facts.flight import Flight
from sim.facts.metrics.fleet_facts import average_ospa
from sim.facts.metrics.summary import format_recording_title
from sim.facts.rerender import Rerenderer
from sim.mission.atomic_files import write_whole
from sim.mission.recording import Recording
from sim.views.palette import DETECTION, FAINT, PANEL, TRUNK, Colour, lighten, uav_colour
from sim.views.scene import Scene, UavMark, list_unseen_ground, make_scenes, mark_trees, outline_ellipse
from tracking.errors import InputError, one_line
from tracking.geometry.person import PERSON_SIZE, TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Image

_SEE_THROUGH = 150  # opacity of canopies, of 255


def write(flight: Flight, path: Path, *, progress: Callable[[int], None]) -> None:
    """Write the file, completely or not at all; `progress` is called with each scan."""
    with write_whole(path) as part:
        stream = rr.RecordingStream("understory")
        stream.save(part)
        try:
            _fill(stream, flight, progress)
            stream.flush()
        except (RuntimeError, ValueError) as error:  # of the writing thread, such as a full disk
            raise OSError(errno.EIO, f"cannot be written: {error}", str(path)) from error
        finally:
            stream.disconnect()  # otherwise the file is closed only with the stream's deletion


def spawn(flight: Flight, *, progress: Callable[[int], None]) -> None:
    """Open the viewer and show the recording in it; InputError if there is no display or no viewer."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("--rerun: spawn needs a display, and there is none; write a file instead: --rerun FILE.rrd")
    viewer = Path(sys.executable).with_name("rerun")
    stream = rr.RecordingStream("understory")
    try:
        rr.spawn(recording=stream, executable_path=str(viewer) if viewer.exists() else None)
    except (RuntimeError, OSError) as error:
        raise InputError(f"--rerun: the viewer does not start: {one_line(error)}; write a file instead") from error
    _fill(stream, flight, progress)
    stream.flush()


def _fill(stream: rr.RecordingStream, flight: Flight, progress: Callable[[int], None]) -> None:
    recording = flight.recording
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(format_recording_title(recording))
    images = [  # into which the viewer projects tracks
        rrb.Spatial2DView(origin=f"world/camera/{i}", contents=["$origin/**", f"world/tracks/{i}"], name=f"UAV {i}")
        for i in range(recording.uav_count)
    ]
    curves = [rrb.TimeSeriesView(origin="ospa", name="OSPA [m]"), rrb.TimeSeriesView(origin="bytes", name="Bytes sent")]
    below = rrb.Horizontal(rrb.Tabs(*curves), rrb.TextLogView(origin="events", name="Events"))
    forest = rrb.Vertical(rrb.Spatial3DView(origin="world", name="Forest"), below, row_shares=[5, 3])
    stream.send_blueprint(rrb.Horizontal(forest, rrb.Grid(*images), column_shares=[3, 1]))
    _log_ground(stream, recording)
    _log_series(stream, recording)
    for event in flight.events:
        stream.set_time("time", duration=event.time)
        stream.log("events", rr.TextLog(f"{event.time:.1f} s: {event.sentence}"))
    with Rerenderer(recording) as again:
        for k, scene in enumerate(make_scenes(recording, flight.people.hold_states)):
            stream.set_time("time", duration=scene.time)
            _log_people(stream, scene)
            for uav in scene.uavs:
                _log_uav(stream, uav)
                if recording.new_maps[k, uav.number]:
                    _log_map(stream, uav, recording.believed_at(k, uav.number))
                if recording.frames_taken[k, uav.number]:
                    _log_frame(stream, uav, again.image(k, uav.number))
            progress(k)


def _log_ground(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log the edge of the area, trees and cameras, which do not change."""
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    half = np.array([recording.setting.area.width, recording.setting.area.height]) / 2
    corners = _lift(half * [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)], 0.0)
    stream.log("world/area", rr.LineStrips3D([corners], colors=[FAINT], radii=0.1), static=True)
    trees = mark_trees(recording.forest)
    x, y, radius, low, high = np.array([tree.solid[1:6] for tree in trees]).reshape(-1, 5).T
    middles = np.column_stack([x, y, (low + high) / 2])
    colours = [(*t.colour, round(_SEE_THROUGH * t.solid.cover)) if t.is_crown else t.colour for t in trees]
    forest = rr.Cylinders3D(lengths=high - low, radii=radius, centers=middles, colors=colours, fill_mode="solid")
    stream.log("world/forest", forest, static=True)
    for i, o in enumerate(uav.true_camera.optics for uav in recording.setting.uavs):
        matrix = [(o.fx, 0.0, o.cx), (0.0, o.fy, o.cy), (0.0, 0.0, 1.0)]
        lens = rr.Pinhole(image_from_camera=matrix, resolution=(o.width, o.height), camera_xyz=rr.ViewCoordinates.RUB)
        stream.log(f"world/camera/{i}", lens, static=True)


def _log_series(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log OSPA and bytes sent of each UAV, and the mean OSPA."""
    series: list[tuple[str, Colour, Array]] = [("ospa/mean", PANEL, average_ospa(recording.errors)[:, 0])]
    series += [(f"ospa/uav{i}", uav_colour(i), own) for i, own in enumerate(recording.errors[:, :, 0].T)]
    series += [(f"bytes/uav{i}", uav_colour(i), own) for i, own in enumerate(recording.bytes_sent.T)]
    for path, colour, values in series:
        stream.log(path, rr.SeriesLines(colors=[colour], names=[path.partition("/")[2]]), static=True)
        indexes = [rr.TimeColumn("time", duration=recording.times)]
        stream.send_columns(path, indexes=indexes, columns=rr.Scalars.columns(scalars=values))


def _log_people(stream: rr.RecordingStream, scene: Scene) -> None:
    places = _lift(np.array([person.place for person in scene.people]).reshape(-1, 2), TARGET_HEIGHT)
    names = [person.title for person in scene.people]
    colours = [person.look.trouble or PANEL for person in scene.people]
    half = [np.divide(PERSON_SIZE, 2)] * len(names)
    people = rr.Ellipsoids3D(centers=places, half_sizes=half, colors=colours, labels=names, fill_mode="solid")
    stream.log("world/people", people)


def _log_uav(stream: rr.RecordingStream, uav: UavMark) -> None:
    """Log a UAV with its camera's pose, intent and tracks; a broken one has neither intent nor tracks."""
    i = uav.number
    ink = lighten(uav.trouble or uav.colour)
    stream.log(f"world/uav/{i}", rr.Points3D([uav.pose.position], radii=0.5, colors=[ink], labels=[uav.name]))
    turn = rr.Quaternion(xyzw=uav.camera.quaternion)
    stream.log(f"world/camera/{i}", rr.Transform3D(translation=uav.camera.position, quaternion=turn))
    paths = [] if uav.intent is None else [_lift(uav.intent, uav.pose.position[2])]
    stream.log(f"world/intents/{i}", rr.LineStrips3D(paths, colors=[uav.colour], radii=0.08))
    rings = [_lift(outline_ellipse(track.mean, track.covariance), TARGET_HEIGHT) for track in uav.tracks]
    colours = [lighten(track.colour) for track in uav.tracks]
    names = [track.name for track in uav.tracks]
    ellipses = rr.LineStrips3D([np.vstack([r, r[:1]]) for r in rings], colors=colours, labels=names, radii=0.08)
    stream.log(f"world/tracks/{i}", ellipses)


def _log_map(stream: rr.RecordingStream, uav: UavMark, believed: Forest) -> None:
    """Log the outlines of the crowns that a UAV has mapped, and the ground that it has not seen."""
    crowns = believed.canopies
    middles = np.column_stack([crowns[:, :2], crowns[:, 3:5].mean(axis=1)])
    outlines = rr.Cylinders3D(
        lengths=crowns[:, 4] - crowns[:, 3], radii=crowns[:, 2], centers=middles, colors=[uav.colour], line_radii=0.08
    )
    stream.log(f"world/maps/{uav.number}/crowns", outlines)
    strips = list_unseen_ground(believed)
    middles, half = (strips[:, :2] + strips[:, 2:]) / 2, (strips[:, 2:] - strips[:, :2]) / 2
    unseen = rr.Boxes3D(centers=_lift(middles, 0.0), half_sizes=_lift(half, 0.01), colors=[(*TRUNK, _SEE_THROUGH // 2)])
    stream.log(f"world/maps/{uav.number}/unseen", unseen)


def _log_frame(stream: rr.RecordingStream, uav: UavMark, image: Image) -> None:
    """Log an image with its detections."""
    root = f"world/camera/{uav.number}"
    stream.log(f"{root}/image", rr.Image(image).compress(jpeg_quality=90))
    found = [mark.pixel for mark in uav.detections if mark.pixel is not None]
    half = [(0.035 * image.shape[1],) * 2] * len(found)
    stream.log(f"{root}/detections", rr.Boxes2D(centers=found, half_sizes=half, colors=[DETECTION]))


def _lift(points: Array, height: float) -> Array:
    """Points (N, 2) m at a height (N, 3) m."""
    return np.column_stack([points, np.full(len(points), height)])
