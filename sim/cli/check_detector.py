"""`understory check-detector`."""

from __future__ import annotations

from typing import Annotated

import typer

from sim.sensing.detectors import load_detector
from sim.terminal.console import say
from sim.terminal.progress import starting
from sim.terminal.results import show_findings


def check_detector(
    detector: Annotated[str, typer.Argument(metavar="DETECTOR", help="Name, or yours, module:Class.")],
) -> None:
    """Check that a detector keeps to what detectors must, on frames rendered for that; exit code 1 if it does not."""
    load_detector(detector, None)
    from sim.conformance.detector import check
    from sim.mission.warmup import announced

    with starting(), announced(say):
        findings = check(detector)
    show_findings(findings)
