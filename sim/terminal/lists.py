"""Lists in the terminal: names with their meaning, and findings of checks."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence

from rich.markup import escape
from rich.table import Table

from sim.terminal.console import console
from tracking.plugins.findings import Finding


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
