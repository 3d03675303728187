"""The error for wrong input, and the words of messages: numbers, lists, and the nearest valid names."""

import difflib
from collections.abc import Collection, Iterable, Sequence


class InputError(ValueError):
    """Input that cannot be used; the message is one line with field, value, allowed values and nearest valid name."""


def check_known(field: str, name: str, known: Collection[str], also: str = "") -> None:
    """Raise InputError unless a name is known; `also` names what else is allowed."""
    if name not in known:
        raise InputError(f"{field}: {name!r} is unknown; {did_you_mean(name, known)}{also}")


def one_line(message: str | Exception, longest: int = 2000) -> str:
    """A message as one line of printable characters; a long one keeps its beginning and its end."""
    text = " ".join("".join(c if c.isprintable() else " " for c in str(message)).split())
    if not text and isinstance(message, Exception):
        return type(message).__name__
    half = (longest - 5) // 2
    return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"


def spell(value: float, digits: int = 12) -> str:
    """A number with at most this many significant digits, but with all digits before the point: 1080, not 1.08e+03."""
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e15 else text


def list_numbers(what: str, numbers: Sequence[int]) -> str:
    """Numbered things in words: "tree 0", "trees 0, 1 and 2"."""
    *most, last = map(str, numbers)
    return f"{what}s {', '.join(most)} and {last}" if most else f"{what} {last}"


def nearest(word: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """The end of an error message: the known name nearest to a word; empty if none has the similarity `cutoff`."""
    names = {name.casefold(): name for name in known}
    near = difflib.get_close_matches(word.casefold(), names, n=1, cutoff=cutoff)
    return f"; did you mean {names[near[0]]}?" if near else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The end of an error message: all known names, and the one nearest to a word."""
    names = list(known)
    return f"allowed are {', '.join(names)}{nearest(word, names)}"
