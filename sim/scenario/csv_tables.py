"""Tables in CSV files: their rows by column, and errors that name file, line and column."""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sim.scenario.quantities import parse_number
from sim.scenario.text_files import read_text
from tracking.errors import InputError

MOST_BYTES = 2**28  # largest size of a file, enough for rows at 10 Hz for as long as people may walk
_MOST_LINES = 2**23  # lines of a file, which take a few gigabytes during reading
_DIGITS = 18  # most digits of an integer, so that it fits into 64 bits


@dataclass(frozen=True)
class Row:
    """One row of a table."""

    where: str  # file and line, with which errors begin
    line: int
    values: Mapping[str, str]  # by column

    def error(self, column: str, what: str) -> InputError:
        """An error about the entry in a column."""
        return InputError(f"{self.where}, column {column}: {what}")

    def text(self, column: str) -> str:
        """The entry in a column; InputError if it is empty."""
        found = self.values[column]
        if not found:
            raise self.error(column, "is empty")
        return found

    def number(self, column: str) -> float:
        """A finite number; InputError if the entry is none."""
        found = self.text(column)
        value = parse_number(found)
        if not math.isfinite(value):
            raise self.error(column, f"{found!r} is not a finite number")
        return value

    def integer(self, column: str) -> int:
        """An integer, 0 or more; InputError if the entry is none."""
        found = self.text(column)
        if not (found.isascii() and found.isdigit()):
            raise self.error(column, f"{found!r} is not an integer, 0 or more")
        if len(found) > _DIGITS:
            raise self.error(column, f"an integer of {len(found)} digits; at most {_DIGITS} are allowed")
        return int(found)


def read_csv(path: Path, field: str, columns: Sequence[str], aliases: Mapping[str, str] | None = None) -> Iterator[Row]:
    """Rows of a CSV file that has these columns once each, and maybe others; empty lines are skipped.

    aliases: other names of columns. InputError begins with `field` and names file, line and column.
    """
    name = f"{field}: {path}"
    found = read_text(path, field, MOST_BYTES)
    if not found.strip():
        raise InputError(f"{name}: is empty; its first line must name the columns {','.join(columns)}")
    table = csv.reader(io.StringIO(found, newline=""))
    try:
        header = [(aliases or {}).get(column.strip(), column.strip()) for column in next(table)]
        for column in columns:
            if header.count(column) != 1:
                what = "twice" if column in header else "missing"
                raise InputError(f"{name}, line 1: column {column} is {what}; columns are {','.join(header) or 'none'}")
        for entries in table:
            where = f"{name}, line {table.line_num}"
            if table.line_num > _MOST_LINES:
                raise InputError(f"{where}: has more than the {_MOST_LINES} lines that are allowed")
            if entries and len(entries) != len(header):
                raise InputError(f"{where}: has {len(entries)} entries, not {len(header)} as line 1")
            if entries:
                yield Row(where, table.line_num, dict(zip(header, map(str.strip, entries), strict=True)))
    except csv.Error as error:  # an entry is longer than Python's reader allows
        raise InputError(f"{name}, line {table.line_num}: {error}") from error
