"""One mission from its parts to its folder: recording, summary, video, page, OSPA curve and timeline."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sim.drawing.plots import ospa_figure
from sim.drawing.plots import save as save_figure
from sim.drawing.video import Film, Video
from sim.evaluation.machine import versions
from sim.evaluation.summary import marked, summarise
from sim.mission.mission import Mission, Trial
from sim.mission.progress import Moment
from sim.mission.snapshot import Snapshot
from sim.mission.warmup import announced, warm_up
from sim.processes.interrupt import stop_request
from sim.recording.archive import save
from sim.recording.atomic_files import new_folder
from sim.recording.recording import Recorder, Recording
from sim.replay.frames.rerender import scenario_of
from sim.replay.history import History
from sim.replay.page.page import write_page
from sim.replay.timeline import timeline_figure
from sim.scenario.scenario import resolved

Progress = Callable[[Moment], None]
Say = Callable[[str], None]


def run(
    trial: Trial,
    out: Path,
    *,
    video: bool = True,
    progress: Progress = lambda moment: None,
    say: Say = lambda text: None,
) -> dict[str, Any]:
    """Fly a mission and leave its files in the new folder `out`; returns the summary.

    `progress` hears of each scan, `say` of code that is compiled first.

    The folder appears when all is in it. Ctrl-C in flight ends the mission after the present scan, and what was flown
    is kept, marked as interrupted; a second one, or one before take-off, is a KeyboardInterrupt and leaves nothing.
    InputError where the input is wrong.
    """
    with new_folder(out) as folder:
        return fly(trial, folder, str(out), video=video, progress=progress, say=say)


def fly(trial: Trial, folder: Path, place: str, *, video: bool, progress: Progress, say: Say) -> dict[str, Any]:
    """As `run`, into a folder that is there; `place` is what it will be called."""
    start = time.perf_counter()
    mission = Mission.of(trial)
    with announced(say):
        warm_up()
    start_up = time.perf_counter() - start
    recorder = Recorder(trial.repeat)
    with stop_request() as stop:
        with _film(trial, mission, folder / "mission.mp4" if video else None) as film:
            for snapshot in mission.fly():
                recorder.add(snapshot)
                film(snapshot)
                distances = snapshot.ospa[snapshot.working, 0].tolist()
                progress(Moment(snapshot.time, len(recorder), distances, snapshot.error))
                if stop.is_set():
                    break
        wall = time.perf_counter() - start
        recording = recorder.recording(
            scenario=resolved(trial.scenario),
            planner=trial.planner,
            seed=trial.seed,
            forest=mission.forest,
            interrupted=len(recorder) < len(trial.scenario.scan_times),
            sees_truth=mission.sees_truth,
        )
        summary = summarise(
            recording,
            seconds={**mission.clock.seconds, "start_up": start_up},
            wall_s=wall,
            faults=mission.faults,
            versions=versions(),
            planning_s=mission.clock.laps["planning"],
        )
        write_results(folder, recording, summary)
        if video:
            shown = folder / "mission.mp4"
            write_page(recording, trial.scenario, folder / "mission.html", video=shown, place=place)
    return summary


@contextmanager
def _film(trial: Trial, mission: Mission, path: Path | None) -> Iterator[Callable[[Snapshot], None]]:
    """Takes snapshots for the film at `path`, if there is to be one, and counts its time as its own."""
    if path is None:
        yield lambda snapshot: None
        return
    title = marked(trial.planner, mission.sees_truth)
    film = Film(trial.scenario, mission.forest, planner=title)
    video = Video(path, film, fps=trial.scenario.rates.sensing)

    def add(snapshot: Snapshot) -> None:
        with mission.clock.measure("video"):
            video.add(snapshot, mission.frames)

    try:
        yield add
    except BaseException:
        video.discard()
        raise
    with mission.clock.measure("video"):
        video.close()


def write_results(folder: Path, recording: Recording, summary: dict[str, Any]) -> None:
    """The files of a mission, its video aside."""
    save(recording, folder / "mission.npz")
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    save_figure(ospa_figure(recording.times, recording.ospa), folder / "ospa.png")
    history = History.of(recording, scenario_of(recording))
    save_figure(timeline_figure(history, recording.ospa), folder / "timeline.png")
