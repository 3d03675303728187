"""Commands that list what there is, such as `understory planners`, and that check plug-ins."""

from typing import Annotated

import typer

from planning.loading import load_planner
from planning.registry import catalogue
from sim.scenario.loading import SCENARIOS
from sim.scenario.perception import DETECTORS
from sim.study.study import STUDIES, read
from sim.terminal.console import say
from sim.terminal.progress import starting
from sim.terminal.results import show_findings, show_groups, show_list
from tracking.fusion.member import TRACKERS


def planners() -> None:
    """List the planners: what each is, which package brings it, and its options."""
    show_groups(
        catalogue(),
        "With options: --planner 'sma-nbo-mwtp(horizon=3, beta=0.2)'.\n"
        "Yours: --planner module:Class, with module.py in the current folder or installed.",
    )


def scenarios() -> None:
    """List the packaged scenarios."""
    show_list(
        {name: path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ") for name, path in SCENARIOS.items()},
        "Yours: a .toml file with the keys that differ. One key: --set key=value.",
    )


def studies() -> None:
    """List the packaged studies."""
    show_list(
        {name: read(name).description for name in STUDIES},
        "Fly one: understory compare NAME --maps 10. Yours: a .toml file, see docs/how-to/studies.md.",
    )


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


def check_detector(
    detector: Annotated[str, typer.Argument(metavar="DETECTOR", help="Name, or yours, module:Class.")],
) -> None:
    """Check that a detector keeps to what detectors must, on frames rendered for that; exit code 1 if it does not."""
    DETECTORS.make(detector)
    from sim.conformance.detector import check
    from sim.mission.warmup import announced

    with starting(), announced(say):
        findings = check(detector)
    show_findings(findings)


def check_tracker(
    tracker: Annotated[str, typer.Argument(metavar="TRACKER", help="Name, or yours, module:Class.")],
) -> None:
    """Check that a tracker keeps to what trackers must, on scans scripted for that; exit code 1 if it does not."""
    TRACKERS.find(tracker)
    from sim.conformance.tracker import check
    from sim.mission.warmup import announced

    with starting(), announced(say):
        findings = check(tracker)
    show_findings(findings)
