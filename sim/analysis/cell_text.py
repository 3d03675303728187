"""Cells of a study: a name and a value for each factor, their text and their order."""

import re
from collections.abc import Sequence

from sim.study.cells import ENTERED
from sim.study.tasks import Row, Task

Cell = tuple[tuple[str, str], ...]  # name and value of what varies over the study
SYMBOLS = {"lambda": "λ"}
Key = tuple[tuple[int, float, str], ...]
Placed = Row | Task  # or a trial that is yet to be flown


def cells_of(rows: Sequence[Placed]) -> list[Cell]:
    """The cell of each row; scenario and version count as factors where the rows differ in them."""
    differing = [name for name in ("scenario", "version") if len({getattr(row, name) for row in rows}) > 1]
    found = [
        (*((name, getattr(row, name)) for name in differing if name not in dict(row.factors)), *row.factors)
        for row in rows
    ]
    return [tuple(factor for factor in cell if factor[0] not in ENTERED) for cell in found]


def cell_text(cell: Cell | None) -> str:
    """A cell as text, such as λ = 45, R = 5; None: all cells."""
    if cell is None:
        return "all cells"
    return ", ".join(f"{SYMBOLS.get(name, name)} = {value}" for name, value in cell)


def natural(text: str) -> Key:
    """A key that sorts 5 before 15 and numbers before words."""
    parts = re.findall(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|[^\d]+", text)
    return tuple((0, float(p), "") if re.fullmatch(r"[-+]?\d.*", p) else (1, 0.0, p) for p in parts)


def natural_cell(cell: Cell) -> tuple[tuple[str, Key], ...]:
    """A key that sorts cells by their values."""
    return tuple((name, natural(value)) for name, value in cell)
