"""`understory` without a command: how to start, and the version."""

from importlib.metadata import version as version_of
from typing import Annotated

import typer

from sim.terminal.console import console

_START = """[bold]Understory[/bold]: UAVs that track walking people under trees, on rendered frames.

Fly the default mission; its results go into a new folder under runs/:
  [bold]understory run[/bold]

Fly another one:
  [bold]understory run --planner greedy --seed 3[/bold]
  [bold]understory run --set trees.density=75 --duration 20[/bold]

Compare planners on the same forests, people and seeds:
  [bold]understory compare --planner sma-nbo-gospa --planner hover --seeds 0-9[/bold]

See what a camera saw in a run, annotated:
  [bold]understory frames runs/forest-sma-nbo-gospa-seed0 --uav 1 --time 12:14[/bold]

See a run again, as a slowed-down film or in a 3-D window:
  [bold]understory replay runs/forest-sma-nbo-gospa-seed0 --time 12:20 --speed 0.5[/bold]
  [bold]understory replay runs/forest-sma-nbo-gospa-seed0 --gui[/bold]

See when and why people were lost, then everything about one person at one time:
  [bold]understory explain runs/forest-sma-nbo-gospa-seed0[/bold]
  [bold]understory explain runs/forest-sma-nbo-gospa-seed0 --target 2 --time 21[/bold]

Track people in a flight of your own, from the files in a folder:
  [bold]understory track FLIGHT[/bold]

List planners and scenarios; yours are named module:Class and file.toml:
  [bold]understory planners[/bold]
  [bold]understory scenarios[/bold]

Check a planner, detector, mapper of trees or tracker of your own:
  [bold]understory check-planner module:Class[/bold]
  [bold]understory check-detector module:Class[/bold]
  [bold]understory check-mapper module:Class[/bold]
  [bold]understory check-tracker module:Class[/bold]

All options of a command:
  [bold]understory run --help[/bold]"""


def _show_version(asked: bool) -> None:
    if asked:
        console.print(f"understory {version_of('understory')}")
        raise typer.Exit


def start(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """UAVs that track walking people under trees, on rendered frames: fly missions and compare planners."""
    if context.invoked_subcommand is None:
        console.print(_START)
