"""Texts of cells, and labels of the planners and trackers that a study compares."""

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence

from planning.catalogue import PLANNERS
from planning.planner_loading import add_options, split_options
from sim.study.cells import COMPARED_FACTORS, TRACKER, VIEW, Levels
from sim.study.trials import TrialPlace, TrialRow
from tracking.errors import InputError, did_you_mean

SYMBOLS = {"lambda": "λ"}


def cells_of(rows: Sequence[TrialPlace]) -> list[Levels]:
    """The cell of each row; scenario and version are factors, too, if the rows differ in them."""
    differing = [name for name in ("scenario", "version") if len({getattr(row, name) for row in rows}) > 1]
    found = [
        (*((name, getattr(row, name)) for name in differing if name not in dict(row.factors)), *row.factors)
        for row in rows
    ]
    return [tuple(factor for factor in cell if factor[0] not in COMPARED_FACTORS) for cell in found]


def cell_text(cell: Levels | None) -> str:
    """A cell as text, such as λ = 45, R = 5; None means all cells."""
    if cell is None:
        return "all cells"
    return ", ".join(f"{SYMBOLS.get(name, name)} = {value}" for name, value in cell)


def append_cell(planner: str, cell: Levels | None) -> str:
    """A planner with its cell, if the study has cells: greedy (λ = 45, R = 5)."""
    return planner if cell == () else f"{planner} ({cell_text(cell)})"


def make_slug(text: str) -> str:
    """A text about cells in the form of names of files and anchors: lambda-45-r-5."""
    for name, symbol in SYMBOLS.items():
        text = text.replace(symbol, name)
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


BOUND = ", upper bound"  # end of the label of a planner that sees the truth
Key = tuple[str, str]


def format_entrant(row: TrialPlace) -> str:
    """Text of a trial's entrant in a comparison: its planner, with tracker and view if the study varies them."""
    return add_options(row.planner, _list_entered(row))


def is_entrant_built_in(entrant: str) -> bool:
    """True unless planner or tracker of an entrant, as from `format_entrant`, is the user's or of another package."""
    name, options = split_options(entrant)
    return name in PLANNERS and not any(option.startswith(f"{TRACKER}=") and ":" in option for option in options)


def label_planners(rows: Sequence[TrialPlace], given: Mapping[str, str] = {}) -> dict[str, str]:
    """Label of each entrant, with a remark if it is an upper bound; given: labels from `parse_labels`."""
    flown = [row for row in rows if isinstance(row, TrialRow)]
    bounds = {format_entrant(row) for row in flown if row.metrics.get("sees_truth") or VIEW in dict(row.factors)}
    return {text: given.get(label, label) + BOUND * (text in bounds) for text, label in _make_labels(rows).items()}


def _make_labels(rows: Sequence[TrialPlace]) -> dict[str, str]:
    """Label of each entrant: its text, without options that change from cell to cell.

    A planner has such options if its texts differ from cell to cell, with one text in each cell.
    """
    texts: dict[Key, dict[str, set[Levels]]] = defaultdict(dict)  # texts of each planner, with their cells
    for row, cell in zip(rows, cells_of(rows), strict=True):
        texts[_make_key(row)].setdefault(row.planner, set()).add(cell)
    shared = {}
    for key, flies in texts.items():
        places = [cell for own in flies.values() for cell in own]
        if len(flies) > 1 and len(set(places)) == len(places):
            shared[key] = _join_shared(key[0], list(flies))
    return {
        format_entrant(row): add_options(shared.get(_make_key(row), row.planner), _list_entered(row)) for row in rows
    }


def _list_entered(row: TrialPlace) -> dict[str, str]:
    """Tracker and view of a trial as options of the planner; empty if the study does not vary them."""
    return {name: level for name, level in row.factors if name in COMPARED_FACTORS}


def _make_key(row: TrialPlace) -> Key:
    return split_options(row.planner)[0], ", ".join(_list_entered(row).values())


def _join_shared(name: str, planners: Sequence[str]) -> str:
    options = [split_options(planner)[1] for planner in planners]
    common = [option for option in options[0] if all(option in other for other in options)]
    return f"{name}({', '.join(common)})" if common else name


def find_baseline(
    rows: Sequence[TrialPlace], baseline: str | None, given: Mapping[str, str] = {}, option: str = "--baseline"
) -> str:
    """Label of the baseline, given by label, text, or name of planner or tracker; by default that of the first row.

    rows: trials that were flown or are yet to be flown. InputError about the option if no planner matches.
    """
    if not rows:
        raise InputError("study: it has no trials to compare")
    own = _make_labels(rows)
    shown = label_planners(rows, given)
    if baseline is None:
        return shown[format_entrant(rows[0])]
    meant = _find_named(own, baseline.removesuffix(BOUND), option, given)
    return next(shown[text] for text, label in own.items() if label == meant)


def parse_labels(rows: Sequence[TrialPlace], asked: Sequence[str]) -> dict[str, str]:
    """The user's labels, given as "label=planner", by the labels that they replace; InputError if one is invalid."""
    labels = _make_labels(rows)
    found: dict[str, str] = {}
    for text in asked:
        label, equals, planner = (part.strip() for part in text.partition("="))
        if not equals or not label or not label.isprintable() or not planner:
            raise InputError(f"--label: {text!r} is not of the form label=planner")
        found[_find_named(labels, planner, "--label")] = label
    shown = [found.get(label, label) for label in dict.fromkeys(labels.values())]
    for label in shown:
        if shown.count(label) > 1:
            raise InputError(f"--label: {label!r} would stand for two planners")
    return found


def _find_named(labels: Mapping[str, str], asked: str, option: str, given: Mapping[str, str] = {}) -> str:
    """The label that the user means by a label, by a text, or by the name of a planner or tracker."""
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


def shorten_labels(labels: Sequence[str]) -> dict[str, str]:
    """Labels for a narrow table: modules are left out, and options that planners of one name share, except trackers.

    Trackers of a single planner are labelled by their own names. Labels that would be equal are not shortened.
    """
    options = {label: split_options(label.removesuffix(BOUND)) for label in labels}
    tracker = f"{TRACKER}="
    planners = {(name, *(o for o in own if not o.startswith(tracker))) for name, own in options.values()}
    single = len(planners) == 1 < len(options)
    shorts = {}
    for label, (name, own) in options.items():
        alike = [other for base, other in options.values() if base == name]
        telling = [option for option in own if option.startswith(tracker) or any(option not in of for of in alike)]
        telling = [re.sub(f"^({tracker}).*:", r"\1", option) for option in telling]
        last = name.rpartition(":")[2]
        short = f"{last}({', '.join(telling)})" if telling else last
        alone = single and telling and telling[-1].startswith(tracker)
        shorts[label] = (telling[-1].partition("=")[2] if alone else short) + BOUND * label.endswith(BOUND)
    found = list(shorts.values())
    return {label: short if found.count(short) == 1 else label for label, short in shorts.items()}
