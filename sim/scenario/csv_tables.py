"""Tables in CSV files: their rows by column, and errors that name file, line and column."""

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from sim.scenario.geo import LATITUDES, LONGITUDES, NOWHERE_ON_THE_MAP, Geo, read_gpx
from sim.scenario.map_features import SUFFIXES, find_degrees, list_places, load_features
from sim.scenario.quantities import ISO_TIME, parse_iso_time, parse_number
from sim.scenario.text_files import read_text
from tracking.errors import InputError
from tracking.numerics.arrays import Array

MOST_BYTES = 2**28  # largest size of a file, enough for rows at 10 Hz for as long as people may walk
_MOST_LINES = 2**23  # lines of a file, which take a few gigabytes during reading
_MISSING = ("", "NA", "N/A", "NAN", "NULL", "-")  # what statistics programs and people write for a missing value
_SHOWN = 3  # errors of a table that one message names
_DIGITS = 18  # most digits of an integer, so that it fits into 64 bits
_OTHER_FORMATS = {  # by the beginnings of their texts
    r"\s*<": "XML or HTML",
    r'(?s)\s*\{.{0,2000}"(Feature|FeatureCollection|GeometryCollection|Topology)"': "GeoJSON",
    r"\s*(\{|\[\s*[\[{])": "JSON",
}
_GPX = r"\s*<[^>]*>?\s*(<!--.*?-->\s*)*<?gpx\b|\s*<gpx\b"
_AXES = (("x", "y"), ("x_m", "y_m"))  # names of columns of places, which latitude and longitude may replace
_MAP = {name: "latitude" for name in LATITUDES} | {name: "longitude" for name in LONGITUDES}


@dataclass(frozen=True)
class TableRow:
    """One row of a table."""

    where: str  # file and line, with which errors begin
    line: int
    values: Mapping[str, str]  # by column
    names: Mapping[str, str]  # the file's own names of columns that it calls otherwise
    decimal_comma: bool = False  # True if numbers may be written as 1,5
    on_map: bool = False  # True if its places were given as coordinates, and are metres from `geo.origin`

    def check_origin(self, field: str, origin: tuple[float, float]) -> None:
        """InputError if a place on the map has another origin, too; field: the key of that."""
        if self.on_map and tuple(origin) != (0.0, 0.0):
            raise InputError(f"{self.where}: {field} is not allowed for places on the map; geo.origin is their origin")

    def error(self, column: str, what: str) -> InputError:
        """An error about the entry in a column."""
        return InputError(f"{self.where}, column {self.names.get(column, column)}: {what}")

    def text(self, column: str) -> str:
        """The entry in a column; InputError if it is empty."""
        found = self.values[column]
        if not found:
            raise self.error(column, "is empty")
        return found

    def number(self, column: str) -> float:
        """A finite number; InputError if the entry is none."""
        found = self.text(column)
        value = parse_number(found.replace(",", ".") if self.decimal_comma else found)
        if not math.isfinite(value):
            raise self.error(column, f"{found!r} is not a finite number")
        return value

    def time(self, column: str) -> float:
        """A time [s], or since 1970 of one such as 2024-05-01T10:00:00+02:00, which is of UTC without a zone."""
        try:
            found = parse_iso_time(self.text(column))
        except ValueError as error:
            raise self.error(column, str(error)) from error
        return self.number(column) if found is None else found

    def lacks_zone(self, column: str) -> bool:
        """True for a time of day without a zone."""
        found = ISO_TIME.fullmatch(self.values.get(column, ""))
        return found is not None and not found[4]

    def optional_number(self, column: str) -> float | None:
        """A finite number; None if the table lacks the column, or the entry is empty or says that it is missing."""
        return None if self.values.get(column, "").upper() in _MISSING else self.number(column)

    def optional_text(self, column: str) -> str:
        """An entry; empty if the table lacks the column, or the entry says that it is missing."""
        found = self.values.get(column, "")
        return "" if found.upper() in _MISSING else found

    def integer(self, column: str) -> int:
        """An integer, 0 or more; InputError if the entry is none."""
        found = self.text(column)
        if not (found.isascii() and found.isdigit()):
            raise self.error(column, f"{found!r} is not an integer, 0 or more")
        if len(found) > _DIGITS:
            raise self.error(column, f"an integer of {len(found)} digits; at most {_DIGITS} are allowed")
        return int(found)


