"""Plug-ins: import by import string, and registries of one kind of plug-in each."""

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracking.errors import InputError, check_known, nearest
from tracking.plugins.containment import ForeignError, contained

_OURS = ("sim", "planning", "tracking", "assets", "understory")
_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Registry:
    """Plug-ins of one kind; `InputError` begins with `field`, the setting that names one of them."""

    field: str
    built_in: Mapping[str, str]  # import strings by name, with an interface that may differ from `methods`
    methods: tuple[str, ...]  # that plug-ins from outside must have, with arguments: "detect(frame)"
    bare: bool = False  # plug-ins from outside are made without arguments
    raises: type[InputError] = InputError  # for errors of plug-ins

    def check(self, name: str) -> None:
        """Raise InputError unless a name is built in or may be an import string, "package.module:Class"."""
        if not isinstance(name, str):
            raise InputError(f"{self.field}: {name!r} is not allowed; expected text, a name or package.module:Class")
        if ":" not in name:
            check_known(self.field, name, self.built_in, " (or package.module:Class)")

    def find(self, name: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
        """The class of that name or import string; InputError if there is none."""
        self.check(name)
        try:
            return imported(self.built_in.get(name, name))
        except ImportError as error:
            raise InputError(f"{self.field}: {name!r} cannot be imported: {error}") from error

    def make(self, name: str, *arguments: object) -> Any:  # noqa: ANN401 - whatever a user's class makes
        """The plug-in of that name or import string; InputError if it cannot be made."""
        make, ours = self.find(name), name in self.built_in
        methods = () if ours else self.methods
        with self.errors(name, "be made", called=(make, "__init__")):
            made = make() if self.bare and not ours else make(*arguments)
            lacking = [text for method in methods if (text := lack(name, made, method))]
        if lacking:
            raise InputError(f"{self.field}: {lacking[0]}")
        return made

    @contextmanager
    def errors(
        self, name: str, what: str, *passing: type[BaseException], called: tuple[object, str] | None = None
    ) -> Iterator[None]:
        """Raise `raises`, with the text "FIELD: NAME cannot WHAT: why", for any exception of a plug-in in the block.

        called: as in `contained`. Exceptions of `passing` pass as they are. So do InputErrors of a built-in plug-in,
        which may be about another plug-in that it makes.
        """
        try:
            with contained(*passing, *[InputError] * (name in self.built_in), called=called):
                yield
        except ForeignError as error:
            raise self.raises(f"{self.field}: {name!r} cannot {what}: {error.explained}") from error


def lack(name: str, made: Any, method: str) -> str:  # noqa: ANN401 - whatever a user's class makes
    """Error text if a plug-in lacks the method "method(argument, ...)" or takes other arguments; empty if not."""
    called, _, arguments = method.removesuffix(")").partition("(")
    found = getattr(made, called, None)
    if not callable(found):
        methods = [n for n in dir(made) if not n.startswith("_") and callable(getattr(made, n, None))]
        return f"{name!r} {'makes None, which ' * (made is None)}has no method {method}{nearest(called, methods)}"
    if inspect.iscoroutinefunction(found) or inspect.isasyncgenfunction(found):
        return f"{called} of {name!r} is async; it must be a plain method"
    try:
        inspect.signature(found).bind(*arguments.split(", "))
    except TypeError:
        return f"{called} of {name!r} takes {inspect.signature(found)}; it must take ({arguments})"
    except ValueError:
        pass  # without a signature, as in C: only a call can tell
    return ""


def imported(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    """Import the class that "package.module:Class" names; ImportError says in one line why there is none.

    Importing runs the module, which may fail in any way.
    """
    module, _, attribute = target.partition(":")
    _check_names(module, attribute)
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
        raise ImportError(error.explained + _clash()) from error
    if not usable and found is not None:
        raise ImportError(f"{attribute!r} of {module} is of type {type(found).__name__}, not a class or function")
    if not usable:
        classes = [name for name, value in vars(loaded).items() if isinstance(value, type)]
        raise ImportError(f"{module} has no class {attribute!r}{nearest(attribute, classes)}")
    return found


def _check_names(module: str, attribute: str) -> None:
    """Raise ImportError unless a module and a class are named, and no module of ours or of Python hides the module."""
    if module.endswith(".py") or not _is_dotted(module):
        meant = module.removeprefix("./").removesuffix(".py").replace("/", ".")
        hint = f"; write {meant}:{attribute or 'Class'}" if _is_dotted(meant) else ""
        raise ImportError(f"{module!r} is not the name of a module{hint}")
    if not attribute:
        raise ImportError(f"it names no class; write {module}:Class")
    if not _is_dotted(attribute):
        raise ImportError(f"{attribute!r} is not the name of a class; only planners have options in brackets")
    top = module.partition(".")[0]
    if top in (*_OURS, *sys.stdlib_module_names) and _hidden([module]):
        owner = "Understory" if top in _OURS else "Python"
        raise ImportError(f"{top!r} is a module of {owner}, which hides that of the current folder; rename yours")


def _is_dotted(text: str) -> bool:
    """True for identifiers with dots between them."""
    return all(part.isidentifier() for part in text.split("."))


def _hidden(names: Iterable[str]) -> list[str]:
    """Those of the names of modules that also exist in the current folder, unless that is our own."""
    here = Path.cwd()
    places = {name: here.joinpath(*name.split(".")) for name in names if here != _ROOT}
    return [name for name, place in places.items() if place.is_dir() or place.with_name(f"{place.name}.py").is_file()]


def _clash() -> str:
    """The end of an error message: modules of the current folder that ours hide; empty if there are none."""
    hidden = ", ".join(_hidden(_OURS))
    return f"; Understory's packages hide those in the current folder of the names {hidden}" if hidden else ""


def _missing(module: str, error: ModuleNotFoundError) -> str:
    """Error message about a missing module, which is misspelt or needs a module that is not installed."""
    absent = error.name or ""
    if not f"{module}.".startswith(f"{absent}."):
        return f"{module} needs {absent!r}, which is not installed: {error}"
    parent, _, leaf = absent.rpartition(".")
    folders = getattr(importlib.import_module(parent), "__path__", []) if parent else None
    return f"{error}{nearest(leaf, (m.name for m in pkgutil.iter_modules(folders)), cutoff=0.75)}"
