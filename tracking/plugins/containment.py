"""Containment of plug-ins: their exceptions, results and settings have no effect outside a call."""

from __future__ import annotations

import importlib
import inspect
import os
import sys
import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # lists of plug-ins need no arithmetic, whose import takes a while
    from tracking.numerics.arrays import Array

_LONGEST = 1000  # characters of a message
_LAST = 3  # lines of a traceback in a plug-in's own code that are kept
_DEEPEST = 5  # nested lists
_PLAIN = ("ValueError", "TypeError", "ImportError")  # kinds of exceptions that their text explains
_OURS = tuple(f"{Path(__file__).parents[2] / name}{os.sep}" for name in ("sim", "planning", "tracking"))
_IMPORT = ("<frozen ", "<string>", f"{Path(importlib.__file__).parent}{os.sep}")


class Unusable(ValueError):
    """Result of a plug-in that cannot be used; the message says why."""


class ForeignError(Exception):
    """Error of a plug-in: `text` in one line, `kind` of exception, `trace` of its own code."""

    def __init__(self, kind: str, text: str, trace: tuple[str, ...] = ()) -> None:
        """Describe an error; `kind` is empty if the text is enough."""
        super().__init__(kind, text, trace)
        self.kind, self.text, self.trace = kind, text, trace

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.kind, self.text)))

    @property
    def explained(self) -> str:
        """Text and place of the error; the kind is left out for errors of values, types and imports."""
        return self._placed(self.text if self.text and self.kind in _PLAIN else str(self))

    @property
    def whole(self) -> str:
        """Kind, text and place of the error."""
        return self._placed(str(self))

    def _placed(self, text: str) -> str:
        return f"{text} ({self.trace[-1].partition(': ')[0]})" if self.trace else text


@contextmanager
def contained(*passing: type[BaseException], called: tuple[object, str] | None = None) -> Iterator[None]:
    """Raise a `ForeignError` for any exception of the block except those `passing` and the user's KeyboardInterrupt.

    called: a plug-in, and its method that gives a result to the block. An error outside the plug-in's own code is
    blamed on this result, and names the line that defines the method.
    Settings of the process that the block changes are restored: NumPy's handling of overflows, filters of warnings, and
    the limit of recursion.
    """
    import numpy as np

    filters, depth = warnings.filters[:], sys.getrecursionlimit()
    try:
        with np.errstate():
            yield
    except Unusable as error:
        raise ForeignError("", str(error), _definition(called)) from None
    except BaseException as error:
        if isinstance(error, (KeyboardInterrupt, ForeignError, *passing)):
            raise
        raise _described(error, called) from None
    finally:
        if sys.getrecursionlimit() != depth:
            sys.setrecursionlimit(depth)
        if warnings.filters != filters:
            warnings.resetwarnings()
            warnings.filters[:] = filters  # type: ignore[index]


def one_line(text: str, longest: int = _LONGEST) -> str:
    """Printable characters in one line, cut after `longest`."""
    plain = "".join(c if c.isprintable() else " " for c in text[: 10 * longest])
    line = " ".join(plain.split())
    return line if len(line) <= longest else line[: longest - 1] + "…"


def numbers(name: str, given: object, most: int) -> Array:
    """A new array of floats from a plug-in's result; `Unusable` for other values, or for more than `most` numbers."""
    import numpy as np

    if not hasattr(type(given), "__array__"):
        given = _listed(name, given, [most])
    try:
        array = np.asarray(given)
        if array.size > most:
            raise Unusable(_too_many(name, most))
        if array.dtype.kind not in "biufO":
            raise Unusable(f"{name} are not numbers")
        return np.array(array, dtype=float, order="C")
    except OverflowError:
        raise Unusable(f"{name} are not finite") from None
    except (TypeError, ValueError) as error:
        raise error if isinstance(error, Unusable) else Unusable(f"{name} are not numbers") from None


def _listed(name: str, given: object, left: list[int], depth: int = _DEEPEST) -> object:
    """Nested sequences as lists; `left` counts down the entries that are still allowed."""
    kind = type(given)
    if isinstance(given, str | bytes | Mapping) or not (hasattr(kind, "__len__") and hasattr(kind, "__getitem__")):
        return given
    if hasattr(kind, "__array__"):
        import numpy as np

        array = np.asarray(given)  # which tells the size of every kind of array, such as another library's
        if array.size > left[0]:
            raise Unusable(_too_many(name, left[0]))
        return array
    if depth == 0:
        raise Unusable(f"{name} are not numbers")
    most = left[0]
    items: list[object] = []
    for item in given:  # type: ignore[attr-defined]
        left[0] -= not hasattr(type(item), "__len__")
        if left[0] < 0 or len(items) > most:
            raise Unusable(_too_many(name, most))
        items.append(_listed(name, item, left, depth - 1))
    return items


def _too_many(name: str, most: int) -> str:
    return f"{name} are more than {most} numbers"


def _described(error: BaseException, called: tuple[object, str] | None) -> ForeignError:
    """Exception as text; its class and methods may be the plug-in's own."""
    try:
        kind = one_line(str.__str__(type(error).__name__), 100)
    except BaseException:
        kind = "an exception"
    try:
        text = one_line(str.__str__(str(error)))
    except BaseException:
        text = "what it says cannot be read"
    return ForeignError(kind, text, _places(error) or _definition(called))


def _places(error: BaseException) -> tuple[str, ...]:
    """Last lines of a traceback in the plug-in's own code, and its very last line if that is in a library."""
    try:
        frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith(_OURS + _IMPORT)]
    except BaseException:
        return ()
    if not frames:
        return ()
    home = os.path.dirname(frames[0].filename)
    kept = [frame for frame in frames if frame.filename.startswith(home)][-_LAST:]
    kept += [] if kept[-1] is frames[-1] else [frames[-1]]
    return tuple(one_line(f"{f.filename}:{f.lineno}, in {f.name}: {f.line}", 300) for f in kept)


def _definition(called: tuple[object, str] | None) -> tuple[str, ...]:
    """The line that defines a plug-in's method or else its class, as in a traceback; empty if the code is ours."""
    if called is None:
        return ()
    try:
        method = inspect.getattr_static(*called, None)
        found: Any = inspect.unwrap(getattr(method, "fget", getattr(method, "__func__", method)))
        if not inspect.isfunction(found):
            found = called[0] if isinstance(called[0], type) or inspect.isfunction(called[0]) else type(called[0])
        file, (lines, first) = inspect.getsourcefile(found) or "", inspect.getsourcelines(found)
        ours = file.startswith(_OURS)
        return () if ours else (one_line(f"{file}:{first}, in {found.__qualname__}: {lines[0]}", 300),)
    except BaseException:  # anything may be in the place of a method
        return ()
