"""Options of `understory compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

StudyName = Annotated[
    str, typer.Argument(metavar="STUDY", help="Name (see `understory studies`), study file, or scenario.")
]
Planners = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="A planner; repeat for each. Default: the study's, or two of the paper's."),
]
Seeds = Annotated[
    str | None, typer.Option(metavar="LIST", help="Seeds that every planner flies: 0-9 or 0,3,7. [default: 0-9]")
]
Maps = Annotated[str | None, typer.Option(metavar="N", help="Seeds 0 to N - 1; the paper has 50.")]
Repeats = Annotated[
    str | None, typer.Option(metavar="K", help="Flights on each map, with other noise each. [default: 1]")
]
Sensing = Annotated[str | None, typer.Option(metavar="MODE", help="camera or ideal.")]
Out = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Folder of results; what is there is not flown again. Default: one under runs/."),
]
Baseline = Annotated[
    str | None, typer.Option(metavar="NAME", help="The planner that others are compared with. Default: the first.")
]
Labels = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=PLANNER", help="A short name for a planner in tables and figures; repeatable."),
]
Metrics = Annotated[
    list[str] | None, typer.Option(metavar="NAME", help="What to compare, see docs/how-to/studies.md; repeatable.")
]
Workers = Annotated[str | None, typer.Option(metavar="N", help="Processes to fly in. Default: one a core.")]
Dask = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Fly on a dask cluster: tcp://host:8786.")]
Timeout = Annotated[
    str | None, typer.Option(metavar="TIME", help="Wall time beyond which a trial has failed: 90, 5min.")
]
Keep = Annotated[str | None, typer.Option(metavar="WHAT", help="recordings: keep each mission.npz.")]
Redo = Annotated[bool, typer.Option("--redo", help="Fly again what is there already.")]