class RowErrors:
    """Errors of a table's rows, collected so that one error names all of them."""

    def __init__(self, name: str) -> None:
        """Errors begin with a name, which is removed from all but the first."""
        self._name = name
        self._first: list[str] = []
        self._count = 0

    @contextmanager
    def collect(self) -> Iterator[None]:
        """Keep an InputError of the block for `raise_all`."""
        try:
            yield
        except InputError as error:
            self._count += 1
            if len(self._first) < _SHOWN:
                self._first.append(str(error))

    def raise_all(self) -> None:
        """Raise one InputError for all that were collected, if any; it shows the first ones."""
        if not self._count:
            return
        shown = "; ".join([self._first[0], *(text.removeprefix(f"{self._name}, ") for text in self._first[1:])])
        more = self._count - len(self._first)
        raise InputError(f"{shown}; and {more} more" if more else shown)


def read_csv(
    path: Path,
    field: str,
    columns: Sequence[str],
    aliases: Mapping[str, str] | None = None,
    *,
    nameless: bool = False,
    hints: Mapping[str, str] | None = None,
    spares: Mapping[str, str] | None = None,
    geo: Geo = NOWHERE_ON_THE_MAP,
) -> Iterator[TableRow]:
    """Rows of a table that has these columns once each, and maybe others; empty lines are skipped.

    Entries are separated by commas, semicolons, tabs or spaces, as the first line shows. Unless they are separated by
    commas, numbers may have a decimal comma. Lines that begin with # are comments, the last of which may name the
    columns. Rows may have names ahead of the first column, as R writes them. In place of x and y there may be latitude
    and longitude. The tracks of a GPX file are read, too. InputError begins with `field` and names file, line and
    column.

    Args:
        path: The file.
        field: What errors begin with, such as the key of a scenario that names the file.
        columns: Names of the columns that the table must have.
        aliases: Other names of columns.
        spares: Names that stand for a column if no other one does.
        nameless: True if a first line of numbers, as many as there are `columns`, is a row.
        hints: What to do if a column is missing, by column.
        geo: Where the map is, from which places become metres.
    """
    name = f"{field}: {path}"
    found = read_text(path, field, MOST_BYTES)
    found = found if "\n" in found else found.replace("\r", "\n")  # ends of lines of old programs
    if re.match(_GPX, found[:2000], re.DOTALL):
        found = read_gpx(found, name)
    _check_format(found, name, columns)
    head, first = _split_head(found)
    delimiter = _find_delimiter(first)
    table = csv.reader(
        _leave_out_comments(found, len(head), first, delimiter), delimiter=delimiter, skipinitialspace=True
    )

    def translate(entries: list[str]) -> list[str]:
        return translate_names(entries, aliases or {}, spares or {})

    try:
        given = [entry.strip() for entry in next(filter(any, table), [])]
        rows: Iterable[list[str]] = table
        commented = _split(next(filter(None, reversed(head)), "").lstrip("# "), delimiter)
        known = {*columns, *(aliases or {}).values(), *(spares or {}).values()}
        told = len(known & {*translate(commented)})
        if len(commented) == len(given) and told > len(known & {*translate(given)}):
            rows = chain([given], table)
            given = commented
        elif nameless and len(given) == len(columns) and _are_numbers(given):
            rows = chain([given], table)
            given = list(columns)
        header = translate(given)
        axes = next((axes for axes in _AXES if {*axes} <= known), ())
        header, on_map = _find_map(header, axes)
        wanted = [column for column in columns if not (on_map and column in axes)]
        _check_header(header, name, wanted, aliases or {}, hints or {})
        names = {column: own for column, own in zip(header, given, strict=True) if column != own}
        named = False
        for n, entries in enumerate(filter(any, rows)):
            where = f"{name}, line {table.line_num}"
            if table.line_num > _MOST_LINES:
                raise InputError(f"{where}: has more than the {_MOST_LINES} lines that are allowed")
            named = len(entries) == len(header) + 1 and entries[-1] != "" if n == 0 else named
            if named and _is_name(entries[0], n + 1, delimiter):
                entries = entries[1:]
            if len(entries) != len(header):
                raise InputError(f"{where}: has {len(entries)} entries, not {len(header)} as line 1")
            values = dict(zip(header, map(str.strip, entries), strict=True))
            row = TableRow(where, table.line_num, values, names, decimal_comma=delimiter != ",")
            yield _place(row, axes, geo, on_map=on_map) if on_map or (geo.epsg and axes) else row
    except csv.Error as error:  # an entry is longer than Python's reader allows
        raise InputError(f"{name}, line {table.line_num}: {error}") from error


