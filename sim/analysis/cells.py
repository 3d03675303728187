"""The trials of a study by cell and planner, and which of them share a map."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from sim.scenario.errors import InputError
from sim.scenario.loading import did_you_mean
from sim.scenario.random_streams import numbered
from sim.study.row import Row
from tracking.numerics.compiled import Array

Cell = tuple[tuple[str, str], ...]  # name and value of what varies over the study
SYMBOLS = {"lambda": "λ"}
BOUND = ", upper bound"  # follows the name of a planner that sees the truth


class Placed(Protocol):
    """What has a place in a study: a row, or a trial that is yet to be flown."""

    @property
    def scenario(self) -> str:
        """Name or file."""

    @property
    def version(self) -> str:
        """Of the package."""

    @property
    def factors(self) -> Cell:
        """Names and values."""

    @property
    def planner(self) -> str:
        """As given."""


@dataclass(frozen=True, eq=False)
class Group:
    """All trials of one planner in one cell, by seed and repeat."""

    cell: Cell
    planner: str  # without the options that vary with the cell
    done: tuple[Row, ...]
    failed: tuple[Row, ...]

    def values(self, metric: str) -> Array:
        """The metric of each trial done (n,); NaN where it is undefined."""
        return np.array([row.metrics.get(metric, np.nan) for row in self.done], dtype=float)

    @property
    def ospa(self) -> Array:
        """OSPA of all scans of all trials together (N,) m."""
        return np.concatenate([np.zeros(0), *(row.ospa for row in self.done)])

    @property
    def curves(self) -> tuple[Array, Array]:
        """Times (T,) s and OSPA (n, T) m of each trial; a mission that is shorter than the longest ends in NaN."""
        times = max((row.times for row in self.done), key=len, default=np.zeros(0))
        found = np.full((len(self.done), len(times)), np.nan)
        for curve, row in zip(found, self.done, strict=True):
            curve[: len(row.ospa)] = row.ospa
        return times, found


def grouped(rows: Sequence[Row], baseline: str | None = None) -> list[Group]:
    """Every cell's groups, the baseline's first; cells and other planners in natural order, however rows are ordered.

    A planner that varies with the cell, such as sma-nbo(horizon=3) where H = 3, goes by what its texts share.
    ValueError where a trial is there twice.
    """
    cells = cells_of(rows)
    labels = planner_labels(rows, cells)
    first = None if baseline is None else _named(labels, baseline)
    found: dict[tuple[Cell, str], dict[tuple[int, int], Row]] = defaultdict(dict)
    for row, cell in zip(rows, cells, strict=True):
        group = found[cell, labels[row.planner]]
        flight = row.seed, row.repeat
        if flight in group:
            raise ValueError(f"{row.planner}, {numbered(*flight)} is there twice{_where(cell)}")
        group[flight] = row
    order = sorted(found, key=lambda key: (_natural_cell(key[0]), key[1] != first, _natural(key[1])))
    return [_group(*key, found[key]) for key in order]


def cells_of(rows: Sequence[Placed]) -> list[Cell]:
    """The cell of each row; scenario and version count as factors where the rows differ in them."""
    differing = [name for name in ("scenario", "version") if len({getattr(row, name) for row in rows}) > 1]
    return [(*((name, getattr(row, name)) for name in differing), *row.factors) for row in rows]


def _group(cell: Cell, planner: str, rows: dict[tuple[int, int], Row]) -> Group:
    ordered = [rows[flight] for flight in sorted(rows)]
    parts = (tuple(row for row in ordered if (row.status == "done") == wanted) for wanted in (True, False))
    return Group(cell, planner, *parts)


def _where(cell: Cell) -> str:
    return f" in {cell_text(cell)}" if cell else ""


def planner_labels(rows: Sequence[Placed], cells: Sequence[Cell]) -> dict[str, str]:
    """What each planner is called: its text, or what its texts share if each cell has just one of them."""
    specs: dict[str, dict[str, None]] = defaultdict(dict)
    by_cell: dict[tuple[Cell, str], set[str]] = defaultdict(set)
    for row, cell in zip(rows, cells, strict=True):
        name = _parts(row.planner)[0]
        specs[name][row.planner] = None
        by_cell[cell, name].add(row.planner)
    ambiguous = {name for (_, name), texts in by_cell.items() if len(texts) > 1}
    bounds = {row.planner for row in rows if isinstance(row, Row) and row.metrics.get("sees_truth")}
    return {
        text: (text if name in ambiguous or len(texts) == 1 else _shared(name, list(texts))) + BOUND * (text in bounds)
        for name, texts in specs.items()
        for text in texts
    }


def _parts(planner: str) -> tuple[str, list[str]]:
    """Name and options of a planner's text."""
    name, _, rest = planner.partition("(")
    inside = rest.strip().removesuffix(")")
    return name.strip(), [part.strip() for part in re.split(r",(?![^(\[{]*[)\]}])", inside) if part.strip()]


def _shared(name: str, planners: Sequence[str]) -> str:
    options = [_parts(planner)[1] for planner in planners]
    common = [option for option in options[0] if all(option in other for other in options)]
    return f"{name}({', '.join(common)})" if common else name


def baseline_of(rows: Sequence[Placed], baseline: str | None) -> str:
    """The label of the baseline, given as label, as text or by name; of the first row's planner if None.

    InputError where there is none such. Trials that are yet to be flown serve as well as rows.
    """
    if not rows:
        raise InputError("study: it has no trials to compare")
    labels = planner_labels(rows, cells_of(rows))
    return labels[rows[0].planner] if baseline is None else _named(labels, baseline)


def _named(labels: dict[str, str], baseline: str) -> str:
    known = list(dict.fromkeys(labels.values()))
    named = [label for label in known if _parts(label.removesuffix(BOUND))[0] == baseline]
    if baseline in known:
        return baseline
    if baseline in labels:
        return labels[baseline]
    if len(named) == 1:
        return named[0]
    raise InputError(f"--baseline: {baseline!r} is none of the study's planners; {did_you_mean(baseline, known)}")


def _natural(text: str) -> tuple[tuple[int, float, str], ...]:
    """A key that sorts 5 before 15 and numbers before words."""
    parts = re.findall(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|[^\d]+", text)
    return tuple((0, float(p), "") if re.fullmatch(r"[-+]?\d.*", p) else (1, 0.0, p) for p in parts)


def _natural_cell(cell: Cell) -> tuple[tuple[str, tuple[tuple[int, float, str], ...]], ...]:
    return tuple((name, _natural(value)) for name, value in cell)


def varying(groups: Sequence[Group]) -> dict[str, list[str]]:
    """The factors that take several values over the groups, and these in order."""
    values: dict[str, dict[str, None]] = defaultdict(dict)
    for group in groups:
        for name, value in group.cell:
            values[name][value] = None
    return {name: sorted(found, key=_natural) for name, found in values.items() if len(found) > 1}


def constant(groups: Sequence[Group]) -> Cell:
    """The factors that have the same value in all groups."""
    changing = varying(groups)
    return tuple((name, value) for name, value in groups[0].cell if name not in changing)


def trimmed(groups: Sequence[Group]) -> list[Group]:
    """The groups, their cells without the factors that are the same everywhere."""
    same = constant(groups)
    return [replace(g, cell=tuple(factor for factor in g.cell if factor not in same)) for g in groups]


def cell_text(cell: Cell) -> str:
    """A cell as people read it."""
    return ", ".join(f"{SYMBOLS.get(name, name)} = {value}" for name, value in cell)
