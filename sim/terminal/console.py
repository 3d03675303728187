"""The terminal: messages of one line, and the results of missions."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from rich.console import Console
from rich.markup import escape

console = Console(highlight=False, emoji=False)
_LONGEST = 2000  # characters of a message
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
    console.print(escape(message), soft_wrap=True)


def show_run(summary: Mapping[str, Any], folder: Path) -> None:
    """Print the results of a mission and where its files are."""
    from sim.evaluation.summary import results_table  # late, as it needs NumPy

    _show_faults(summary["faults"])
    console.print(results_table(summary))
    show_files(folder)
    asked = f"understory explain {shlex.quote(str(folder))}"
    console.print(f"People lost, when and why: [bold]{escape(asked)}[/bold]", soft_wrap=True)


def _show_faults(faults: Sequence[Mapping[str, Any]]) -> None:
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
    console.print(f"Files in [bold]{escape(str(folder))}[/bold]:\n  {escape(listed)}", soft_wrap=True)
