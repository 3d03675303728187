"""A folder of results, of a mission or of a flight from elsewhere: recording, summary, film, page and plots."""

import json
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

from planning.planner_loading import load_planner
from sim.facts.flight import Flight
from sim.facts.metrics.catalogue import find_metric
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.summary import format_planner_title, summarise
from sim.mission.archive import save
from sim.mission.atomic_files import make_new_folder
from sim.mission.trial import Progress, Say, ScanProgress, Trial
from sim.mission.warmup import announce_compilation, warm_up
from sim.running.fly import FlyingMission, fly
from sim.views.drawing.film import Film, Video
from sim.views.drawing.plots import save as save_figure
from sim.views.page.page import describe_omission, write_page


@dataclass(frozen=True)
class Results:
    """What a mission leaves in its folder."""

    folder: Path
    final: Path  # name of the folder when it is complete
    video: bool  # False: neither mission.mp4 nor mission.html
    metrics: Sequence[str]  # import strings of plug-in metrics for the summary


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

    The folder appears when it is complete. Ctrl-C in flight ends the mission after the present scan; the scans flown so
    far are kept and marked as interrupted. A second Ctrl-C, or one before take-off, is a KeyboardInterrupt and leaves
    nothing. InputError if the input is wrong.

    Args:
        trial: The mission.
        out: The folder.
        video: False for neither film nor page.
        metrics: Import strings of plug-in metrics for the summary.
        progress: Called for each function that is compiled and at each scan.
        say: Called with messages about compilation, and about what the page leaves out.
    """
    with make_new_folder(out) as folder:
        results = Results(folder, out, video, metrics)
        with take_off(results, trial, progress, say) as flying, stop_request() as stop:
            return fly_into(results, flying, stop.is_set, progress, say)


@contextmanager
def stop_request() -> Iterator[threading.Event]:
    """Yield an event that the first signal sets, so that a mission can stop at the next scan and keep its recording.

    The second signal raises KeyboardInterrupt. Outside of the main thread, signals are handled as before.
    """
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)


def take_off(results: Results, trial: Trial, progress: Progress, say: Say) -> FlyingMission:
    """The mission at its first scan, after compilation; InputError if a plug-in cannot be used, before compilation."""
    for registry, name in trial.scenario.plugins:
        if name not in registry.built_in:
            registry.find(name)
    load_planner(trial.planner)
    for name in results.metrics:
        find_metric(name)
    begun = time.perf_counter()
    with announce_compilation(say, progress):
        warm_up()
    return fly(trial, begun=begun)


def fly_into(
    results: Results, flying: FlyingMission, stops: Callable[[], bool], progress: Progress, say: Say
) -> dict[str, Any]:
    """Fly a mission, up to the scan after which `stops` is True, into a folder that exists; return the summary."""
    mission = flying.mission
    with _open_video(results, flying) as video:
        for snapshot in flying:
            if video:
                with mission.clock.measure("video"):
                    video.add(snapshot, mission.images)
            progress(ScanProgress(snapshot.time, snapshot.ospa[snapshot.working, 0].tolist()))
            if stops():
                say("Interrupted; what was flown is being written. Another Ctrl-C keeps nothing.")
                break
    outcome = flying.land()
    start = time.perf_counter()
    write_results(results, Flight(outcome.recording))
    spent = time.perf_counter() - start
    outcome = replace(outcome, seconds={**outcome.seconds, "page": spent}, wall_s=outcome.wall_s + spent)
    return write_summary(results, outcome, say)


@contextmanager
def _open_video(results: Results, flying: FlyingMission) -> Iterator[Video | None]:
    """The film of a mission, if it has one, which is finished at the end of the block."""
    if not results.video:
        yield None
        return
    trial = flying.trial
    mission = flying.mission
    film = Film(trial.scenario, mission.forest, planner=format_planner_title(trial.planner, mission.sees_truth))
    video = Video(results.folder / "mission.mp4", film, fps=trial.scenario.rates.sensing)
    try:
        yield video
    except BaseException:
        video.discard()
        raise
    with mission.clock.measure("video"):
        video.close()


def write_results(results: Results, flight: Flight) -> None:
    """Write the files of a mission except its film, which is there, and its summary."""
    folder = results.folder
    save(flight.recording, folder / "mission.npz")
    if flight.recording.labelled:
        save_figure(flight.ospa_figure(), folder / "ospa.png")
        save_figure(flight.timeline_figure(), folder / "timeline.png")
    if results.video:
        write_page(flight, folder / "mission.html", video=folder / "mission.mp4", place=str(results.final))


def write_summary(results: Results, outcome: Outcome, say: Say) -> dict[str, Any]:
    """Write the summary and return it; `say` what the page leaves out."""
    summary = summarise(outcome, results.metrics)
    (results.folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    if results.video and (left_out := describe_omission(outcome.recording)):
        say(left_out)
    return summary
