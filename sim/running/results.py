"""One mission and its folder: recording, summary, video, page, OSPA curve and timeline."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from planning.planner_loading import load_planner
from sim.facts.flight import Flight
from sim.facts.metrics.catalogue import find_metric
from sim.facts.metrics.summary import format_planner_title
from sim.mission.atomic_files import make_new_folder
from sim.mission.mission import Mission
from sim.mission.recorder import Recorder
from sim.mission.snapshot import Snapshot
from sim.mission.trial import Progress, Say, ScanProgress, Trial
from sim.mission.warmup import announce_compilation, warm_up
from sim.processes.signals import stop_request
from sim.running.mission_flight import fly_mission, make_recording
from sim.running.result_files import Results, write_results, write_summary
from sim.views.drawing.film import Film, Video


class Stop(Protocol):
    """A request to end a mission after the present scan, such as an event of threads or processes."""

    def is_set(self) -> bool:
        """True if the mission should end."""


def run_mission(
    trial: Trial,
    out: Path,
    *,
    video: bool = True,
    metrics: Sequence[str] = (),
    progress: Progress = lambda moment: None,
    say: Say = lambda text: None,
) -> dict[str, Any]:
    """Fly a mission, leave its results in the new folder `out`, and return the summary.

    video: False for neither film nor page. metrics: import strings of plug-in metrics for the summary. `progress` is
    called for each function that is compiled and at each scan, and `say` with messages about compilation.

    The folder appears when it is complete. Ctrl-C in flight ends the mission after the present scan; the scans flown so
    far are kept and marked as interrupted. A second Ctrl-C, or one before take-off, is a KeyboardInterrupt and leaves
    nothing. InputError if the input is wrong.
    """
    with make_new_folder(out) as folder:
        results = Results(folder, out, video, metrics)
        return fly_into(results, trial, stopping=stop_request, progress=progress, say=say)


def fly_into(
    results: Results,
    trial: Trial,
    *,
    stopping: Callable[[], AbstractContextManager[Stop]],
    progress: Progress,
    say: Say,
) -> dict[str, Any]:
    """Fly a mission like `run_mission`, into a folder that exists.

    stopping: a context from take-off until all files are written; its value says when the mission should end.
    """
    _check_plug_ins(trial, results.metrics)
    film = results.folder / "mission.mp4" if results.video else None
    with ExitStack() as from_take_off:

        @contextmanager
        def watching(mission: Mission) -> Iterator[Callable[[Snapshot], bool]]:
            stop = from_take_off.enter_context(stopping())
            with _open_film(trial, mission, film) as add:

                def watch(snapshot: Snapshot) -> bool:
                    add(snapshot)
                    progress(ScanProgress(snapshot.time, snapshot.ospa[snapshot.working, 0].tolist()))
                    return not stop.is_set()

                yield watch

        outcome = fly_mission(trial, watching, announce_compilation(say, progress)(warm_up))
        start = time.perf_counter()
        write_results(results, Flight(outcome.recording))
        spent = time.perf_counter() - start
        outcome = replace(outcome, seconds={**outcome.seconds, "page": spent}, wall_s=outcome.wall_s + spent)
        return write_summary(results, outcome, say)


def _check_plug_ins(trial: Trial, metrics: Sequence[str]) -> None:
    """InputError if a plug-in cannot be imported or made, before anything is compiled."""
    for registry, name in trial.scenario.plugins:
        if name not in registry.built_in:
            registry.find(name)
    load_planner(trial.planner)
    for name in metrics:
        find_metric(name)


@contextmanager
def _open_film(trial: Trial, mission: Mission, path: Path | None) -> Iterator[Callable[[Snapshot], None]]:
    """Yield a function that adds snapshots to the film at `path`, if any; its time counts as that of the video."""
    if path is None:
        yield lambda snapshot: None
        return
    title = format_planner_title(trial.planner, mission.sees_truth)
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


def record(mission: Mission, snapshots: Iterable[Snapshot], planner: str = "from outside") -> Flight:
    """A mission flown by `Mission.step`, with tables and figures; marked as interrupted if it was not flown to the end.

    snapshots: all snapshots that its steps returned, in order. planner: a name to show for the planner.
    """
    recorder = Recorder(mission.repeat)
    for snapshot in snapshots:
        recorder.add(snapshot)
    return Flight(make_recording(mission, recorder, planner))
