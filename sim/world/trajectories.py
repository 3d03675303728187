"""Trajectories of people: positions at any time, and the reader of recorded trajectories in CSV files."""

import csv
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from sim.scenario.environment import Area
from sim.scenario.scenario import MOST_WALKED
from sim.scenario.text_files import text
from tracking.errors import InputError
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.trigonometry import arctan2_each

SAMPLES_PER_SECOND = 60
COLUMNS = ("time", "id", "x", "y")
MOST_BYTES = 2**28  # largest size of a file, enough for rows at 10 Hz for as long as people may walk
_MOST_LINES = 2**23  # lines of a file, which take a few gigabytes during reading
_LATEST = 1e12  # s, largest absolute value of a time
_SOONEST = 1e-4  # s, least time between two rows of one person; shorter ones would mean absurd speeds
_LONGEST_ID = 100  # characters
_EXACT = 1e-6  # steps; a time that is nearer than this to a sample counts as the sample's


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Positions of M people at K uniformly spaced times, with linear interpolation in between."""

    times: Array  # (K,) s, K >= 2
    positions: Array  # (K, M, 2) m; NaN while a person is absent

    def at(self, time: float) -> tuple[Array, Array]:
        """Positions (M, 2) m and headings (M,) rad from east at a time [s]; NaN for people absent then."""
        step = (time - self.times[0]) / (self.times[1] - self.times[0])
        between = abs(step - round(step)) > _EXACT
        k = math.floor(step) if between else round(step)
        if not 0 <= k < len(self.times) - between:
            return np.full(self.positions.shape[1:], np.nan), np.full(self.positions.shape[1], np.nan)
        here, headings = self.positions[k], self._headings[k]
        if not between:
            return here.copy(), headings.copy()
        positions = here + (step - k) * (self.positions[k + 1] - here)
        return positions, np.where(np.isnan(positions[:, 0]), np.nan, headings)

    @cached_property
    def _headings(self) -> Array:
        """Direction (K, M) of the step after each sample; a standing person keeps the last direction."""
        steps = np.diff(self.positions, axis=0)
        headings = arctan2_each(steps[..., 1], steps[..., 0])
        headings[length(steps) < 1e-4] = np.nan
        headings = np.vstack([headings, np.full((1, headings.shape[1]), np.nan)])
        for k in range(1, len(headings)):
            headings[k] = np.where(np.isnan(headings[k]), headings[k - 1], headings[k])
        headings[np.isnan(headings)] = 0.0
        return np.where(np.isnan(self.positions[..., 0]), np.nan, headings)


def read(path: Path, area: Area, *, duration: float) -> Trajectories:
    """Read recorded people from a CSV file with the columns time (or t) [s since start], id, x and y [m].

    Rows may have any order. Each person is present from the first to the last of their rows; in between, positions are
    interpolated by a monotone cubic (PCHIP), which does not overshoot. People that are absent throughout `duration` s
    are left out. InputError names the field of the scenario, file, line and value.
    """
    name = f"people.trajectories: {path}"
    times = np.arange(math.ceil(duration * SAMPLES_PER_SECOND - _EXACT) + 1) / SAMPLES_PER_SECOND
    people = _people(name, _lines(path, name), area)
    if len(people) * duration > MOST_WALKED:
        walked = f"{len(people)} people for a duration of {duration:g} s"
        raise InputError(f"{name}: {walked} are too many; at most {MOST_WALKED:g} s of all together are allowed")
    tracks = [_resampled(name, person, rows, times) for person, rows in people.items()]
    present = [track for track in tracks if not np.all(np.isnan(track))]
    if not present:
        known = [time for rows in people.values() for time in rows]
        rows = f"rows are from {min(known):.12g} to {max(known):.12g} s"
        raise InputError(f"{name}: column time: nobody is there between 0 and {duration:g} s; {rows}")
    return Trajectories(times, np.stack(present, axis=1))


def _lines(path: Path, name: str) -> list[str]:
    """Lines of a file; InputError if it is empty or has too many."""
    found = text(path, "people.trajectories", MOST_BYTES)
    if not found.strip():
        raise InputError(f"{name}: is empty; its first line must name the columns {','.join(COLUMNS)}")
    lines = found.splitlines()
    if len(lines) > _MOST_LINES:
        raise InputError(f"{name}: has {len(lines)} lines; at most {_MOST_LINES} are allowed")
    return lines


def _people(name: str, lines: list[str], area: Area) -> dict[str, dict[float, Array]]:
    """Position (2,) m by person and time [s]; people are in the order in which the file first names them."""
    people: dict[str, dict[float, Array]] = {}
    table = csv.DictReader(lines, restval="")
    try:
        header = [column.strip() for column in table.fieldnames or []]
        table.fieldnames = ["time" if column == "t" else column for column in header]
        if sorted(table.fieldnames) != sorted(COLUMNS):
            raise InputError(f"{name}, line 1: columns are {','.join(header) or 'missing'}, not {','.join(COLUMNS)}")
        for row in table:
            where = f"{name}, line {table.line_num}"
            if None in row:
                raise InputError(f"{where}: {row[None][0]!r} is in a column without a name")
            person, time, position = _row(where, row, area)
            if time in people.setdefault(person, {}):
                raise InputError(f"{where}, column time: id {person} has a second row at {time:g} s")
            people[person][time] = position
    except csv.Error as error:  # a field is longer than Python's reader allows
        raise InputError(f"{name}, line {table.reader.line_num}: {error}") from error
    if not people:
        raise InputError(f"{name}: has no rows below the names of its columns; a path needs two or more")
    return people


def _row(where: str, row: dict[str, str], area: Area) -> tuple[str, float, Array]:
    """Person, time [s] and position (2,) m of one line."""
    number = {}
    for column in COLUMNS:
        value = row[column].strip()
        if not value:
            raise InputError(f"{where}, column {column}: is empty")
        if column != "id":
            number[column] = _finite(f"{where}, column {column}", value)
    for column, size in (("x", area.width), ("y", area.height)):
        if abs(number[column]) > size / 2:
            inside = f"{-size / 2:g} to {size / 2:g} m"
            raise InputError(f"{where}, column {column}: {number[column]:g} is outside the area, {inside}")
    person = row["id"].strip()
    if len(person) > _LONGEST_ID or not person.isprintable():
        raise InputError(f"{where}, column id: is not printable, or longer than the {_LONGEST_ID} characters allowed")
    if abs(number["time"]) > _LATEST:
        raise InputError(f"{where}, column time: {number['time']:g} s is not allowed; expected at most {_LATEST:g} s")
    return person, number["time"], np.array([number["x"], number["y"]])


def _finite(where: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{where}: {value!r} is not a finite number")
    return number


def _resampled(name: str, person: str, rows: dict[float, Array], times: Array) -> Array:
    """Positions (K, 2) m of one person at `times` (K,) s; NaN before the first and after the last row."""
    if len(rows) < 2:
        raise InputError(f"{name}: column id: {person} has a single row; a path needs two or more")
    known = np.array(sorted(rows))
    if np.diff(known).min() < _SOONEST:
        k = int(np.diff(known).argmin())
        near = f"{known[k]:g} and {known[k + 1]:g} s"
        raise InputError(
            f"{name}, column time: id {person} has rows at {near}; {_SOONEST:g} s or more apart are allowed"
        )
    curve = PchipInterpolator(known, np.array([rows[t] for t in known]), extrapolate=False)
    # A person's first and last time may differ by rounding from the time of the sample that is meant.
    first, last = np.searchsorted(times, [known[0] - 1e-9, known[-1] + 1e-9])
    positions = np.full((len(times), 2), np.nan)
    positions[first:last] = curve(np.clip(times[first:last], known[0], known[-1]))
    return positions
