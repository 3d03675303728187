"""A recorded mission for the Rerun viewer, as a file or in the viewer, and the layout of its views."""

import errno
import os
import sys
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import rerun as rr
import rerun.blueprint as rrb

from sim.facts.flight import Flight
from sim.facts.metrics.summary import format_recording_title
from sim.facts.rerender import Rerenderer
from sim.mission.atomic_files import write_whole
from sim.mission.recording import Recording
from sim.scenario.text_files import read_bytes
from sim.views.rerun.images import Cameras
from sim.views.rerun.scene import Scene, log_ground
from sim.views.rerun.series import log_events, log_series, log_states
from tracking.errors import InputError

Progress = Callable[[object], None]
_CURVES = {
    "OSPA [m]": "plots/ospa",
    "Covariance, trace [m²]": "plots/covariance",
    "UAVs' gap [m]": "plots/agreement",
    "Bytes sent": "plots/bytes",
    "Pixels of people": "plots/visible",
    "Planning [ms]": "plots/planning",
}
_AWAY, _NEAREST = 0.75, 40.0  # distance of the viewer's eye in widths of the area flown, and least distance [m]
_COLUMN = 4  # number of images in a column


class _Summary(msgspec.Struct):
    planning_s: list[float] = []


def write(flight: Flight, path: Path, *, progress: Progress, planning_s: Sequence[float] = ()) -> None:
    """Write the file, completely or not at all; `progress` is called with each scan.

    planning_s: seconds that each decision took, which are in `summary.json` but not in the recording.
    """
    stream = _open_stream(flight.recording)
    with write_whole(path) as part:
        try:
            part.touch()
        except OSError as error:
            raise InputError(f"--rerun: {path} cannot be written: {error.strerror}") from error
        stream.save(part)
        try:
            _fill(stream, flight, progress, planning_s)
            _flush(stream, path)
        finally:
            stream.disconnect()  # otherwise the file is closed only with the stream's deletion


def _flush(stream: rr.RecordingStream, path: Path) -> None:
    """Wait until everything is written; OSError for errors of the writing thread, such as a full disk."""
    try:
        stream.flush()
    except (RuntimeError, ValueError) as error:
        raise OSError(errno.EIO, f"cannot be written: {error}", str(path)) from error


def spawn(flight: Flight, *, progress: Progress, planning_s: Sequence[float] = ()) -> None:
    """Open the viewer and show the recording in it; InputError if there is no display or no viewer."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("--rerun: spawn needs a display, and there is none; write a file instead: --rerun FILE.rrd")
    stream, viewer = _open_stream(flight.recording), Path(sys.executable).with_name("rerun")
    try:
        rr.spawn(recording=stream, executable_path=str(viewer) if viewer.exists() else None)
    except (RuntimeError, OSError) as error:
        reason = str(error).strip().splitlines()[0]
        raise InputError(f"--rerun: the viewer does not start: {reason}; write a file instead") from error
    _fill(stream, flight, progress, planning_s)
    stream.flush()


def read_planning_times(summary: Path) -> list[float]:
    """Seconds that each decision took, from a run's `summary.json`; empty if the file or the entry is missing."""
    try:
        return msgspec.json.decode(read_bytes(summary, "DIR"), type=_Summary).planning_s
    except (InputError, msgspec.MsgspecError, RecursionError):
        return []


def _open_stream(recording: Recording) -> rr.RecordingStream:
    """A stream with an identity by which the viewer recognises the same mission again."""
    again = f" {recording.repeat}" if recording.repeat else ""
    mission = f"{recording.planner} {recording.seed}{again} {recording.scenario}"
    return rr.RecordingStream("understory", recording_id=uuid.uuid5(uuid.NAMESPACE_OID, mission))


def _fill(stream: rr.RecordingStream, flight: Flight, progress: Progress, planning_s: Sequence[float]) -> None:
    recording = flight.recording
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(format_recording_title(recording))
    known = len(planning_s) == len(recording.plan_times) > 0
    stream.send_blueprint(arrange_views(flight, planning=known))
    log_ground(stream, flight)
    log_series(stream, recording, planning_s if known else ())
    log_states(stream, flight)
    log_events(stream, flight.events)
    with Rerenderer(recording) as again:
        scene, cameras = Scene(stream, flight), Cameras(stream, again)
        for k, time in enumerate(recording.times.tolist()):
            stream.set_time("time", duration=time)
            stream.set_time("scan", sequence=k)
            scene.log(k)
            cameras.log(k)
            progress(k)


def arrange_views(flight: Flight, *, planning: bool) -> rrb.Blueprint:
    """The arrangement of all views; planning: True if the times of decisions are known."""
    uavs = range(len(flight.scenario.uavs))
    images = [rrb.Spatial2DView(origin=f"world/camera/{i}", name=f"Camera of UAV {i}") for i in uavs]
    weights = [rrb.TextDocumentView(origin=f"association/{i}", name=f"Weights, UAV {i}") for i in uavs]
    curves = [
        rrb.TimeSeriesView(origin=path, name=name)
        for name, path in _CURVES.items()
        if planning or path != "plots/planning"
    ]
    people = rrb.StateTimelineView(origin="people", name="People")
    events = rrb.TextLogView(
        origin="events",
        name="Events",
        columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
        rows=rrb.TextLogRows(filter_by_log_level=["INFO", "WARN", "ERROR"]),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_arrange_forest(flight), rrb.Horizontal(rrb.Tabs(people, *curves), events), row_shares=[5, 3]),
            rrb.Vertical(
                rrb.Vertical(*images) if len(images) <= _COLUMN else rrb.Grid(*images),
                rrb.Tabs(*weights),
                row_shares=[4, 1],
            ),
            column_shares=[4, 1],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="paused"),
    )


def _arrange_forest(flight: Flight) -> rrb.Spatial3DView:
    """View from the south and above of all places where UAVs have been, without the contents of image planes."""
    places = flight.recording.poses[:, :, :2].reshape(-1, 2)
    low, high = places.min(axis=0), places.max(axis=0)
    (x, y), away = (low + high) / 2, _AWAY * max(*(high - low), _NEAREST)
    hidden = [
        f"- /world/camera/{i}/{name}"
        for i in range(len(flight.scenario.uavs))
        for name in ("detections", "tracks", "association")
    ]
    return rrb.Spatial3DView(
        origin="world",
        name="Forest",
        contents=["+ $origin/**", *hidden],
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=(x, y - away, 0.8 * away), look_target=(x, y, 0), eye_up=(0, 0, 1)),
    )
