"""Other people's classes, by import string."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from collections.abc import Iterable
from typing import Any

from tracking.plugins.containment import ForeignError, contained


def imported(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    """The class "package.module:Class" names; ImportError says in one line why there is none.

    Importing runs the module, which may fail in any way.
    """
    module, _, attribute = target.partition(":")
    if not all(part.isidentifier() for part in module.split(".")):
        raise ImportError(f"{module!r} is not the name of a module")
    if not attribute:
        raise ImportError(f"it names no class; write {module}:Class")
    try:
        with contained(ModuleNotFoundError):
            loaded = importlib.import_module(module)
            found: Any = loaded
            for part in attribute.split("."):
                found = getattr(found, part, None)
            usable = callable(found)
    except ModuleNotFoundError as error:
        raise ImportError(_missing(module, error)) from error
    except ForeignError as error:
        raise ImportError(error.text if error.kind == "ImportError" else str(error)) from error
    if not usable:
        classes = [name for name, value in vars(loaded).items() if isinstance(value, type)]
        raise ImportError(f"{module} has no class {attribute!r}{nearest(attribute, classes)}")
    return found


def nearest(word: str, known: Iterable[str], cutoff: float = 0.3) -> str:
    """The end of a complaint about a word: the nearest one that is known, if there is any."""
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return f"; did you mean {near[0]}?" if near else ""


def _missing(module: str, error: ModuleNotFoundError) -> str:
    """Whether a module itself is missing, perhaps misspelt, or what it needs."""
    absent = error.name or ""
    if not f"{module}.".startswith(f"{absent}."):
        return f"{module} needs {absent!r}, which is not installed: {error}"
    parent, _, leaf = absent.rpartition(".")
    folders = getattr(importlib.import_module(parent), "__path__", []) if parent else None
    return f"{error}{nearest(leaf, (m.name for m in pkgutil.iter_modules(folders)), cutoff=0.75)}"
