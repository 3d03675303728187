"""Trajectories of people: positions at any time, and the reader of recorded trajectories in CSV files."""

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from sim.scenario.csv_tables import Row, read_csv
from sim.scenario.environment import Area
from sim.scenario.scenario import MOST_WALKED, Scenario
from tracking.errors import InputError, spell
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.trigonometry import arctan2_each

SAMPLES_PER_SECOND = 60
COLUMNS = ("time", "id", "x", "y")
_LATEST = 1e12  # s, largest absolute value of a time
_SOONEST = 1e-4  # s, least time between two rows of one person; shorter ones would mean absurd speeds
_LONGEST_ID = 100  # characters
_SLOW, _FASTEST = 0.2, 12.14  # m/s: people who walk are faster, and those who run slower
_UNITS = "are times in seconds and places in metres?"
_EXACT = 1e-6  # steps; a time that is nearer than this to a sample counts as the sample's


class PeoplePoses(NamedTuple):
    """Positions and headings of M people; NaN for those who are absent."""

    positions: Array  # (M, 2) m
    headings: Array  # (M,) rad from east


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Positions of M people at K uniformly spaced times, with linear interpolation in between."""

    times: Array  # (K,) s, K >= 2
    positions: Array  # (K, M, 2) m; NaN while a person is absent

    def at(self, time: float) -> PeoplePoses:
        """Positions and headings of all people at a time [s]."""
        step = (time - self.times[0]) / (self.times[1] - self.times[0])
        between = abs(step - round(step)) > _EXACT
        k = math.floor(step) if between else round(step)
        if not 0 <= k < len(self.times) - between:
            return PeoplePoses(np.full(self.positions.shape[1:], np.nan), np.full(self.positions.shape[1], np.nan))
        here, headings = self.positions[k], self._headings[k]
        if not between:
            return PeoplePoses(here.copy(), headings.copy())
        positions = here + (step - k) * (self.positions[k + 1] - here)
        return PeoplePoses(positions, np.where(np.isnan(positions[:, 0]), np.nan, headings))

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


def read_trajectories(path: Path, area: Area, *, duration: float) -> Trajectories:
    """Read recorded people from a CSV file with the columns time (or t) [s since start], id, x and y [m].

    Rows may have any order. Each person is present from the first to the last of their rows; in between, positions are
    interpolated by a monotone cubic (PCHIP), which does not overshoot. People that are absent throughout `duration` s
    are left out. InputError names the field of the scenario, file, line and value.
    """
    name = f"people.trajectories: {path}"
    times = np.arange(math.ceil(duration * SAMPLES_PER_SECOND - _EXACT) + 1) / SAMPLES_PER_SECOND
    people = _read_people(path, name, area)
    if len(people) * duration > MOST_WALKED:
        walked = f"{len(people)} people for a duration of {duration:g} s"
        raise InputError(f"{name}: {walked} are too many; at most {spell(MOST_WALKED)} s of all together are allowed")
    tracks = [_resample(name, person, positions, times) for person, positions in people.items()]
    present = [track for track in tracks if not np.all(np.isnan(track))]
    if not present:
        known = [time for positions in people.values() for time in positions]
        rows = f"rows are from {spell(min(known))} to {spell(max(known))} s"
        raise InputError(f"{name}: column time: nobody is there between 0 and {duration:g} s; {rows}")
    return Trajectories(times, np.stack(present, axis=1))


def describe_trajectories(scenario: Scenario) -> tuple[str, list[str]]:
    """What the scenario's file of people holds, in one line, and remarks on speeds that are not those of people.

    Both are empty without a file. The speed of a person is that along places a second or more apart. InputError as from
    `read_trajectories`. Source of the largest speed: [Coh18].
    """
    path = scenario.people.trajectory_file
    if path is None:
        return "", []
    name = f"people.trajectories: {path}"
    people = _read_people(path, name, scenario.area)
    times = [time for positions in people.values() for time in positions]
    speeds = {person: _mean_speed(positions) for person, positions in people.items()}
    usual, fastest = median(speeds.values()), max(speeds, key=lambda person: speeds[person])
    span = f"{len(people)} people, from {spell(min(times))} to {spell(max(times))} s"
    line = f"{name}: {span}, at {min(speeds.values()):.2f} to {speeds[fastest]:.2f} m/s, {usual:.2f} m/s in the median"
    doubts = []
    if usual < _SLOW:
        doubts.append(f"{name}: half of the people move at {usual:.2f} m/s or less; {_UNITS}")
    if speeds[fastest] > _FASTEST:
        run = f"no one has run faster than {_FASTEST} m/s"
        doubts.append(f"{name}: id {fastest} moves at {spell(speeds[fastest], 3)} m/s, but {run}; {_UNITS}")
    return line, doubts


def _mean_speed(rows: dict[float, Array]) -> float:
    """Speed [m/s] of a person with these positions (2,) m by time [s], along places a second or more apart."""
    times = np.array(sorted(rows))
    last = len(times) - 1
    _, first_of_seconds = np.unique(np.floor(times[:last] - times[0]), return_index=True)
    places = np.array([rows[times[k]] for k in [*first_of_seconds.tolist(), last]])
    walked = math.fsum(length(np.diff(places, axis=0)).tolist())
    return walked / float(times[-1] - times[0]) if last else 0.0


def _read_people(path: Path, name: str, area: Area) -> dict[str, dict[float, Array]]:
    """Position (2,) m by person and time [s]; people are in the order in which the file first names them."""
    people: dict[str, dict[float, Array]] = {}
    for row in read_csv(path, "people.trajectories", COLUMNS, aliases={"t": "time"}):
        person, time, position = row.text("id"), row.number("time"), _position(row, area)
        if len(person) > _LONGEST_ID or not person.isprintable():
            raise row.error("id", f"is not printable, or longer than the {_LONGEST_ID} characters allowed")
        if abs(time) > _LATEST:
            raise row.error("time", f"{spell(time)} s is not allowed; expected at most {_LATEST:g} s")
        if time in people.setdefault(person, {}):
            raise row.error("time", f"id {person} has a second row at {spell(time)} s")
        people[person][time] = position
    if not people:
        raise InputError(f"{name}: has no rows below the names of its columns; a path needs two or more")
    return people


def _position(row: Row, area: Area) -> Array:
    """Position (2,) m within the area."""
    position = [row.number("x"), row.number("y")]
    for column, value, size in zip(("x", "y"), position, (area.width, area.height), strict=True):
        if abs(value) > size / 2:
            raise row.error(column, f"{spell(value)} is outside the area, {-size / 2:g} to {size / 2:g} m")
    return np.array(position)


def _resample(name: str, person: str, rows: dict[float, Array], times: Array) -> Array:
    """Positions (K, 2) m of one person at `times` (K,) s, given rows by time; NaN before the first and after the last.

    InputError if there are fewer than two rows, or two almost at the same time.
    """
    if len(rows) < 2:
        raise InputError(f"{name}: column id: {person} has a single row; a path needs two or more")
    known = np.array(sorted(rows))
    if np.diff(known).min() < _SOONEST:
        k = int(np.diff(known).argmin())
        near = f"{spell(known[k])} and {spell(known[k + 1])} s"
        raise InputError(
            f"{name}, column time: id {person} has rows at {near}; {_SOONEST:g} s or more apart are allowed"
        )
    curve = PchipInterpolator(known, np.array([rows[t] for t in known]), extrapolate=False)
    # A person's first and last time may differ by rounding from the time of the sample that is meant.
    first, last = np.searchsorted(times, [known[0] - 1e-9, known[-1] + 1e-9])
    positions = np.full((len(times), 2), np.nan)
    positions[first:last] = curve(np.clip(times[first:last], known[0], known[-1]))
    return positions
