"""`understory check-planner`."""

from __future__ import annotations

from typing import Annotated

import typer

from planning.loading import load_planner
from sim.terminal.console import say
from sim.terminal.progress import starting
from sim.terminal.results import show_findings


def check_planner(
    planner: Annotated[
        str, typer.Argument(metavar="PLANNER", help="Name, with options or not, or yours, module:Class.")
    ],
) -> None:
    """Check that a planner keeps to what planners must, on situations made for that; exit code 1 if it does not."""
    load_planner(planner)
    from planning.conformance.checks import check
    from sim.mission.warmup import announced

    with starting(), announced(say):
        findings = check(planner)
    show_findings(findings)
