"""Options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from sim.scenario.quantities import seconds

Duration = Annotated[
    str | None, typer.Option(metavar="TIME", help="Simulated time: 40, 40s, 1.5min. Default: the scenario's.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a key of the scenario, such as trees.density=75; repeatable."
    ),
]
Recorded = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or its mission.npz.")]


def with_duration(overrides: list[str] | None, duration: str | None) -> list[str]:
    """The overrides, that of --duration among them."""
    added = [] if duration is None else [f"duration={seconds(duration, '--duration')}"]
    return [*(overrides or []), *added]
