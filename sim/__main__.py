"""The command line: `understory run`, `compare`, `planners`, `scenarios`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from planning.registry import DEFAULT_PLANNER, PLANNERS, load_planner
from sim.console import console, fail, mission_progress, show_comparison, show_run, trial_progress
from sim.experiment import compare as compare_planners
from sim.loading import SCENARIOS, load
from sim.mission import Trial
from sim.quantity import integers, seconds
from sim.run import run as run_mission
from sim.warmup import warm_up

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich")

START = """[bold]Understory[/bold]: UAVs that track walking people under trees, on rendered frames.

  [bold]understory run[/bold]                          fly the default mission; leaves a folder under runs/
  [bold]understory run --planner greedy --seed 3[/bold]
  [bold]understory run --set trees.density=75 --duration 20[/bold]
  [bold]understory compare --planner sma-nbo-mwtp --planner hover --seeds 0-9[/bold]
  [bold]understory planners[/bold]                     planners by name; or yours: --planner package.module:Class
  [bold]understory scenarios[/bold]                    packaged scenarios; or yours: a .toml file

[bold]understory run --help[/bold] tells all options of a command."""

Scenario = Annotated[str, typer.Argument(help="Packaged scenario (see `understory scenarios`) or a .toml file.")]
Duration = Annotated[str | None, typer.Option(help="Simulated time: 40, 40s, 1.5min. Default: the scenario's.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help=("Override a key of the scenario, for instance trees.density=75 or uavs.0.alpha=0.2. May be repeated."),
    ),
]


@app.callback(invoke_without_command=True)
def start(context: typer.Context) -> None:
    """UAVs that track walking people under trees, on rendered frames: fly missions and compare planners."""
    if context.invoked_subcommand is None:
        console.print(START)


@app.command()
def run(
    scenario: Scenario = "forest",
    planner: Annotated[str, typer.Option(help="A name (see `understory planners`) or package.module:Class.")] = (
        DEFAULT_PLANNER
    ),
    seed: Annotated[int, typer.Option(min=0, help="Forest, people, sensors and planner follow from it.")] = 0,
    duration: Duration = None,
    overrides: Overrides = None,
    out: Annotated[Path | None, typer.Option(help="New folder for the results. Default: under runs/.")] = None,
    video: Annotated[bool, typer.Option(help="Whether to make mission.mp4.")] = True,
) -> None:
    """Fly one mission and leave recording, summary, video and OSPA curve in a new folder."""
    setting = load(scenario, _with_duration(overrides, duration))
    load_planner(planner)
    folder = out or _unused(Path("runs") / f"{Path(scenario).stem}-{planner.replace(':', '.')}-seed{seed}")
    _compile()
    with mission_progress(setting) as progress:
        summary = run_mission(Trial(setting, planner, seed), folder, video=video, progress=progress)
    show_run(summary, folder)


@app.command()
def compare(
    scenario: Scenario = "forest",
    planner: Annotated[list[str] | None, typer.Option(help="A planner to compare; repeat for each.")] = None,
    seeds: Annotated[str, typer.Option(help="Seeds that every planner flies: 0-9 or 0,3,7.")] = "0-9",
    duration: Duration = None,
    overrides: Overrides = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Fly several planners on the same forests, people and seeds, and show the results side by side."""
    setting = load(scenario, _with_duration(overrides, duration))
    names = list(dict.fromkeys(planner or PLANNERS))
    for name in names:
        load_planner(name)
    chosen = integers(seeds, "--seeds")
    _compile()
    with trial_progress(len(names) * len(chosen)) as progress:
        outcomes = compare_planners(setting, names, chosen, workers=workers, progress=progress)
    show_comparison(names, outcomes)


@app.command()
def planners() -> None:
    """List the planners by name."""
    for name, spec in PLANNERS.items():
        console.print(f"[bold]{name:<14}[/bold] {spec.summary}{' (default)' if name == DEFAULT_PLANNER else ''}")


@app.command()
def scenarios() -> None:
    """List the packaged scenarios."""
    for name, path in SCENARIOS.items():
        first = path.read_text(encoding="utf-8").splitlines()[0]
        console.print(f"[bold]{name:<14}[/bold] {first.lstrip('# ')}")


def _with_duration(overrides: list[str] | None, duration: str | None) -> list[str]:
    added = [] if duration is None else [f"duration={seconds(duration, '--duration')}"]
    return [*(overrides or []), *added]


def _unused(folder: Path) -> Path:
    """The folder, or the first of its numbered siblings, that does not exist yet."""
    number, free = 1, folder
    while free.exists():
        number += 1
        free = folder.with_name(f"{folder.name}-{number}")
    return free


def _compile() -> None:
    with console.status("Loading compiled code; the first time it is compiled, which takes about a minute"):
        spent = warm_up()
    if spent > 10:
        console.print(f"Compiled in {spent:.0f} s; later runs start at once.")


def main() -> None:
    """Entry point: exit code 0 done, 2 the input is wrong (one line says what), 1 anything else."""
    try:
        sys.exit(app(standalone_mode=False) and 1)
    except ValueError as error:
        fail(str(error))
    except Exception as error:
        # Typer's own complaints about arguments; their class differs between its versions.
        if not hasattr(error, "format_message"):
            raise
        fail(error.format_message())


if __name__ == "__main__":
    main()
