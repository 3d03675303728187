"""Loading of planners by name or import string, with options; errors of planners are one line each."""

import ast
import warnings
from collections.abc import Callable, Mapping
from importlib.machinery import PathFinder
from typing import Any, cast

from planning.catalogue import PlannerSpec, find_planners, import_planner, list_parameters
from planning.planner import Exchange, Planner
from tracking.errors import InputError, nearest
from tracking.numerics.arrays import Array
from tracking.plugins.plugin_error import Unusable
from tracking.plugins.registry import Registry

TruePositions = Callable[[float], Array]  # (M, 2) m of people at a time [s]; NaN while absent


class PlannerError(InputError):
    """Failure of a planner, wherever it is called."""


# Errors of planners of any origin read alike. `load_planner` finds names and classes.
ANY_PLANNER = Registry("planner", {}, ("plan(team, rng)",), raises=PlannerError)


def load_planner(text: str) -> Planner:
    """The planner "name" or "name(option=value, ...)"; the name may be an import string "package.module:Class".

    InputError if the text is malformed, names no planner or has wrong options, or if making the planner fails.
    """
    name, options = _parse(text)
    spec = _find_spec(name)
    make = _import(name, spec)
    _check_options(name, make, options)
    return make_planner(make, name, {**spec.options, **options})


def make_planner(make: Callable[..., object], name: str, options: Mapping[str, Any]) -> Planner:
    """The planner that a class or function makes; InputError about the planner of that name if it fails."""
    with ANY_PLANNER.errors(name, "be made", make, "__init__"):
        planner = make(**options)
    return cast("Planner", ANY_PLANNER.check_methods(name, planner))


def resolve_planner(given: object) -> Planner:
    """The planner that is given as text for `load_planner` or as an object; InputError if it is no planner."""
    if isinstance(given, str):
        return load_planner(given)
    if isinstance(given, type):
        raise InputError(f"planner: {given.__qualname__} is a class; give an object of it")
    return cast("Planner", ANY_PLANNER.check_methods(type(given).__qualname__, given))


def make_canonical_text(text: str) -> str:
    """Text that all spellings of a planner share: its import string and the sorted options that differ from defaults.

    InputError if there is no such planner.
    """
    name, options = _parse(text)
    spec = _find_spec(name)
    defaults = {key: parameter.default for key, parameter in (list_parameters(_import(name, spec)) or {}).items()}
    told = []
    for key, value in sorted({**spec.options, **options}.items()):
        default = defaults.get(key)
        given = repr(float(value) if type(value) is int and type(default) is float else value)
        if given != repr(default):
            told.append(f"{key}={given}")
    return f"{spec.target}({', '.join(told)})"


def find_planner_target(text: str) -> str:
    """Import string of the class or function that makes a planner; InputError if there is no planner of that name."""
    return _find_spec(_parse(text)[0]).target


def split_options(text: str) -> tuple[str, list[str]]:
    """Name and parts of "name(part, ...)"; commas in brackets or quotes separate nothing.

    If brackets or quotes do not match, all of the options are one part, which begins with a bracket.
    """
    name, _, rest = text.strip().partition("(")
    parts, depth, quote = [""], 0, ""
    for sign in rest.removesuffix(")"):
        if quote:
            quote = quote if sign != quote else ""
        elif sign in "'\"":
            quote = sign
        else:
            depth += (sign in "([{") - (sign in ")]}")
        if sign == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += sign
    if depth or quote:
        parts = [f"({rest}"]
    return name.strip(), [part.strip() for part in parts if part.strip()]


def add_options(planner: str, options: Mapping[str, str]) -> str:
    """The text of a planner with further options."""
    if not options:
        return planner
    name, parts = split_options(planner)
    return f"{name}({', '.join([*parts, *(f'{key}={value}' for key, value in options.items())])})"


def read_exchange(planner: object) -> Exchange:
    """The exchange of plans that a planner declares, else `Exchange()`; InputError if the declaration is wrong."""
    with ANY_PLANNER.errors(type(planner).__qualname__, "say what it sends", planner, "exchange"):
        exchange = getattr(planner, "exchange", Exchange())
        if not isinstance(exchange, Exchange):
            raise Unusable(f"exchange must be an Exchange, is {exchange!r}")
    return exchange


def give_truth(planner: Planner | None, people: TruePositions) -> tuple[Planner | None, bool]:
    """The planner to fly, and True if it is an oracle, which its method `knowing` makes from the true positions.

    InputError if `knowing` fails.
    """
    knowing = getattr(planner, "knowing", None)
    if knowing is None:
        return planner, False
    name = type(planner).__qualname__
    with ANY_PLANNER.errors(name, "be given the truth by its method `knowing`", planner, "knowing"):
        informed = knowing(people)
        if not callable(getattr(informed, "plan", None)):
            raise Unusable("what it returns has no method plan(team, rng)")
    return cast("Planner", informed), True


def reset_planner(planner: object, seed: int) -> None:
    """Reset a planner if it is stateful; InputError if that fails."""
    ANY_PLANNER.reset(type(planner).__qualname__, planner, seed)


def _find_spec(name: str) -> PlannerSpec:
    planners = find_planners()
    if name in planners:
        return planners[name]
    if ":" in name:
        return PlannerSpec(name)
    allowed = f"allowed are {', '.join(planners)}, or package.module:Class"
    raise InputError(f"planner: {name!r} is unknown; {allowed}{_suggest_planner(name)}")


def _suggest_planner(name: str) -> str:
    """A hint for an unknown name: an import string if it looks like a module or class, else a similar planner."""
    module, _, last = name.rpartition(".")
    if module and (last == "py" or last[:1].isupper()):
        return f"; did you mean {module}:{'Class' if last == 'py' else last}?"
    near = nearest(name, find_planners())
    if not near and (module or (name.isidentifier() and PathFinder.find_spec(name))):
        return f"; did you mean {name}:Class?"
    return near


def _parse(text: str) -> tuple[str, dict[str, Any]]:
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
        options[key] = _parse_value(value)
    return name, options


def _parse_value(text: str) -> Any:  # noqa: ANN401 - any literal
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a bare word need not be valid Python
            return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


def _check_options(name: str, make: Any, options: Mapping[str, Any]) -> None:  # noqa: ANN401 - a user's class
    """Raise InputError if the planner lacks an option, or if the option's default is of another kind."""
    parameters = list_parameters(make)
    if parameters is None or any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        return
    for option, value in options.items():
        if option not in parameters:
            allowed = f"allowed are {', '.join(parameters)}" if parameters else "it has none"
            raise InputError(f"planner: {name!r} has no option {option!r}; {allowed}{nearest(option, parameters)}")
        kind = _name_kind(parameters[option].default)
        if kind and kind != _name_kind(value):
            raise InputError(f"planner: option {option} of {name!r} must be {kind}, is {value!r}")


def _name_kind(value: object) -> str:
    """Kind of value that an option with this default takes; empty if any."""
    if isinstance(value, bool):
        return "True or False"
    if isinstance(value, int | float):
        return "a number"
    return "a word" if isinstance(value, str) else ""


def _import(name: str, spec: PlannerSpec) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return import_planner(spec)
    except ImportError as error:
        what = f"{name!r} of {spec.source}, {spec.target!r}," if spec.source else repr(spec.target)
        raise InputError(f"planner: {what} cannot be imported: {error}") from error
