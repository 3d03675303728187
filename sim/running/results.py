"""A folder of results, of a mission or of a flight from elsewhere: recording, summary, film, page and plots."""

import json
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import FrameType
from typing import Any

from planning.planner_loading import load_planner
from sim.facts.flight import Flight
from sim.facts.metrics.catalogue import find_metric
from sim.facts.metrics.mapping_score import tell_unmapped
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.summary import summarise
from sim.mission.archive import save
from sim.mission.atomic_files import make_new_folder
from sim.mission.trial import Progress, Say, ScanProgress, Trial
from sim.mission.warmup import announce_compilation, warm_up
from sim.processes.companion import Companion
from sim.running.beside import open_pictures, start_painter
from sim.running.fly import FlyingMission, fly
from sim.running.folder import Results


def run_mission(
    trial: Trial,
    out: Path,
    *,
    video: bool = True,
    metrics: Sequence[str] = (),
    progress: Progress = lambda moment: None,
    say: Say = lambda text: None,
    begun: float | None = None,
    painter: Companion | None = None,
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
        begun: Value of `time.perf_counter` from which on time counts, by default now.
        painter: The process that draws pictures, if it runs already.
    """
    start = time.perf_counter() if begun is None else begun
    with make_new_folder(out) as folder, nullcontext(painter) if painter else start_painter() as drawing:
        results = Results(folder.absolute(), out, video, tuple(metrics))
        with take_off(results, trial, start, progress, say) as flying, stop_request() as stop:
            return fly_into(results, flying, drawing, stop.is_set, progress, say)


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


def take_off(results: Results, trial: Trial, begun: float, progress: Progress, say: Say) -> FlyingMission:
    """The mission at its first scan, after compilation; InputError if a plug-in cannot be used, before compilation.

    begun: value of `time.perf_counter` when start-up began.
    """
    for registry, name in trial.scenario.plugins:
        if name not in registry.built_in:
            registry.find(name)
    load_planner(trial.planner)
    for name in results.metrics:
        find_metric(name)
    with announce_compilation(say, progress):
        warm_up(trial.scenario.sensing.renders)
    return fly(trial, begun=begun)


def fly_into(
    results: Results,
    flying: FlyingMission,
    painter: Companion | None,
    stops: Callable[[], bool],
    progress: Progress,
    say: Say,
) -> dict[str, Any]:
    """Fly a mission, up to the scan after which `stops` is True, into a folder that exists; return the summary.

    painter: the process that draws the pictures; None if this one does.
    """
    mission = flying.mission
    with open_pictures(painter, results, flying.heading, say) as pictures:
        for snapshot in flying:
            with mission.clock.measure("video"):
                pictures.add(snapshot, mission.images)
            progress(ScanProgress(snapshot.time, snapshot.ospa[snapshot.working, 0].tolist()))
            if stops():
                say("Interrupted; what was flown is being written. Another Ctrl-C keeps nothing.")
                break
        with mission.clock.measure("video"):
            pictures.end()
        return write_results(results, flying.land(), pictures.draw, say)


def write_results(results: Results, outcome: Outcome, draw: Callable[[Flight], str], say: Say) -> dict[str, Any]:
    """Write recording, pictures and summary of a mission, and return the summary.

    draw: draws the pictures, and returns what the page leaves out, in words.
    """
    start = time.perf_counter()
    save(outcome.recording, results.folder / "mission.npz")
    summary = summarise(outcome, results.metrics)
    left_out = draw(Flight(outcome.recording))
    spent = time.perf_counter() - start
    wall, seconds = outcome.wall_s + spent, {**outcome.seconds, "page": spent}
    summary |= {"wall_s": wall, "seconds": {**seconds, "other": wall - math.fsum(seconds.values())}}
    (results.folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    for line in filter(None, (left_out, tell_unmapped(outcome.recording))):
        say(line)
    return summary
