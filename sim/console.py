"""What the terminal shows: progress while flying, tables after."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from sim.experiment import Outcome
from sim.recording import Recorder, Snapshot
from sim.scenario import Scenario
from sim.summary import results_table

console = Console(highlight=False)


def fail(message: str) -> NoReturn:
    """Say in one line what is wrong with the input and exit with code 2."""
    print(f"understory: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)


@contextmanager
def mission_progress(scenario: Scenario) -> Iterator[Callable[[Snapshot, Recorder], None]]:
    """A bar with the simulated time and the running mean of the OSPA distance."""
    last = scenario.scan_times[-1]
    columns = (
        TextColumn("{task.fields[time]:5.1f} s"),
        BarColumn(bar_width=40),
        TextColumn("of {task.fields[last]:.0f} s   OSPA {task.fields[ospa]:5.2f} m, mean {task.fields[mean]:5.2f} m"),
        TimeRemainingColumn(),
    )
    distances: list[float] = []
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("", total=len(scenario.scan_times), time=0.0, last=last, ospa=0.0, mean=0.0)

        def show(snapshot: Snapshot, recorder: Recorder) -> None:
            distances.append(float(snapshot.ospa[:, 0].mean()))
            mean = sum(distances) / len(distances)
            progress.update(task, completed=len(recorder), time=snapshot.time, ospa=distances[-1], mean=mean)

        yield show


@contextmanager
def trial_progress(total: int) -> Iterator[Callable[[Outcome], None]]:
    """A bar with the trials done."""
    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=40),
        MofNCompleteColumn(),
        TextColumn("trials"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("", total=total)
        yield lambda outcome: progress.advance(task)


def show_run(summary: Mapping[str, Any], folder: Path) -> None:
    """The results of a mission and where its files are."""
    console.print(results_table(summary))
    for fault in summary["faults"][:3]:
        who = "team" if fault["uav"] is None else f"UAV {fault['uav']}"
        console.print(f"[red]fault[/red] at {fault['time']:.1f} s, {who}: {escape(fault['message'])}")
    names = ", ".join(sorted(path.name for path in folder.iterdir()))
    console.print(f"Files in [bold]{escape(str(folder))}[/bold]: {names}")


def show_comparison(names: Sequence[str], outcomes: Sequence[Outcome]) -> None:
    """One row per planner: means over the seeds."""
    table = Table(title=f"{len(outcomes) // len(names)} seeds each, means over the seeds", title_justify="left")
    table.add_column("planner")
    for column in ("OSPA under 1 m", "OSPA mean", "OSPA median", "planning", "faults"):
        table.add_column(column, justify="right")
    for name in names:
        rows = [outcome for outcome in outcomes if outcome.planner == name]
        table.add_row(
            name,
            f"{np.mean([r.share_under_1m for r in rows]):.1%}",
            f"{np.mean([r.mean_m for r in rows]):.2f} m",
            f"{np.mean([r.median_m for r in rows]):.2f} m",
            f"{np.mean([r.planning_s for r in rows]):.2f} s",
            str(sum(r.faults for r in rows)),
        )
    console.print(table)
