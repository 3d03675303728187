"""Catalogue of planners for display: meaning, package and options."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planning.registry import (
    DEFAULT_PLANNER,
    PLANNERS,
    PlannerSpec,
    installed_planners,
    package_of,
    plugin_entry_points,
)
from tracking.plugins.importing import imported

_OURS = "Built in"
_OPTIONS = "Options, each with what it is if not given"


def catalogue() -> dict[str, dict[str, str]]:
    """Planners and their descriptions under a heading for each package, and options under another."""
    groups: dict[str, dict[str, str]] = {_OURS: {name: _summary(name, spec) for name, spec in PLANNERS.items()}}
    options = _ours()
    for point in plugin_entry_points():
        theirs = groups.setdefault(f"From {package_of(point)}", {})
        spec = installed_planners()[point.name]
        if spec.target != point.value or spec.source != package_of(point):
            theirs[point.name] = (
                f"hidden: the name is that of a planner {f'of {spec.source}' * bool(spec.source) or 'built in'}"
            )
            continue
        try:
            theirs[point.name], options[point.name] = _described(point.value)
        except ImportError as error:
            theirs[point.name] = f"cannot be used: {error}"
    return groups | {_OPTIONS: {name: text for name, text in options.items() if text}}


def _summary(name: str, spec: PlannerSpec) -> str:
    marks = ["default"] * (name == DEFAULT_PLANNER) + ["upper bound: knows what no UAV can"] * spec.upper_bound
    return " ".join([spec.summary, *(f"({mark})" for mark in marks)])


def _ours() -> dict[str, str]:
    """Options of the built-in planners; of a class that came before, only those that differ."""
    first: dict[str, str] = {}
    options: dict[str, dict[str, Any]] = {}
    found: dict[str, str] = {}
    for name, spec in PLANNERS.items():
        like = first.setdefault(spec.target, name)
        options[name] = _written(spec.target) | dict(spec.options)
        if like == name:
            found[name] = _text(options[name])
        else:
            other = {option: value for option, value in options[name].items() if value != options[like][option]}
            found[name] = f"those of {like}, with {_text(other)}" if other else f"those of {like}"
    return found


def _written(target: str) -> dict[str, Any]:
    """Options of a built-in class, read from its source, inherited ones first; importing it would take a second."""
    module, _, name = target.partition(":")
    path = Path(__file__).parents[1].joinpath(*module.split(".")).with_suffix(".py")
    body = ast.parse(path.read_text(encoding="utf-8")).body
    homes = {a.name: node.module or module for node in body if isinstance(node, ast.ImportFrom) for a in node.names}
    (found,) = [node for node in body if isinstance(node, ast.ClassDef) and node.name == name]
    options: dict[str, Any] = {}
    for base in map(ast.unparse, found.bases):
        options |= _written(f"{homes.get(base, module)}:{base}")
    for node in found.body:
        if isinstance(node, ast.AnnAssign) and node.value and "ClassVar" not in ast.unparse(node.annotation):
            options[ast.unparse(node.target)] = ast.literal_eval(node.value)
    return options


def _described(target: str) -> tuple[str, str]:
    """First line of the docstring of another package's class, and its options; ImportError if it cannot be imported."""
    made = imported(target)
    text = inspect.getdoc(made) or ""
    try:
        parameters = dict(inspect.signature(made).parameters)
    except (TypeError, ValueError):  # written in C, say
        parameters = {}
    options = {p.name: p.default for p in parameters.values() if p.default is not p.empty}
    return text.partition("\n")[0], _text(options)


def _text(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value if str(value) else repr(value)}" for name, value in options.items())