def _find_map(header: list[str], axes: Sequence[str]) -> tuple[list[str], bool]:
    """Names of columns, and True if those of latitude and longitude are in place of the `axes`."""
    named = translate_names(header, {}, _MAP)
    found = bool(axes) and not {*axes} & {*header} and {*_MAP.values()} <= {*named}
    return (named if found else header), found


def _place(row: TableRow, axes: Sequence[str], geo: Geo, *, on_map: bool) -> TableRow:
    """A row with metres in the columns `axes`, in place of latitude and longitude or projected coordinates."""
    own = ["longitude", "latitude"] if on_map else axes
    if any(row.optional_number(column) is None for column in own):
        return row if not on_map else _replace(row, own, axes, ("", ""))
    x, y = (row.number(column) for column in own)
    try:
        if not on_map:
            lats, lons = geo.unproject(np.array([x]), np.array([y]))
            y, x = float(lats[0]), float(lons[0])
        return _replace(row, own, axes, tuple(map(repr, geo.place(y, x))))
    except InputError:
        raise
    except ValueError as error:
        raise row.error(own[1], str(error)) from error


def _replace(row: TableRow, own: Sequence[str], axes: Sequence[str], values: tuple[str, ...]) -> TableRow:
    """A row with other values, in columns of other names."""
    left = {column: value for column, value in row.values.items() if column not in own}
    names = {axis: row.names.get(column, column) for axis, column in zip(axes, own, strict=True) if axis != column}
    kept = {column: name for column, name in row.names.items() if column not in axes}  # which may name another unit
    return replace(row, values={**left, **dict(zip(axes, values, strict=True))}, names={**kept, **names}, on_map=True)


def find_map_origin(path: Path, field: str, geo: Geo) -> tuple[float, float] | None:
    """Latitude and longitude [deg] in the middle of the places of a file; None if it has none on the map.

    Wrong files have none, either: an error tells of them when they are read.
    """
    columns = ("x", "y") if geo.epsg else ("longitude", "latitude")
    projected = {"x_m": "x", "y_m": "y", "easting": "x", "northing": "y", "gx": "x", "gy": "y"}
    spares = projected if geo.epsg else _MAP
    found = []
    try:
        if path.suffix.lower() in SUFFIXES:
            features, code = load_features(read_text(path, field, MOST_BYTES), field, geo)
            places = list_places(features)
            return find_middle(*find_degrees(places, code)) if code and len(places) else None
        for row in read_csv(path, field, columns, spares=spares):
            if not geo.epsg and {"x", "y", *projected} & {*row.values}:
                return None  # it is read in these metres
            place = [row.optional_number(column) for column in columns]
            if None not in place:
                found.append(place)
    except InputError:
        return None
    if not found:
        return None
    x, y = np.array(found, dtype=float).T
    lats, lons = geo.unproject(x, y) if geo.epsg else (y, x)
    return find_middle(lats, lons)


