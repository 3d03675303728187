"""Plug-ins: import by import string, registry of those of one kind, and the error of wrong input."""

import importlib
import pkgutil
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracking.plugins.containment import ForeignError, contained
from tracking.plugins.spelling import did_you_mean, nearest

_OURS = ("sim", "planning", "tracking", "assets", "understory")
_ROOT = Path(__file__).parents[2]


class InputError(ValueError):
    """The input cannot be used; the message is one line: field, value, what is allowed, the nearest valid name."""


def check_known(field: str, name: str, known: Collection[str], also: str = "") -> None:
    """InputError unless a name is one of those known; `also` says what else is allowed."""
    if name not in known:
        raise InputError(f"{field}: {name!r} is unknown; {did_you_mean(name, known)}{also}")


@dataclass(frozen=True)
class Registry:
    """Plug-ins of one kind; `InputError` begins with `field`, the setting that names one of them."""

    field: str
    built_in: Mapping[str, str]  # import strings by name; they and their arguments may differ from those of outside
    methods: tuple[str, ...]  # that each has, with arguments: "detect(frame)"
    bare: bool = False  # plug-ins from outside are made without arguments

    def __iter__(self) -> Iterator[str]:
        return iter(self.built_in)

    def check(self, name: str) -> None:
        """InputError unless a plug-in is built in or may be an import string, "package.module:Class"."""
        if ":" not in name:
            check_known(self.field, name, self.built_in, " (or package.module:Class)")

    def find(self, name: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
        """The class of that name or import string; InputError says what is wrong."""
        self.check(name)
        try:
            return imported(self.built_in.get(name, name))
        except ImportError as error:
            raise InputError(f"{self.field}: {name!r} cannot be imported: {error}") from error

    def make(self, name: str, *arguments: object) -> Any:  # noqa: ANN401 - whatever a user's class makes
        """The plug-in of that name or import string; InputError says what is wrong."""
        make = self.find(name)
        with self.errors(name, "be made"):
            made = make() if self.bare and name not in self.built_in else make(*arguments)
            missing = [m for m in self.methods if not callable(getattr(made, m.partition("(")[0], None))]
        if missing:
            raise InputError(f"{self.field}: {name!r} has no method {missing[0]}")
        return made

    @contextmanager
    def errors(self, name: str, what: str) -> Iterator[None]:
        """Raise an InputError, "FIELD: NAME cannot WHAT: why", for whatever a plug-in raises in the block."""
        try:
            with contained():
                yield
        except ForeignError as error:
            raise InputError(f"{self.field}: {name!r} cannot {what}: {error.explained}") from error


def imported(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    """Import the class that "package.module:Class" names; ImportError says in one line why there is none.

    Importing runs the module, which may fail in any way.
    """
    module, _, attribute = target.partition(":")
    if not all(part.isidentifier() for part in module.split(".")):
        raise ImportError(f"{module!r} is not the name of a module")
    if not attribute:
        raise ImportError(f"it names no class; write {module}:Class")
    top = module.partition(".")[0]
    if top in (*_OURS, *sys.stdlib_module_names) and _hidden([module]):
        owner = "Understory" if top in _OURS else "Python"
        raise ImportError(f"{top!r} is a module of {owner}, which hides that of the current folder; rename yours")
    try:
        with contained(ModuleNotFoundError):
            loaded = importlib.import_module(module)
            found: Any = loaded
            for part in attribute.split("."):
                found = getattr(found, part, None)
            usable = callable(found)
    except ModuleNotFoundError as error:
        raise ImportError(_missing(module, error) + _clash()) from error
    except ForeignError as error:
        raise ImportError((error.text if error.kind == "ImportError" else str(error)) + _clash()) from error
    if not usable:
        classes = [name for name, value in vars(loaded).items() if isinstance(value, type)]
        raise ImportError(f"{module} has no class {attribute!r}{nearest(attribute, classes)}")
    return found


def _hidden(names: Iterable[str]) -> list[str]:
    """Names of modules that exist in the current folder, too, unless that is our own."""
    here = Path.cwd()
    places = {name: here.joinpath(*name.split(".")) for name in names if here != _ROOT}
    return [name for name, place in places.items() if place.is_dir() or place.with_name(f"{place.name}.py").is_file()]


def _clash() -> str:
    """The end of an error message: modules of the current folder that ours hide; empty: none."""
    hidden = ", ".join(_hidden(_OURS))
    return f"; Understory's packages hide those in the current folder of the names {hidden}" if hidden else ""


def _missing(module: str, error: ModuleNotFoundError) -> str:
    """Error message about a missing module: misspelt, or one that it needs is not installed."""
    absent = error.name or ""
    if not f"{module}.".startswith(f"{absent}."):
        return f"{module} needs {absent!r}, which is not installed: {error}"
    parent, _, leaf = absent.rpartition(".")
    folders = getattr(importlib.import_module(parent), "__path__", []) if parent else None
    return f"{error}{nearest(leaf, (m.name for m in pkgutil.iter_modules(folders)), cutoff=0.75)}"
