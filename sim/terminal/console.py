"""Output to the terminal: messages of one line, and places of files."""

import sys
from pathlib import Path
from typing import NoReturn

from rich.console import Console
from rich.markup import escape

from tracking.errors import one_line

console = Console(highlight=False, emoji=False)


def fail(message: str, *, code: int) -> NoReturn:
    """Print in one line why there is no result, and exit."""
    print_remarks(message)
    sys.exit(code)


def print_remarks(*messages: str) -> None:
    """Print remarks on unexpected facts, one line each."""
    for message in messages:
        print(f"understory: {one_line(message)}", file=sys.stderr)


def say(message: str) -> None:
    """Print a message about work that takes long."""
    console.print(escape(message), soft_wrap=True)


def show_place(what: str, place: object) -> None:
    """Print the place of something, or the command that shows it."""
    console.print(f"{what}: [bold]{escape(str(place))}[/bold]", soft_wrap=True)


def show_files(folder: Path) -> None:
    """Print the files of a new folder; if there are many, the first and the last."""
    names = sorted(path.name for path in folder.iterdir())
    listed = ", ".join(names) if len(names) < 8 else f"{names[0]} to {names[-1]}, {len(names)} files"
    console.print(f"Files in [bold]{escape(str(folder))}[/bold]:\n  {escape(listed)}", soft_wrap=True)
