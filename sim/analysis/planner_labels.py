"""Labels of a study's planners: their text, what their texts share, or a name that the user gives."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence

from sim.analysis.cell_text import Cell, Placed, cells_of
from sim.scenario.errors import InputError
from sim.study.row import Row
from tracking.plugins.spelling import did_you_mean

BOUND = ", upper bound"  # follows the label of a planner that sees the truth
_NOTHING: Mapping[str, str] = {}


def planner_labels(
    rows: Sequence[Placed], cells: Sequence[Cell], given: Mapping[str, str] = _NOTHING
) -> dict[str, str]:
    """The label of each planner's text: the text, or what its texts share if each cell has just one of them.

    given: labels that replace these, as from `labels_of`.
    """
    specs: dict[str, dict[str, None]] = defaultdict(dict)
    by_cell: dict[tuple[Cell, str], set[str]] = defaultdict(set)
    for row, cell in zip(rows, cells, strict=True):
        name = _parts(row.planner)[0]
        specs[name][row.planner] = None
        by_cell[cell, name].add(row.planner)
    ambiguous = {name for (_, name), texts in by_cell.items() if len(texts) > 1}
    bounds = {row.planner for row in rows if isinstance(row, Row) and row.metrics.get("sees_truth")}
    labels = {
        text: text if name in ambiguous or len(texts) == 1 else _shared(name, list(texts))
        for name, texts in specs.items()
        for text in texts
    }
    return {text: given.get(label, label) + BOUND * (text in bounds) for text, label in labels.items()}


def _parts(planner: str) -> tuple[str, list[str]]:
    """Name and options of a planner's text."""
    name, _, rest = planner.partition("(")
    inside = rest.strip().removesuffix(")")
    return name.strip(), [part.strip() for part in re.split(r",(?![^(\[{]*[)\]}])", inside) if part.strip()]


def _shared(name: str, planners: Sequence[str]) -> str:
    options = [_parts(planner)[1] for planner in planners]
    common = [option for option in options[0] if all(option in other for other in options)]
    return f"{name}({', '.join(common)})" if common else name


def baseline_of(rows: Sequence[Placed], baseline: str | None, given: Mapping[str, str] = _NOTHING) -> str:
    """The label of the baseline, named by label, by text or by name; of the first row's planner if None.

    InputError where there is none such. Trials that are yet to be flown serve as well as rows.
    """
    if not rows:
        raise InputError("study: it has no trials to compare")
    labels = planner_labels(rows, cells_of(rows), given)
    return labels[rows[0].planner] if baseline is None else _named(labels, baseline, "--baseline")


def labels_of(rows: Sequence[Placed], asked: Sequence[str]) -> dict[str, str]:
    """Labels that the user gives as "label=planner", by those that they replace; InputError where one cannot be."""
    labels = planner_labels(rows, cells_of(rows))
    found: dict[str, str] = {}
    for text in asked:
        label, equals, planner = (part.strip() for part in text.partition("="))
        if not equals or not label or not label.isprintable() or not planner:
            raise InputError(f"--label: {text!r} is not of the form label=planner")
        found[_named(labels, planner, "--label")] = label
    shown = [found.get(label, label) for label in dict.fromkeys(labels.values())]
    for label in shown:
        if shown.count(label) > 1:
            raise InputError(f"--label: {label!r} would stand for two planners")
    return found


def _named(labels: dict[str, str], baseline: str, option: str) -> str:
    known = list(dict.fromkeys(labels.values()))
    named = [label for label in known if _parts(label.removesuffix(BOUND))[0] == baseline]
    if baseline in known:
        return baseline
    if baseline in labels:
        return labels[baseline]
    if len(named) == 1:
        return named[0]
    raise InputError(f"{option}: {baseline!r} is none of the study's planners; {did_you_mean(baseline, known)}")


def short_labels(labels: Sequence[str]) -> dict[str, str]:
    """Labels for a narrow table: without options that all planners of one name share, and without modules.

    A label stays as it is where two would look alike.
    """
    options = {label: _parts(label.removesuffix(BOUND)) for label in labels}
    shorts = {}
    for label, (name, own) in options.items():
        alike = [other for base, other in options.values() if base == name]
        telling = [option for option in own if not all(option in other for other in alike)]
        last = name.rpartition(":")[2]
        shorts[label] = (f"{last}({', '.join(telling)})" if telling else last) + BOUND * label.endswith(BOUND)
    found = list(shorts.values())
    return {label: short if found.count(short) == 1 else label for label, short in shorts.items()}
