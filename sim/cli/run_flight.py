"""The mission of `understory run`, whose imports take a second; meanwhile another process prepares for its pictures."""

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape

from sim.facts.metrics.summary import make_results_table
from sim.facts.words import name_fleet
from sim.mission.atomic_files import PlaceTaken, claim_place
from sim.mission.trial import Trial, prefix_errors
from sim.mission.world_setup import find_scenario_remarks
from sim.running.fly import is_built_in
from sim.running.results import run_mission
from sim.terminal.console import console, print_remarks, say, show_files, show_place
from sim.terminal.progress import show_mission_progress
from tracking.errors import InputError
from tracking.plugins.plugin_error import plugin_call

_MOST_KINDS = 3  # number of faults of different kinds that are printed
_LONGEST = 150  # characters of scenario and planner in a folder's name, which may have 255


def fly_and_show(trial: Trial, scenario: str, out: Path | None, limit: float | None, **options: Any) -> None:  # noqa: ANN401
    """Fly a mission and print its results.

    scenario: as the user named it. out: the folder, by default one under runs/. limit: of wall time [s], or None.
    options: of `run_mission`.
    """
    with prefix_errors(trial.place):
        remarks = find_scenario_remarks(trial.scenario)
    print_remarks(*remarks.doubts)
    for line in remarks.files:
        say(line)
    with (
        claim_place(out, Path("runs") / _name_folder(scenario, trial)) as folder,
        show_mission_progress(trial.scenario) as progress,
    ):
        options |= {"say": say, "progress": progress}
        if limit is not None:
            from sim.running.timed_run import run_with_timeout

            summary = run_with_timeout(trial, folder, limit, **options)
        elif is_built_in(trial) and not options["metrics"]:
            summary = run_mission(trial, folder, **options)
        else:
            with plugin_call(passing=(InputError, PlaceTaken)):  # an exception of a plug-in is one line of text
                summary = run_mission(trial, folder, **options)
    show_run(summary, folder)


def show_run(summary: Mapping[str, Any], folder: Path) -> None:
    """Print the results of a mission and the place of its files."""
    _show_faults(summary["faults"])
    console.print(make_results_table(summary))
    show_files(folder)
    show_place("People lost, when and why", f"understory explain {shlex.quote(str(folder))}")


def _show_faults(faults: Sequence[Mapping[str, Any]]) -> None:
    alike: dict[tuple[object, ...], list[Mapping[str, Any]]] = {}
    for fault in faults:
        kind = fault["uav"] is None, fault["message"], *fault.get("trace", ())
        alike.setdefault(kind, []).append(fault)
    for first, *more in list(alike.values())[:_MOST_KINDS]:
        place = "team" if first["uav"] is None else name_fleet(sorted({f["uav"] for f in (first, *more)}))
        often = f", {1 + len(more)} times until {more[-1]['time']:.1f} s" if more else ""
        text = f"at {first['time']:.1f} s{often}, {place}: {first['message']}"
        console.print(f"[bold red]fault[/bold red] {escape(text)}", soft_wrap=True)
        for line in first.get("trace", ()):
            console.print(f"  {escape(line)}", soft_wrap=True)
    if len(faults) > _MOST_KINDS:
        kinds = f", of {len(alike)} kinds," if len(alike) > _MOST_KINDS else ""
        console.print(f"All {len(faults)} faults{kinds} are in summary.json.")


def _name_folder(scenario: str, trial: Trial) -> str:
    """Name of a folder, without characters that are special in a shell."""
    planner = re.sub(r"[^\w.=-]+", "-", trial.planner.replace(":", "."), flags=re.ASCII)
    name = f"{Path(scenario).stem}-{planner.strip('-')}"[:_LONGEST] + f"-seed{trial.seed}"
    return f"{name}-repeat{trial.repeat}" if trial.repeat else name
