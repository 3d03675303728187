"""One mission and its folder: recording, summary, video, page, OSPA curve and timeline."""

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from sim.drawing.film import Film, Video
from sim.drawing.plots import save as save_figure
from sim.evaluation.summary import marked, summarise
from sim.mission.mission import Mission
from sim.mission.snapshot import Snapshot
from sim.mission.trial import Progress, Say, ScanProgress, Trial
from sim.mission.warmup import announced, warm_up
from sim.processes.signals import stop_request
from sim.recording.archive import save
from sim.recording.atomic_files import new_folder
from sim.recording.recorder import Recorder
from sim.replay.flight import Flight
from sim.replay.page.page import write_page
from sim.running.flight import flown, recording_of
from sim.running.isolated_run import Results


def run(
    trial: Trial,
    out: Path,
    *,
    video: bool = True,
    progress: Progress = lambda moment: None,
    say: Say = lambda text: None,
) -> dict[str, Any]:
    """Fly a mission, leave its files in the new folder `out`, and return the summary.

    `progress` is called at each scan, and `say` with messages about compilation.

    The folder appears when it is complete. Ctrl-C in flight ends the mission after the present scan; the scans flown so
    far are kept and marked as interrupted. A second Ctrl-C, or one before take-off, is a KeyboardInterrupt and leaves
    nothing. InputError if the input is wrong.
    """
    with new_folder(out) as folder:
        return fly(trial, folder, Results(str(out), video), progress=progress, say=say)


def fly(trial: Trial, folder: Path, results: Results, *, progress: Progress, say: Say) -> dict[str, Any]:
    """Fly a mission like `run`, into an existing folder."""
    film = folder / "mission.mp4" if results.video else None
    with ExitStack() as catching:  # catches Ctrl-C from take-off until all files are written

        @contextmanager
        def watching(mission: Mission) -> Iterator[Callable[[Snapshot], bool]]:
            stop = catching.enter_context(stop_request())
            with _film(trial, mission, film) as add:

                def watch(snapshot: Snapshot) -> bool:
                    add(snapshot)
                    progress(ScanProgress(snapshot.time, snapshot.ospa[snapshot.working, 0].tolist()))
                    return not stop.is_set()

                yield watch

        outcome = flown(trial, watching, announced(say)(warm_up))
        summary = summarise(outcome, results.metrics)
        flight = Flight(outcome.recording)
        write_results(folder, flight, summary)
        if film:
            write_page(flight, folder / "mission.html", video=film, place=results.place)
    return summary


@contextmanager
def _film(trial: Trial, mission: Mission, path: Path | None) -> Iterator[Callable[[Snapshot], None]]:
    """Yield a function that adds snapshots to the film at `path`, if any; its time counts as that of the video."""
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


def record(mission: Mission, snapshots: Iterable[Snapshot], planner: str = "from outside") -> Flight:
    """A mission flown by `Mission.step`, with tables and figures; marked as interrupted if it was not flown to the end.

    snapshots: all snapshots that its steps returned, in order. planner: a name to show for the planner.
    """
    recorder = Recorder(mission.repeat)
    for snapshot in snapshots:
        recorder.add(snapshot)
    return Flight(recording_of(mission, recorder, planner))


def write_results(folder: Path, flight: Flight, summary: dict[str, Any]) -> None:
    """Write the files of a mission except its video."""
    save(flight.recording, folder / "mission.npz")
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    save_figure(flight.ospa_figure(), folder / "ospa.png")
    save_figure(flight.timeline_figure(), folder / "timeline.png")
