"""Loading of planners by name or import string, with options, and their errors in one line each."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Mapping
from importlib.machinery import PathFinder
from typing import TYPE_CHECKING, Any, cast

from planning.planner_text import split_options
from planning.registry import PlannerSpec, installed_planners, parameters_of
from tracking.errors import InputError, nearest
from tracking.plugins.registry import Registry, import_plugin

if TYPE_CHECKING:  # naming planners needs none of their code
    from planning.planner import Planner


class PlannerError(InputError):
    """Failure of a planner, wherever it is called."""


# Errors of planners of any origin read alike. `load_planner` finds names and classes.
ANY_PLANNER = Registry("planner", {}, ("plan(team, rng)",), raises=PlannerError)


def load_planner(text: str) -> Planner:
    """The planner "name" or "name(option=value, ...)"; the name may be an import string "package.module:Class".

    InputError if the text is malformed, names no planner or has wrong options, or if making the planner fails.
    """
    name, options = _parsed(text)
    spec = _spec(name)
    make = _import(name, spec)
    with ANY_PLANNER.errors(name, "be made", passing=(InputError,)):
        _check(name, make, options)
    with ANY_PLANNER.errors(name, "be made", make, "__init__"):
        planner = make(**{**spec.options, **options})
    return checked_planner(planner, name)


def checked_planner(planner: object, name: str) -> Planner:
    """The planner of that name; InputError unless it has the method plan(team, rng)."""
    ANY_PLANNER.check_methods(name, planner)
    return cast("Planner", planner)


def canonical_text(text: str) -> str:
    """Text that all spellings of a planner share: its import string and the sorted options that differ from defaults.

    InputError if there is no such planner.
    """
    name, options = _parsed(text)
    spec = _spec(name)
    make = _import(name, spec)
    with ANY_PLANNER.errors(name, "tell its options"):
        defaults = {key: parameter.default for key, parameter in (parameters_of(make) or {}).items()}
        told = []
        for key, value in sorted({**spec.options, **options}.items()):
            default = defaults.get(key)
            given = repr(float(value) if type(value) is int and type(default) is float else value)
            if given != repr(default):
                told.append(f"{key}={given}")
    return f"{spec.target}({', '.join(told)})"


def planner_target(text: str) -> str:
    """Import string of the class or function that makes a planner; InputError if there is no planner of that name."""
    return _spec(_parsed(text)[0]).target


def _spec(name: str) -> PlannerSpec:
    if name in installed_planners():
        return installed_planners()[name]
    if ":" in name:
        return PlannerSpec(name)
    allowed = f"allowed are {', '.join(installed_planners())}, or package.module:Class"
    raise InputError(f"planner: {name!r} is unknown; {allowed}{_meant(name)}")


def _meant(name: str) -> str:
    """Hint for an unknown name: the nearest planner, or the import string if the name is that of a module or class."""
    module, _, last = name.rpartition(".")
    if module and (last == "py" or last[:1].isupper()):
        return f"; did you mean {module}:{'Class' if last == 'py' else last}?"
    near = nearest(name, installed_planners())
    if not near and (module or (name.isidentifier() and PathFinder.find_spec(name))):
        return f"; did you mean {name}:Class?"
    return near


def _parsed(text: str) -> tuple[str, dict[str, Any]]:
    """Name and options of "name(option=value, ...)"; values are Python literals or bare words."""
    if not isinstance(text, str):
        raise InputError(f"planner: {text!r} is not allowed; expected text, a name or module:Class")
    if "(" in text and not text.strip().endswith(")"):
        raise InputError(f"planner: {text!r} is not of the form name(option=value, ...)")
    name, parts = split_options(text)
    options: dict[str, Any] = {}
    for part in parts:
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not key.isidentifier() or not value:
            raise InputError(f"planner: {text!r} is not of the form name(option=value, ...)")
        if key in options:
            raise InputError(f"planner: {text!r} has the option {key!r} more than once; allowed is once")
        options[key] = _value(value)
    return name, options


def _value(text: str) -> Any:  # noqa: ANN401 - any literal
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a bare word need not be valid Python
            return ast.literal_eval(text)
    except (ValueError, SyntaxError, RecursionError, MemoryError):  # MemoryError: hundreds of brackets
        return text


def _check(name: str, make: Any, options: Mapping[str, Any]) -> None:  # noqa: ANN401 - whatever a user's module holds
    """Raise InputError if the planner lacks an option, or if the option's default is of another kind."""
    parameters = parameters_of(make)
    if parameters is None or any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        return
    for option, value in options.items():
        if option not in parameters:
            allowed = f"allowed are {', '.join(parameters)}" if parameters else "it has none"
            raise InputError(f"planner: {name!r} has no option {option!r}; {allowed}{nearest(option, parameters)}")
        kind = _kind(parameters[option].default)
        if kind and kind != _kind(value):
            raise InputError(f"planner: option {option} of {name!r} must be {kind}, is {value!r}")


def _kind(value: object) -> str:
    """Kind of value that an option with this default takes; empty if any."""
    if isinstance(value, bool):
        return "True or False"
    if isinstance(value, int | float):
        return "a number"
    return "a word" if isinstance(value, str) else ""


def _import(name: str, spec: PlannerSpec) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return import_plugin(spec.target)
    except ImportError as error:
        what = f"{name!r} of {spec.source}, {spec.target!r}," if spec.source else repr(spec.target)
        raise InputError(f"planner: {what} cannot be imported: {error}") from error
