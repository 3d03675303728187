"""A mission in a separate process, because a plug-in may end the process or hang in it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from planning.loading import planner_target
from sim.mission.trial import Progress, Say, ScanProgress, Trial
from sim.processes.isolation import IsolationError, run_isolated
from sim.recording.atomic_files import new_folder


class Results(NamedTuple):
    """Options for the files that a run leaves beside its recording."""

    place: str  # final name of the folder
    video: bool = True
    metrics: tuple[str, ...] = ()  # import strings of plug-in metrics for the summary


def is_built_in(trial: Trial) -> bool:
    """True if no plug-in from outside flies in a mission; InputError if there is no planner of that name."""
    parts = all(name in registry.built_in for registry, name in trial.scenario.plugins)
    return planner_target(trial.planner).startswith("planning.") and parts


def fly_apart(trial: Trial, results: Results, *, timeout: float | None, progress: Progress, say: Say) -> dict[str, Any]:
    """Fly a mission like `run.run`, but in a separate process.

    IsolationError if the process ends without a result or takes longer than `timeout` s.
    """
    last = None

    def hear(message: object) -> None:
        nonlocal last
        if isinstance(message, ScanProgress):
            last = message
            progress(message)
        else:
            say(str(message))

    with new_folder(Path(results.place)) as folder:
        try:
            # The first scan is reported after `stop_request`; before it, SIGINT is ignored there.
            summary: dict[str, Any] = run_isolated(
                _fly, trial, folder.absolute(), results, hear=hear, listening=ScanProgress, timeout=timeout
            )
        except IsolationError as error:
            when = f"at {last.time:.1f} s" if last else "before its first scan was complete"
            raise IsolationError(f"the mission ended {when}: {error}; nothing is kept") from error
    return summary


def _fly(trial: Trial, folder: Path, results: Results, tell: Callable[[object], None]) -> dict[str, Any]:
    """Fly in the separate process; plug-ins are imported, and invalid ones refused, before anything is compiled."""
    from planning.loading import load_planner

    for registry, name in trial.scenario.plugins:
        if name not in registry.built_in:
            registry.find(name)
    load_planner(trial.planner)
    from sim.evaluation.catalogue import metric

    for name in results.metrics:
        metric(name)
    from sim.running.run import fly

    return fly(trial, folder, results, progress=tell, say=tell)
