"""`understory planners`, `scenarios` and `studies`."""

from collections.abc import Mapping

from rich.markup import escape
from rich.table import Table

from planning.catalogue import list_planners
from sim.scenario.loading import SCENARIOS
from sim.study.definition import STUDIES, read_study
from sim.terminal.console import console


def planners() -> None:
    """List the planners with their meanings, packages and options."""
    groups = list_planners()
    width = max(len(name) for items in groups.values() for name in items)
    for heading, items in groups.items():
        console.print(f"{escape(heading)}:")
        table = Table.grid(padding=(0, 2))
        for name, meaning in items.items():
            table.add_row(f"  [bold]{escape(name):<{width}}[/bold]", escape(meaning))
        console.print(table)
    console.print("\nWith options: --planner 'sma-nbo-gospa(horizon=3, sweeps=2)'.")
    console.print("Yours: --planner module:Class, with module.py in the current folder or installed.")


def scenarios() -> None:
    """List the packaged scenarios."""
    _show_list(
        {name: path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ") for name, path in SCENARIOS.items()},
        "Yours: a .toml file with the keys that differ. One key: --set key=value.",
    )


def studies() -> None:
    """List the packaged studies."""
    _show_list(
        {name: read_study(name).description for name in STUDIES},
        "Fly one: understory compare NAME --seeds 0-9. Yours: a .toml file, see docs/how-to/studies.md.",
    )


def _show_list(items: Mapping[str, str], note: str) -> None:
    """Print names with their meanings."""
    table = Table.grid(padding=(0, 3))
    for name, meaning in items.items():
        table.add_row(f"[bold]{name}[/bold]", escape(meaning))
    console.print(table)
    console.print(f"\n{note}")
