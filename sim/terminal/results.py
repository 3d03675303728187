"""Results in the terminal: of missions, of checks, and lists of names."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from sim.terminal.console import console
from tracking.plugins.findings import Finding

_SHOWN = 3  # faults of different kinds


def show_run(summary: Mapping[str, Any], folder: Path) -> None:
    """Print the results of a mission and where its files are."""
    from sim.evaluation.summary import results_table  # late, as it needs NumPy

    _show_faults(summary["faults"])
    console.print(results_table(summary))
    show_files(folder)
    asked = f"understory explain {shlex.quote(str(folder))}"
    console.print(f"People lost, when and why: [bold]{escape(asked)}[/bold]", soft_wrap=True)


def _show_faults(faults: Sequence[Mapping[str, Any]]) -> None:
    if not faults:
        return
    alike: dict[tuple[object, str], list[Mapping[str, Any]]] = {}
    for fault in faults:
        alike.setdefault((fault["uav"], fault["message"]), []).append(fault)
    for first, *more in list(alike.values())[:_SHOWN]:
        place = "team" if first["uav"] is None else f"UAV {first['uav']}"
        often = f", {1 + len(more)} times until {more[-1]['time']:.1f} s" if more else ""
        text = f"at {first['time']:.1f} s{often}, {place}: {first['message']}"
        console.print(f"[bold red]fault[/bold red] {escape(text)}", soft_wrap=True)
        for line in first.get("trace", ()):
            console.print(f"  {escape(line)}", soft_wrap=True)
    if len(faults) > _SHOWN:
        console.print(f"All {len(faults)} faults are in summary.json.")


def show_files(folder: Path) -> None:
    """Print the files of a folder that was made; of many, the first and the last."""
    names = sorted(path.name for path in folder.iterdir())
    listed = ", ".join(names) if len(names) < 8 else f"{names[0]} to {names[-1]}, {len(names)} files"
    console.print(f"Files in [bold]{escape(str(folder))}[/bold]:\n  {listed}", soft_wrap=True)


def show_list(items: Mapping[str, str], note: str) -> None:
    """Print names and their meaning."""
    table = Table.grid(padding=(0, 3))
    for name, meaning in items.items():
        table.add_row(f"[bold]{name}[/bold]", escape(meaning))
    console.print(table)
    console.print(f"\n{note}")


def show_groups(groups: Mapping[str, Mapping[str, str]], note: str) -> None:
    """Print names and their meaning under headings."""
    width = max(len(name) for items in groups.values() for name in items)
    for heading, items in groups.items():
        console.print(f"{escape(heading)}:")
        table = Table.grid(padding=(0, 2))
        for name, meaning in items.items():
            table.add_row(f"  [bold]{escape(name):<{width}}[/bold]", escape(meaning))
        console.print(table)
    console.print(f"\n{note}")


def show_findings(findings: Sequence[Finding]) -> None:
    """Print one line per check, and their sum; exit with code 1 if one failed."""
    for finding in findings:
        console.print(escape(str(finding)), soft_wrap=True)
    failed = sum(finding.passed is False for finding in findings)
    console.print(f"[red]{failed} of {len(findings)} checks failed[/red]" if failed else "[green]It conforms.[/green]")
    if failed:
        sys.exit(1)
