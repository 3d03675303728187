"""Errors of plug-ins in one line each: class, text, and place in the plug-in's own file."""

import importlib
import inspect
import os
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tracking.errors import one_line

_LAST = 3  # lines of a traceback that are kept
_LONGEST_LINE = 300  # characters of one of them
_OURS = tuple(f"{Path(__file__).parents[2] / name}{os.sep}" for name in ("sim", "planning", "tracking"))
_NOT_PLUGINS = (*_OURS, "<", f"{Path(importlib.__file__).parent}{os.sep}")


class Unusable(ValueError):
    """A plug-in's result cannot be used; the message says why."""


class PluginError(Exception):
    """An error of a plug-in: one line of `text`, and the last lines of its traceback in the plug-in's own files."""

    def __init__(self, text: str, trace: tuple[str, ...] = ()) -> None:
        super().__init__(text, trace)
        self.text, self.trace = text, trace

    def __str__(self) -> str:
        return self.text

    @property
    def with_place(self) -> str:
        """Text, file, line and function."""
        return f"{self.text} ({self.trace[-1].partition(': ')[0]})" if self.trace else self.text


@contextmanager
def plugin_call(
    plugin: object = None, method: str = "", *, passing: tuple[type[Exception], ...] = ()
) -> Iterator[None]:
    """Raise a `PluginError` for any exception in the block, except those `passing`.

    If the exception is not raised in the plug-in's own code, the result of `method` is to blame: the error then names
    the line that defines this method of the plug-in, or its class.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, (PluginError, *passing)):
            raise
        trace = _find_own_lines(error)
        refused = isinstance(error, ValueError) and not trace  # by our own code, whose text is enough
        told = ("" if refused else type(error).__name__, one_line(str(error)))
        raise PluginError(": ".join(filter(None, told)), trace or _find_definition(plugin, method)) from error


def _find_own_lines(error: Exception) -> tuple[str, ...]:
    """Last lines of a traceback in the folder of the plug-in, as "file:line, in function: code"."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith(_NOT_PLUGINS)]
    own = [f for f in frames if os.path.dirname(f.filename) == os.path.dirname(frames[0].filename)]
    return tuple(one_line(f"{f.filename}:{f.lineno}, in {f.name}: {f.line}", _LONGEST_LINE) for f in own[-_LAST:])


def _find_definition(plugin: object, method: str) -> tuple[str, ...]:
    """The line that defines a plug-in's method or else its class, as in a traceback; empty if the code is ours."""
    home = plugin if isinstance(plugin, type) or inspect.isfunction(plugin) else type(plugin)
    found = inspect.getattr_static(plugin, method, home)
    for part in (inspect.unwrap(getattr(found, "fget", found)), home):
        try:
            file, (lines, first) = inspect.getsourcefile(part) or "", inspect.getsourcelines(part)
        except (TypeError, OSError):  # no code, or none in Python
            continue
        if not file.startswith(_OURS):
            return (one_line(f"{file}:{first}, in {part.__qualname__}: {lines[0]}", _LONGEST_LINE),)
    return ()
