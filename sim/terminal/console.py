"""The terminal: messages of one line."""

import sys
from typing import NoReturn

from rich.console import Console

console = Console(highlight=False)
_LONGEST = 2000  # characters of a message


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
