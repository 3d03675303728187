"""Labels of what a study compares, planners and trackers: their text, what texts share, or the user's name."""

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence

from planning.planner_text import split_options, with_options
from sim.analysis.cell_text import Cell, Placed, cells_of
from sim.study.cells import ENTERED, TRACKER, VIEW
from sim.study.tasks import Row
from tracking.plugins.registry import InputError
from tracking.plugins.spelling import did_you_mean

BOUND = ", upper bound"  # follows the label of a planner that sees the truth
Key = tuple[str, str]


def entrant(row: Placed) -> str:
    """Text of what a trial enters in a comparison: its planner, with its tracker or view where the study has them."""
    return with_options(row.planner, _entered(row))


def planner_labels(rows: Sequence[Placed], given: Mapping[str, str] = {}) -> dict[str, str]:
    """The label of each entrant, with a remark if it is an upper bound; given: the user's, as from `labels_of`."""
    flown = [row for row in rows if isinstance(row, Row)]
    bounds = {entrant(row) for row in flown if row.metrics.get("sees_truth") or VIEW in dict(row.factors)}
    return {text: given.get(label, label) + BOUND * (text in bounds) for text, label in _own_labels(rows).items()}


def _own_labels(rows: Sequence[Placed]) -> dict[str, str]:
    """Of each entrant its text, or what the texts of its planner share if each cell has just one of them."""
    texts: dict[Key, dict[str, set[Cell]]] = defaultdict(dict)  # of each planner, with the cells that they fly in
    for row, cell in zip(rows, cells_of(rows), strict=True):
        texts[_key(row)].setdefault(row.planner, set()).add(cell)
    shared = {}
    for key, flies in texts.items():
        places = [cell for own in flies.values() for cell in own]
        if len(flies) > 1 and len(set(places)) == len(places):
            shared[key] = _shared(key[0], list(flies))
    return {entrant(row): with_options(shared.get(_key(row), row.planner), _entered(row)) for row in rows}


def _entered(row: Placed) -> dict[str, str]:
    """The tracker and the view as options of the planner; empty unless the study has them."""
    return {name: level for name, level in row.factors if name in ENTERED}


def _key(row: Placed) -> Key:
    return split_options(row.planner)[0], ", ".join(_entered(row).values())


def _shared(name: str, planners: Sequence[str]) -> str:
    options = [split_options(planner)[1] for planner in planners]
    common = [option for option in options[0] if all(option in other for other in options)]
    return f"{name}({', '.join(common)})" if common else name


def baseline_of(
    rows: Sequence[Placed], baseline: str | None, given: Mapping[str, str] = {}, option: str = "--baseline"
) -> str:
    """The label of the baseline, named by label, text, or name of planner or tracker; of the first row if None.

    InputError about the option where there is none such. Trials that are yet to be flown serve as well as rows.
    """
    if not rows:
        raise InputError("study: it has no trials to compare")
    own, shown = _own_labels(rows), planner_labels(rows, given)
    if baseline is None:
        return shown[entrant(rows[0])]
    meant = _named(own, baseline.removesuffix(BOUND), option, given)
    return next(shown[text] for text, label in own.items() if label == meant)


def labels_of(rows: Sequence[Placed], asked: Sequence[str]) -> dict[str, str]:
    """Labels that the user gives as "label=planner", by those that they replace; InputError where one cannot be."""
    labels = _own_labels(rows)
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


def _named(labels: Mapping[str, str], asked: str, option: str, given: Mapping[str, str] = {}) -> str:
    """The label that is asked for by the user's label for it, by itself, a text, or name of planner or tracker."""
    own = {label: label for label in labels.values()}
    shown = {given.get(label, label): label for label in own}
    exact = {**labels, **own, **shown}
    if asked in exact:
        return exact[asked]
    parts = {label: split_options(label) for label in own}
    named = [label for label, (name, options) in parts.items() if name == asked or f"{TRACKER}={asked}" in options]
    if len(named) == 1:
        return named[0]
    if named:
        raise InputError(f"{option}: {asked!r} stands for several of the study's planners: {', '.join(named)}")
    raise InputError(f"{option}: {asked!r} is not one of the study's planners; {did_you_mean(asked, shown)}")


def short_labels(labels: Sequence[str]) -> dict[str, str]:
    """Labels for a narrow table: without options that all planners of one name share, and without modules.

    Trackers of a single planner go by their own names. A label stays as it is where two would look alike.
    """
    options = {label: split_options(label.removesuffix(BOUND)) for label in labels}
    tracker = f"{TRACKER}="
    single = len({(name, *(o for o in own if not o.startswith(tracker))) for name, own in options.values()}) == 1
    shorts = {}
    for label, (name, own) in options.items():
        alike = [other for base, other in options.values() if base == name]
        telling = [option for option in own if not all(option in other for other in alike)]
        telling = [re.sub(f"^({tracker}).*:", r"\1", option) for option in telling]
        last = name.rpartition(":")[2]
        short = f"{last}({', '.join(telling)})" if telling else last
        alone = single and telling and telling[-1].startswith(tracker)
        shorts[label] = (telling[-1].partition("=")[2] if alone else short) + BOUND * label.endswith(BOUND)
    found = list(shorts.values())
    return {label: short if found.count(short) == 1 else label for label, short in shorts.items()}
