"""`understory run`."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from planning.catalogue import DEFAULT_PLANNER
from sim.processes.garbage import no_collection
from sim.running.beside import start_painter
from sim.scenario.quantities import parse_duration, parse_seed_and_repeat
from sim.terminal.commands import Duration, Overrides, Timeout, merge_overrides

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
    context: typer.Context,
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
    limit = None if timeout is None else parse_duration(timeout, "--timeout")
    numbers = parse_seed_and_repeat(seed, repeat, "--")
    # A second process, which draws, imports its modules while this one imports those of a mission.
    with nullcontext() if limit else start_painter() as painter:
        with no_collection():
            from sim.cli.run_flight import fly_and_show
            from sim.mission.trial import Trial
            from sim.scenario.loading import load_scenario, place_of

        trial = Trial(load_scenario(scenario, changes), planner, *numbers, place_of(scenario, changes))
        flown = {} if limit else {"begun": context.obj.begun, "painter": painter}
        fly_and_show(trial, scenario, out, limit, video=video, metrics=metric or (), **flown)
