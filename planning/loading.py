"""Planners loaded by name, with options, or by import string, and their errors, each told in one line."""

from __future__ import annotations

import ast
import inspect
import warnings
from collections.abc import Mapping
from importlib.machinery import PathFinder
from typing import TYPE_CHECKING, Any, cast

from planning.planner_text import split_options
from planning.registry import PlannerSpec, installed_planners
from tracking.plugins.registry import InputError, Registry, imported, lack
from tracking.plugins.spelling import nearest

if TYPE_CHECKING:  # naming planners needs none of their code
    from planning.planner import Planner


class PlannerError(InputError):
    """The planner fails, wherever it is called."""


# A planner of any origin: its errors are all told alike. Names and classes are found by `load_planner`.
ANY_PLANNER = Registry("planner", {}, ("plan(team, rng)",), raises=PlannerError)


def load_planner(text: str) -> Planner:
    """The planner "name" or "name(option=value, ...)"; the name may be an import string "package.module:Class".

    InputError says what is wrong.
    """
    name, options = _parsed(text)
    spec = _spec(name)
    make = _import(name, spec)
    with ANY_PLANNER.errors(name, "be made", InputError):
        _check(name, make, options)
    with ANY_PLANNER.errors(name, "be made", called=(make, "__init__")):
        planner = make(**{**spec.options, **options})
    return checked_planner(planner, name)


def checked_planner(planner: object, name: str) -> Planner:
    """The planner, which has that name; InputError unless it has the method plan(team, rng)."""
    with ANY_PLANNER.errors(name, "be made"):
        lacking = lack(name, planner, *ANY_PLANNER.methods)
    if lacking:
        raise InputError(f"planner: {lacking}")
    return cast("Planner", planner)


def canonical_text(text: str) -> str:
    """The same text for all spellings of a planner: its import string and, in order, options that are no defaults.

    InputError if there is no such planner.
    """
    name, options = _parsed(text)
    spec = _spec(name)
    make = _import(name, spec)
    with ANY_PLANNER.errors(name, "tell its options"):
        defaults = {key: parameter.default for key, parameter in (_parameters(make) or {}).items()}
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
    """The nearest valid name of a planner; for a module or a class in it, how to write that."""
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
            warnings.simplefilter("ignore")  # what is no good Python need be none
            return ast.literal_eval(text)
    except (ValueError, SyntaxError, RecursionError, MemoryError):  # the last of brackets by the hundred
        return text


def _parameters(make: Any) -> Mapping[str, inspect.Parameter] | None:  # noqa: ANN401 - as `_check`
    """Parameters of what makes a planner; None if it does not tell, being written in C, say."""
    try:
        return inspect.signature(make).parameters
    except (TypeError, ValueError):
        return None


def _check(name: str, make: Any, options: Mapping[str, Any]) -> None:  # noqa: ANN401 - whatever a user's module holds
    """InputError if the planner lacks an option, or its default is of another kind."""
    parameters = _parameters(make)
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
    """Kind of value that a default asks for; empty: any."""
    if isinstance(value, bool):
        return "True or False"
    if isinstance(value, int | float):
        return "a number"
    return "a word" if isinstance(value, str) else ""


def _import(name: str, spec: PlannerSpec) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return imported(spec.target)
    except ImportError as error:
        what = f"{name!r} of {spec.source}, {spec.target!r}," if spec.source else repr(spec.target)
        raise InputError(f"planner: {what} cannot be imported: {error}") from error
