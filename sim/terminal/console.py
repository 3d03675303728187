"""What the terminal shows: progress while flying, tables after."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isnan
from pathlib import Path
from statistics import fmean
from typing import Any, NoReturn

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from sim.mission.progress import Moment
from sim.scenario.scenario import Scenario

console = Console(highlight=False)
_LONGEST = 2000  # characters of a message
_START_UP = "starting up"
_SHOWN = 3  # faults of different kinds


def fail(message: str, *, code: int) -> NoReturn:
    """Say in one line why there is no result, and exit."""
    print(f"understory: {_line(message)}", file=sys.stderr)
    sys.exit(code)


def _line(message: str) -> str:
    """A message as one printable line; a long one keeps its ends: the field at first, what is allowed at last."""
    text = "".join(c if c.isprintable() else "?" for c in " ".join(message.split()))
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"


def remark(*messages: str) -> None:
    """Say what the user may not expect, one line each."""
    for message in messages:
        print(f"understory: {_line(message)}", file=sys.stderr)


def say(message: str) -> None:
    """Tell the user what takes so long."""
    console.print(message, soft_wrap=True)


@contextmanager
def starting() -> Iterator[None]:
    """Shows, while the block runs, that something does."""
    with console.status(_START_UP):
        yield


@contextmanager
def mission_progress(scenario: Scenario) -> Iterator[Callable[[Moment], None]]:
    """A bar with the simulated time and the running mean of the OSPA distance."""
    last = scenario.scan_times[-1]
    columns = (SpinnerColumn(), BarColumn(bar_width=20), TextColumn("{task.description}"), TimeRemainingColumn())
    distances: list[float] = []
    progress = Progress(*columns, console=console)
    task = progress.add_task("", total=len(scenario.scan_times))
    with console.status(_START_UP) as status:  # which goes away, whether a mission follows or a complaint

        def show(moment: Moment) -> None:
            if not distances:
                status.stop()
                progress.start()
            distances.extend(moment.distances)
            error = "-" if isnan(moment.error) else f"{moment.error:.2f} m"
            now = f"{moment.time:.1f} of {last:g} s, OSPA {error}, mean {fmean(distances):.2f} m"
            progress.update(task, completed=moment.scans, description=now)

        try:
            yield show
        finally:
            if progress.live.is_started:  # else a refusal would follow an empty line
                progress.stop()


@contextmanager
def trial_progress(total: int, what: str = "trials") -> Iterator[Callable[[object], None]]:
    """A bar with the trials, or whatever is counted, done."""
    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=40),
        MofNCompleteColumn(),
        TextColumn(what),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("", total=total)
        yield lambda outcome: progress.advance(task)


def show_run(summary: Mapping[str, Any], folder: Path) -> None:
    """The results of a mission and where its files are."""
    from sim.evaluation.summary import results_table  # late, as it needs NumPy

    show_faults(summary["faults"])
    console.print(results_table(summary))
    show_files(folder)
    asked = f"understory explain {shlex.quote(str(folder))}"
    console.print(f"Who was lost when, and why: [bold]{escape(asked)}[/bold]", soft_wrap=True)


def show_faults(faults: Sequence[Mapping[str, Any]]) -> None:
    """What went wrong, the first few things, each once."""
    if not faults:
        return
    alike: dict[tuple[object, str], list[Mapping[str, Any]]] = {}
    for fault in faults:
        alike.setdefault((fault["uav"], fault["message"]), []).append(fault)
    for first, *more in list(alike.values())[:_SHOWN]:
        who = "team" if first["uav"] is None else f"UAV {first['uav']}"
        often = f", {1 + len(more)} times until {more[-1]['time']:.1f} s" if more else ""
        text = f"at {first['time']:.1f} s{often}, {who}: {first['message']}"
        console.print(f"[bold red]fault[/bold red] {escape(text)}", soft_wrap=True)
        for line in first.get("trace", ()):
            console.print(f"  {escape(line)}", soft_wrap=True)
    if len(faults) > _SHOWN:
        console.print(f"All {len(faults)} faults are in summary.json.")


def show_files(folder: Path) -> None:
    """What is in a folder that was made; of many files, the first and the last."""
    names = sorted(path.name for path in folder.iterdir())
    listed = ", ".join(names) if len(names) < 8 else f"{names[0]} to {names[-1]}, {len(names)} files"
    console.print(f"Files in [bold]{escape(str(folder))}[/bold]:\n  {listed}", soft_wrap=True)


def show_list(items: Mapping[str, str], note: str) -> None:
    """Names and what they stand for."""
    table = Table.grid(padding=(0, 3))
    for name, meaning in items.items():
        table.add_row(f"[bold]{name}[/bold]", escape(meaning))
    console.print(table)
    console.print(f"\n{note}")


def show_groups(groups: Mapping[str, Mapping[str, str]], note: str) -> None:
    """Names and what they stand for, under headings."""
    width = max(len(name) for items in groups.values() for name in items)
    for heading, items in groups.items():
        console.print(f"{escape(heading)}:")
        table = Table.grid(padding=(0, 2))
        for name, meaning in items.items():
            table.add_row(f"  [bold]{escape(name):<{width}}[/bold]", escape(meaning))
        console.print(table)
    console.print(f"\n{note}")


def show_findings(findings: Sequence[object], failed: int) -> None:
    """One line per check, and what they come to."""
    for finding in findings:
        console.print(escape(str(finding)), soft_wrap=True)
    console.print(f"[red]{failed} of {len(findings)} checks failed[/red]" if failed else "[green]It conforms.[/green]")