def find_middle(latitudes: Array, longitudes: Array) -> tuple[float, float]:
    """Latitude and longitude [deg] in the middle of places (N,) deg, to a tenth of a metre."""
    ends = np.nanmin([latitudes, longitudes], axis=1), np.nanmax([latitudes, longitudes], axis=1)
    latitude, longitude = ((ends[0] + ends[1]) / 2).round(6).tolist()
    return latitude, longitude


def _check_format(text: str, name: str, columns: Sequence[str]) -> None:
    """InputError for a text that is empty, or of another format."""
    if not text.strip():
        raise InputError(f"{name}: is empty; its first line must name the columns {','.join(columns)}")
    for beginning, other in _OTHER_FORMATS.items():
        if re.match(beginning, text):
            wanted = f" with the columns {','.join(columns)}" if columns else ""
            raise InputError(f"{name}: is {other}; expected a table as CSV{wanted}")


def _split_head(text: str) -> tuple[list[str], str]:
    """The lines before a table, which are comments or empty, and its first line; of nothing else, the last one."""
    head: list[str] = []
    for line in map(str.strip, io.StringIO(text)):
        if line and not line.startswith(("#", "sep=")):  # a line such as sep=; is for spreadsheets
            return head, line
        head.append(line)
    return head[:-1], head[-1]


def _find_delimiter(first: str) -> str:
    """The character that separates the entries of a table's first line."""
    found = max(",;\t", key=first.count)
    return found if found in first or " " not in first else " "


def _split(line: str, delimiter: str) -> list[str]:
    entries = next(csv.reader([line.strip()], delimiter=delimiter, skipinitialspace=True), [])
    return [entry.strip() for entry in entries]


def _leave_out_comments(text: str, before: int, first: str, delimiter: str) -> Iterator[str]:
    """The lines of a table, of which those `before` its first one and comments are empty.

    A line that begins with # is no comment if this begins a name, such as #12, in a row of as many entries as `first`.
    """
    width = len(_split(first, delimiter))
    for n, line in enumerate(io.StringIO(text, newline="")):
        comment = line.startswith("#") and (not re.match(r"#\w", line) or len(_split(line, delimiter)) != width)
        if n < before or comment:
            yield ""
        else:
            yield line.strip() if delimiter == " " else line  # a space at the end of a line separates nothing


def _is_name(entry: str, number: int, delimiter: str) -> bool:
    """True if the first entry of a row may be its name or number, and no part of one with a decimal comma."""
    return delimiter != "," or entry == str(number) or not math.isfinite(parse_number(entry))


def _are_numbers(entries: Sequence[str]) -> bool:
    return all(math.isfinite(parse_number(entry.replace(",", "."))) for entry in entries)


def translate_names(entries: Sequence[str], aliases: Mapping[str, str], spares: Mapping[str, str]) -> list[str]:
    """Names of columns as the reader knows them."""
    header = [aliases.get(entry, entry) for entry in entries]
    for n, entry in enumerate(header):
        column = spares.get(re.sub(r"[\W_]+", "_", entry.lower()).strip("_"), entry)
        if column not in header:
            header[n] = column
    return header


def _check_header(
    header: Sequence[str], name: str, columns: Sequence[str], aliases: Mapping[str, str], hints: Mapping[str, str]
) -> None:
    """InputError unless each of `columns` is there once, and none of the aliases twice."""
    if header and _are_numbers(header):
        raise InputError(f"{name}, line 1: names no columns, but has numbers; columns are {','.join(columns)}")
    for column in dict.fromkeys([*columns, *aliases.values()]):
        if header.count(column) > 1:
            raise InputError(f"{name}, line 1: column {column} is twice; columns are {','.join(header)}")
        if column in columns and column not in header:
            there = f"columns are {','.join(header) or 'none'}{hints.get(column, '')}"
            raise InputError(f"{name}, line 1: column {column} is missing; {there}")
