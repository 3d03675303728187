"""`understory run`."""

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from planning.catalogue import DEFAULT_PLANNER
from sim.facts.metrics.summary import make_results_table
from sim.facts.words import name_fleet
from sim.mission.atomic_files import PlaceTaken, claim_place
from sim.mission.trial import Trial, prefix_errors
from sim.mission.world_setup import find_scenario_remarks
from sim.running.fly import is_built_in
from sim.running.results import run_mission
from sim.running.timed_run import run_with_timeout
from sim.scenario.loading import load_scenario, place_of
from sim.scenario.quantities import parse_duration, parse_seed_and_repeat
from sim.terminal.commands import Duration, Overrides, Timeout, merge_overrides
from sim.terminal.console import console, print_remarks, say, show_files, show_place
from sim.terminal.progress import show_mission_progress
from tracking.errors import InputError
from tracking.plugins.plugin_error import plugin_call

_MOST_KINDS = 3  # number of faults of different kinds that are printed
_LONGEST = 150  # characters of scenario and planner in a folder's name, which may have 255

_Scenario = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A packaged scenario (see `understory scenarios`) or a .toml file.")
]
_Planner = Annotated[
    str, typer.Option(metavar="NAME", help="A planner (see `understory planners`), or yours as module:Class.")
]
_Seed = Annotated[
    str, typer.Option(metavar="N", help="Seed of forest and people; with --repeat, of all other randomness, too.")
]
_Repeat = Annotated[
    str, typer.Option(metavar="N", help="Another draw of noise, network losses, wind and planner on the same map.")
]
_Metrics = Annotated[
    list[str] | None, typer.Option(metavar="NAME", help="A further metric, or yours as module:NAME; repeatable.")
]
_Out = Annotated[Path | None, typer.Option(metavar="DIR", help="New folder for the results. Default: one under runs/.")]
_Video = Annotated[bool, typer.Option(help="Make mission.mp4 and mission.html, or not.")]


def run(
    scenario: _Scenario = "forest",
    planner: _Planner = DEFAULT_PLANNER,
    seed: _Seed = "0",
    repeat: _Repeat = "0",
    duration: Duration = None,
    overrides: Overrides = None,
    metric: _Metrics = None,
    out: _Out = None,
    video: _Video = True,
    timeout: Timeout = None,
) -> None:
    """Fly one mission. A new folder gets its recording, summary, film, page, OSPA curve and timeline."""
    changes = merge_overrides(overrides, duration)
    setting = load_scenario(scenario, changes)
    trial = Trial(setting, planner, *parse_seed_and_repeat(seed, repeat, "--"), place_of(scenario, changes))
    limit = None if timeout is None else parse_duration(timeout, "--timeout")
    with prefix_errors(trial.place):
        remarks = find_scenario_remarks(setting)
    print_remarks(*remarks.doubts)
    for line in remarks.files:
        say(line)
    options: dict[str, Any] = {"video": video, "metrics": metric or (), "say": say}
    with (
        claim_place(out, Path("runs") / _name_folder(scenario, trial)) as folder,
        show_mission_progress(setting) as progress,
    ):
        options["progress"] = progress
        if limit is not None:
            summary = run_with_timeout(trial, folder, limit, **options)
        elif is_built_in(trial) and not metric:
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
