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
from tracking.plugins.plugin_error import PluginError, plugin_call

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
        if name in self.built_in:
            return pkgutil.resolve_name(self.built_in[name])
        try:
            return import_plugin(name)
        except ImportError as error:
            raise InputError(f"{self.field}: {name!r} cannot be imported: {error}") from error

    def make(self, name: str, *arguments: object) -> Any:  # noqa: ANN401 - whatever a user's class makes
        """The plug-in of that name or import string; InputError if it cannot be made."""
        make = self.find(name)
        if name in self.built_in:  # which may make a plug-in in turn, whose InputErrors name it
            with self.errors(name, "be made", passing=(InputError,)):
                return make(*arguments)
        with self.errors(name, "be made", make, "__init__"):
            made = make() if self.bare else make(*arguments)
        return self.check_methods(name, made)

    def check_methods(self, name: str, made: Any) -> Any:  # noqa: ANN401 - a plug-in
        """The plug-in; InputError unless it has the methods of this registry."""
        for method in self.methods:
            if lacking := _describe_lack(name, made, method):
                raise InputError(f"{self.field}: {lacking}")
        return made

    def is_stateful(self, name: str, made: object) -> bool:
        """True if a plug-in declares that it has a memory, `stateful = True`; InputError if it lacks `reset`."""
        stateful = bool(getattr(made, "stateful", False))
        if stateful and not callable(getattr(made, "reset", None)):
            raise self.raises(f"{self.field}: {name!r} is stateful, but has no method reset(seed)")
        return stateful

    def reset(self, name: str, made: Any, seed: int) -> None:  # noqa: ANN401 - a plug-in
        """Clear a plug-in's memory if it is stateful; InputError if that fails."""
        if self.is_stateful(name, made):
            with self.errors(name, "be reset"):
                made.reset(seed)

    @contextmanager
    def errors(
        self,
        name: str,
        what: str,
        plugin: object = None,
        method: str = "",
        *,
        passing: tuple[type[Exception], ...] = (),
    ) -> Iterator[None]:
        """Raise `raises`, with the text "FIELD: NAME cannot WHAT: why", for any exception of a plug-in in the block.

        name: name or import string of the plug-in; what: what it cannot do, in words; the others are those of
        `plugin_call`.
        """
        try:
            with plugin_call(plugin, method, passing=passing):
                yield
        except PluginError as error:
            raise self.raises(f"{self.field}: {name!r} cannot {what}: {error.with_place}") from error


def _describe_lack(name: str, made: Any, method: str) -> str:  # noqa: ANN401 - whatever a user's class makes
    """Error text if a plug-in lacks the method "method(argument, ...)" or takes other arguments; empty if not."""
    called, _, arguments = method.removesuffix(")").partition("(")
    found = getattr(made, called, None)
    if not callable(found):
        methods = [n for n in dir(made) if not n.startswith("_") and callable(getattr(made, n, None))]
        return f"{name!r} {'makes None, which ' * (made is None)}has no method {method}{nearest(called, methods)}"
    if inspect.iscoroutinefunction(found) or inspect.isasyncgenfunction(found):
        return f"{called} of {name!r} is async; it must be a plain method"
    try:
        inspect.signature(found).bind(*filter(None, arguments.split(", ")))
    except TypeError:
        return f"{called} of {name!r} takes {inspect.signature(found)}; it must take ({arguments})"
    except ValueError:
        pass  # without a signature, as in C: only a call can tell
    return ""


def import_plugin(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    """Import the class that "package.module:Class" names; ImportError says in one line why there is none."""
    module, _, attribute = target.partition(":")
    _check_names(module, attribute)
    try:
        with plugin_call(passing=(ModuleNotFoundError,)):
            loaded = importlib.import_module(module)
    except SystemExit as error:  # of a script without a guard by `__name__`
        raise ImportError(f"{module} calls sys.exit when it is imported") from error
    except ModuleNotFoundError as error:
        raise ImportError(_describe_missing(module, error) + _describe_clash()) from error
    except PluginError as error:
        raise ImportError(error.with_place + _describe_clash()) from error
    found: Any = loaded
    for part in attribute.split("."):
        found = getattr(found, part, None)
    if found is None:
        classes = [name for name, value in vars(loaded).items() if isinstance(value, type)]
        raise ImportError(f"{module} has no class {attribute!r}{nearest(attribute, classes)}")
    if not callable(found):
        raise ImportError(f"{attribute!r} of {module} is of type {type(found).__name__}, not a class or function")
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
    if top in (*_OURS, *sys.stdlib_module_names) and _find_hidden([module]):
        owner = "Understory" if top in _OURS else "Python"
        raise ImportError(f"{top!r} is a module of {owner}, which hides that of the current folder; rename yours")


def _is_dotted(text: str) -> bool:
    """True for identifiers with dots between them."""
    return all(part.isidentifier() for part in text.split("."))


def _find_hidden(names: Iterable[str]) -> list[str]:
    """The names of modules that also exist in the current folder; none if that is our own folder."""
    here = Path.cwd()
    places = {name: here.joinpath(*name.split(".")) for name in names if here != _ROOT}
    return [name for name, place in places.items() if place.is_dir() or place.with_name(f"{place.name}.py").is_file()]


def _describe_clash() -> str:
    """The end of an error message: modules of the current folder that ours hide; empty if there are none."""
    hidden = ", ".join(_find_hidden(_OURS))
    return f"; Understory's packages hide those in the current folder of the names {hidden}" if hidden else ""


def _describe_missing(module: str, error: ModuleNotFoundError) -> str:
    """Error message about a missing module, which is misspelt or needs a module that is not installed."""
    absent = error.name or ""
    if not f"{module}.".startswith(f"{absent}."):
        return f"{module} needs {absent!r}, which is not installed: {error}"
    parent, _, leaf = absent.rpartition(".")
    folders = getattr(importlib.import_module(parent), "__path__", []) if parent else None
    return f"{error}{nearest(leaf, (m.name for m in pkgutil.iter_modules(folders)), cutoff=0.75)}"
