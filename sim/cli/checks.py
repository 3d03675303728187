"""`understory check-planner`, `check-detector`, `check-mapper` and `check-tracker`: what a plug-in must keep to."""

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated

import typer
from rich.markup import escape

from planning import planner_check
from planning.planner_loading import load_planner
from sim.mission.warmup import announce_compilation
from sim.scenario.believed import MAPPERS
from sim.scenario.sensing import DETECTORS
from sim.sensing import detector_check, mapper_check
from sim.terminal.console import console, say
from sim.terminal.progress import show_compilation, show_progress
from tracking.fusion import tracker_check
from tracking.fusion.member import TRACKERS
from tracking.plugins.findings import Finding


def check_planner(
    planner: Annotated[
        str, typer.Argument(metavar="PLANNER", help="Its name, or yours as module:Class; with or without options.")
    ],
) -> None:
    """Check a planner against the rules for planners, on test situations; exit code 1 if a check fails."""
    load_planner(planner)
    _show(planner_check.check_planner, planner)


def check_detector(
    detector: Annotated[str, typer.Argument(metavar="DETECTOR", help="Its name, or yours as module:Class.")],
) -> None:
    """Check a detector against the rules for detectors, on test frames; exit code 1 if a check fails."""
    DETECTORS.make(detector)
    _show(detector_check.check_detector, detector)


def check_mapper(
    mapper: Annotated[str, typer.Argument(metavar="MAPPER", help="Its name, or yours as module:Class.")],
) -> None:
    """Check a mapper of trees against the rules for mappers, on test frames; exit code 1 if a check fails."""
    MAPPERS.make(mapper)
    _show(mapper_check.check_mapper, mapper)


def check_tracker(
    tracker: Annotated[str, typer.Argument(metavar="TRACKER", help="Its name, or yours as module:Class.")],
) -> None:
    """Check a tracker against the rules for trackers, on test scans; exit code 1 if a check fails."""
    TRACKERS.find(tracker)
    _show(tracker_check.check_tracker, tracker)


def _show(check: Callable[[str], Sequence[Finding]], plugin: str) -> None:
    """Print one line per check and a summary; exit with code 1 if a check failed."""
    with show_progress() as show, announce_compilation(say, partial(show_compilation, show)):
        findings = check(plugin)
    for one in findings:
        console.print(escape(str(one)), soft_wrap=True)
    if failed := sum(one.passed is False for one in findings):
        untried = sum(one.passed is None for one in findings)
        rest = f", {untried} could not be tried" if untried else ""
        console.print(f"[red]{failed} of {len(findings)} checks failed{rest}[/red]")
        sys.exit(1)
    console.print("[green]It conforms.[/green]")
