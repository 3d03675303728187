"""`understory planners`, `scenarios` and `studies`: what there is."""

from planning.registry import catalogue
from sim.scenario.loading import SCENARIOS
from sim.study.study import STUDIES, read
from sim.terminal.results import show_groups, show_list


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
