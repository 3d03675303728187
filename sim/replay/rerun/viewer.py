"""A recorded mission for the Rerun viewer, as a file or in the viewer itself."""

from __future__ import annotations

import errno
import os
import sys
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import rerun as rr

from sim.evaluation.summary import titled
from sim.recording.atomic_files import whole
from sim.recording.recording import Recording
from sim.replay.events import events_of
from sim.replay.frames.rerender import Rerenderer
from sim.replay.history import History
from sim.replay.rerun.images import Cameras
from sim.replay.rerun.layout import layout
from sim.replay.rerun.scene import Scene, log_ground
from sim.replay.rerun.series import log_events, log_series, log_states
from sim.scenario.errors import InputError
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import content

Progress = Callable[[object], None]


class _Summary(msgspec.Struct):
    planning_s: list[float] = []


def write(
    recording: Recording, scenario: Scenario, path: Path, *, progress: Progress, planning_s: Sequence[float] = ()
) -> None:
    """Write the file, whole or not at all; `progress` is told each scan.

    planning_s: seconds that each decision took, which the recording does not hold; `summary.json` does.
    """
    stream = _stream(recording)
    with whole(path) as part:
        try:
            part.touch()
        except OSError as error:
            raise InputError(f"--rerun: {path} cannot be written: {error.strerror}") from error
        stream.save(part)
        try:
            _fill(stream, recording, scenario, progress, planning_s)
            _flush(stream, path)
        finally:
            stream.disconnect()  # else the file is closed when the stream is forgotten


def _flush(stream: rr.RecordingStream, path: Path) -> None:
    """Wait until all is written; OSError for what the thread that writes met with, such as a full disk."""
    try:
        stream.flush()
    except (RuntimeError, ValueError) as error:
        raise OSError(errno.EIO, f"cannot be written: {error}", str(path)) from error


def spawn(recording: Recording, scenario: Scenario, *, progress: Progress, planning_s: Sequence[float] = ()) -> None:
    """Open the viewer and show the recording in it; InputError where there is no display or no viewer."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("--rerun: spawn needs a display, and there is none; write a file instead: --rerun FILE.rrd")
    stream, viewer = _stream(recording), Path(sys.executable).with_name("rerun")
    try:
        rr.spawn(recording=stream, executable_path=str(viewer) if viewer.exists() else None)
    except (RuntimeError, OSError) as error:
        reason = str(error).strip().splitlines()[0]
        raise InputError(f"--rerun: the viewer does not start: {reason}; write a file instead") from error
    _fill(stream, recording, scenario, progress, planning_s)
    stream.flush()


def planning_times(summary: Path) -> list[float]:
    """Seconds that each decision took, of a run's `summary.json`; none where that is not there or does not say."""
    try:
        return msgspec.json.decode(content(summary, "DIR"), type=_Summary).planning_s
    except (InputError, msgspec.MsgspecError, RecursionError):
        return []


def _stream(recording: Recording) -> rr.RecordingStream:
    """A stream that is the same recording to the viewer whenever the same mission is shown."""
    again = f" {recording.repeat}" if recording.repeat else ""
    mission = f"{recording.planner} {recording.seed}{again} {recording.scenario}"
    return rr.RecordingStream("understory", recording_id=uuid.uuid5(uuid.NAMESPACE_OID, mission))


def _fill(
    stream: rr.RecordingStream,
    recording: Recording,
    scenario: Scenario,
    progress: Progress,
    planning_s: Sequence[float],
) -> None:
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(titled(recording))
    known = len(planning_s) == len(recording.plan_times) > 0
    stream.send_blueprint(layout(recording, scenario, planning=known))
    history = History.of(recording, scenario)
    log_ground(stream, recording, scenario)
    log_series(stream, recording, planning_s if known else ())
    log_states(stream, history)
    log_events(stream, recording, events_of(recording, scenario, history))
    with Rerenderer(recording) as again:
        scene, cameras = Scene(stream, recording, scenario, history.held), Cameras(stream, recording, scenario, again)
        for k, time in enumerate(recording.times.tolist()):
            stream.set_time("time", duration=time)
            stream.set_time("scan", sequence=k)
            scene.log(k)
            cameras.log(k)
            progress(k)
