"""A mission in a process of its own, which a plug-in may end, or may hang in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from planning.errors import PlannerError
from sim.mission.progress import ScanProgress
from sim.processes.isolation import IsolationError, run_isolated
from sim.recording.atomic_files import new_folder
from sim.scenario.errors import InputError
from sim.scenario.scenario import Scenario


class Flight(NamedTuple):
    """All that decides how a mission goes, before its planner and detector are loaded."""

    scenario: Scenario
    planner: str
    seed: int
    repeat: int
    video: bool = True
    metrics: tuple[str, ...] = ()  # from outside


def fly_apart(
    flight: Flight,
    out: Path,
    *,
    timeout: float | None,
    progress: Callable[[ScanProgress], None],
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Fly a mission as `run.run` does, in a process of its own.

    IsolationError if it ends otherwise or is not done after `timeout` s.
    """
    last = None

    def hear(told: object) -> None:
        nonlocal last
        if isinstance(told, ScanProgress):
            last = told
            progress(told)
        else:
            say(str(told))

    with new_folder(out) as folder:
        arguments = (flight, folder.absolute(), str(out))
        try:
            # The first moment is told after `stop_request`; before it, SIGINT is ignored there.
            passing = (InputError, PlannerError)
            found = run_isolated(_fly, *arguments, hear=hear, listening=ScanProgress, timeout=timeout, passing=passing)
        except IsolationError as error:
            when = f"at {last.time:.1f} s" if last else "before take-off"
            raise IsolationError(f"the mission ended {when}: {error}; nothing is kept") from error
    summary: dict[str, Any] = found
    return summary


def _fly(flight: Flight, folder: Path, place: str, tell: Callable[[object], None]) -> dict[str, Any]:
    from planning.loading import load_planner
    from sim.sensing.detectors import check_detector

    check_detector(flight.scenario.sensing.detector)
    load_planner(flight.planner)
    from sim.evaluation.metric import metric

    for name in flight.metrics:
        metric(name)
    from sim.mission.mission import Trial
    from sim.running.run import Results, fly

    trial = Trial(flight.scenario, flight.planner, flight.seed, flight.repeat)
    return fly(trial, folder, Results(place, flight.video, flight.metrics), progress=tell, say=tell)
