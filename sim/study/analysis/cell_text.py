"""Cells of a study: a name and a value for each factor, and their text."""

import re
from collections.abc import Sequence

from sim.study.cells import COMPARED_FACTORS, Levels
from sim.study.trials import TrialPlace

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
