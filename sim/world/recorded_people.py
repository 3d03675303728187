"""Recorded people: the reader of their trajectories in CSV files."""

import math
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import numpy as np

from sim.scenario.csv_tables import RowErrors, TableRow, read_csv
from sim.scenario.environment import Area, People
from sim.scenario.geo import NOWHERE_ON_THE_MAP, Geo
from sim.scenario.quantities import spell_times
from sim.scenario.scenario import MOST_WALKED, Scenario
from sim.world.trajectories import EXACT, SAMPLES_PER_SECOND, Trajectories
from tracking.errors import InputError, spell
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.settings import DAY

COLUMNS = ("time", "id", "x", "y")
_FRAMES = ("frame", "id", "x", "y")
_ALIASES = {"t": "time", "time_s": "time", "x_m": "x", "y_m": "y"}
_SPARES = {"timestamp": "time", "datetime": "time", "time_utc": "time"}
_LATEST = 1e12  # s, largest absolute value of a time
_SOONEST = 1e-4  # s, least time between two rows of one person; shorter ones would mean absurd speeds
_SLACK = 1e-6  # s, by which times of POSIX may differ by rounding from the time of the sample that is meant
_LONGEST_ID = 100  # characters
_SLOW = 0.2  # m/s, people who walk are faster
_FASTEST = 12.14  # m/s, people who run are slower
_HINTS = {"time": "; if frames are counted, people.fps says how many there are in a second"}
_UNITS = "are times in seconds and places in metres?"
_PLAIN = People()  # a file as it stands


def read_trajectories(
    path: Path,
    area: Area,
    *,
    duration: float,
    people: People = _PLAIN,
    slack: float = _SLACK,
    geo: Geo = NOWHERE_ON_THE_MAP,
) -> Trajectories:
    """Read recorded people from a CSV file with the columns time (or t) [s], id, x and y [m].

    With `people.fps` the column frame takes the place of time. A file of four columns without names has these columns
    in this order. `people.start` and `people.origin` are the time and place in the file of the mission's start and of
    the area's centre. Rows may have any order. Each person is present from the first to the last of their rows, but not
    with `people.outside = "clip"` between rows outside the area; in between, positions are interpolated by a monotone
    cubic (PCHIP), which does not overshoot. Before and after, people stand for `slack` s. People that are absent
    throughout `duration` s are left out. `geo` says where the map is, if places are on it. InputError names the field
    of the scenario, file, and line and value of each wrong row.
    """
    name = f"people.trajectories: {path}"
    times = np.arange(math.ceil(duration * SAMPLES_PER_SECOND - EXACT) + 1) / SAMPLES_PER_SECOND
    persons = _read_people(path, name, area, people, geo)
    if all(np.isnan(place[0]) for rows in persons.values() for place in rows.values()):
        outside = f"all places are outside the area of {area.width:g} × {area.height:g} m"
        raise InputError(f"{name}: columns x and y: {outside}; do they have its origin?")
    if len(persons) * duration > MOST_WALKED:
        walked = f"{len(persons)} people for a duration of {duration:g} s"
        raise InputError(f"{name}: {walked} are too many; at most {spell(MOST_WALKED)} s of all together are allowed")
    tracks = [resample(name, person, rows, times, slack=slack) for person, rows in persons.items()]
    present = [track for track in tracks if not np.all(np.isnan(track))]
    if not present:
        raise InputError(f"{name}: column time: {_describe_absence(persons, duration, people)}")
    return Trajectories(times, np.stack(present, axis=1))


def _describe_absence(persons: dict[str, dict[float, Array]], duration: float, people: People) -> str:
    """That nobody is there during a mission, and what to change."""
    known = [time for rows in persons.values() for time in rows]
    begin, end = min(known) + people.start, max(known) + people.start
    told = f"rows are from {spell_times(begin, end)}"
    if not people.start:
        first = spell_times(begin).removesuffix(" s")
        return f"nobody is there between 0 and {duration:g} s; {told}; people.start = {first} begins with them"
    zones = "; are the time zones right?" if abs(min(known)) < DAY else ""
    return f"nobody is there from people.start, {spell_times(people.start)}, for {duration:g} s; {told}{zones}"


def describe_trajectories(scenario: Scenario) -> tuple[str, list[str]]:
    """What the scenario's file of people holds, in one line, and remarks on what is left out, or moves unlike people.

    Both are empty without a file. The speed of a person is that along places a second or more apart. InputError as from
    `read_trajectories`. Source of the largest speed: [Coh18].
    """
    path = scenario.people.trajectory_file
    if path is None:
        return "", []
    name = f"people.trajectories: {path}"
    people = _read_people(path, name, scenario.area, scenario.people, scenario.geo)
    times = [time for positions in people.values() for time in positions]
    speeds = {person: _compute_mean_speed(rows) for person, rows in people.items()}
    speeds = {person: speed for person, speed in speeds.items() if not math.isnan(speed)}
    span = f"{name}: {len(people)} people, from {spell_times(min(times), max(times))}"
    doubts = []
    if next(_read_table(path, scenario.people, nameless=True, geo=scenario.geo)).lacks_zone("time"):
        doubts.append(f"{name}, column time: has no time zone; times are taken to be of UTC")
    if _lacks_names(path, scenario.people, scenario.geo):
        if len(people) > len({*times}):
            count = f"has {len(people)} ids, but {len({*times})} times"
            doubts.append(f"{name}: {count}; if the first column is the id, name the columns in a first line")
        elif scenario.people.fps is None and all((time + scenario.people.start).is_integer() for time in times):
            doubts.append(f"{name}: all times are whole numbers; {_HINTS['time'].strip('; ')}")
    if single := [person for person, rows in people.items() if len(rows) == 1]:
        doubts.append(f"{name}: left out: {_name_ids(single)}, in a single row; a path needs two or more")
    if not speeds:
        return span, doubts
    usual = median(speeds.values())
    fastest = max(speeds, key=lambda person: speeds[person])
    line = f"{span}, at {min(speeds.values()):.2f} to {speeds[fastest]:.2f} m/s, {usual:.2f} m/s in the median"
    if usual < _SLOW:
        doubts.append(f"{name}: half of the people move at {usual:.2f} m/s or less; {_UNITS}")
    if speeds[fastest] > _FASTEST:
        run = f"no one has run faster than {_FASTEST} m/s"
        doubts.append(f"{name}: id {fastest} moves at {spell(speeds[fastest], 3)} m/s, but {run}; {_UNITS}")
    return line, doubts


def _read_table(path: Path, people: People, *, nameless: bool, geo: Geo) -> Iterator[TableRow]:
    columns = COLUMNS if people.fps is None else _FRAMES
    field = "people.trajectories"
    return read_csv(path, field, columns, _ALIASES, nameless=nameless, hints=_HINTS, spares=_SPARES, geo=geo)


def _lacks_names(path: Path, people: People, geo: Geo) -> bool:
    """True for a file without names of columns."""
    try:
        next(_read_table(path, people, nameless=False, geo=geo))
    except InputError:
        return True
    return False


def _name_ids(ids: list[str]) -> str:
    """The first ids in words, and how many there are."""
    shown = ", ".join(ids[:3])
    return f"{len(ids)} ids, such as {shown}" if len(ids) > 3 else f"id{'s' * (len(ids) > 1)} {shown}"


def _compute_mean_speed(rows: dict[float, Array]) -> float:
    """Speed [m/s] of a person with these positions (2,) m by time [s], along places a second or more apart.

    NaN for one with fewer than two places.
    """
    times = np.array(sorted(time for time, place in rows.items() if not np.isnan(place[0])))
    if len(times) < 2:
        return math.nan
    last = len(times) - 1
    _, first_of_seconds = np.unique(np.floor(times[:last] - times[0]), return_index=True)
    places = np.array([rows[times[k]] for k in [*first_of_seconds.tolist(), last]])
    walked = math.fsum(length(np.diff(places, axis=0)).tolist())
    return walked / float(times[-1] - times[0])


def _read_people(path: Path, name: str, area: Area, people: People, geo: Geo) -> dict[str, dict[float, Array]]:
    """Position (2,) m by person and time [s] of the mission; people are in the order in which the file has them.

    Positions outside the area are NaN if they are clipped.
    """
    found: dict[str, dict[float, Array]] = {}
    errors = RowErrors(name)
    for row in _read_table(path, people, nameless=True, geo=geo):
        row.check_origin("people.origin", people.origin)
        with errors.collect():
            person, time, place = _read_row(row, area, people)
            if time in found.setdefault(person, {}):
                raise row.error(
                    "time" if people.fps is None else "frame", f"id {person} has a second row at {spell(time)} s"
                )
            found[person][time] = place
    errors.raise_all()
    if not found:
        raise InputError(f"{name}: has no rows below the names of its columns; a path needs two or more")
    return found


def _read_row(row: TableRow, area: Area, people: People) -> tuple[str, float, Array]:
    """Person, time [s] and position (2,) m of a row."""
    person = row.text("id")
    if len(person) > _LONGEST_ID or not person.isprintable():
        raise row.error("id", f"is not printable, or longer than the {_LONGEST_ID} characters allowed")
    column = "time" if people.fps is None else "frame"
    time = row.time(column) if people.fps is None else row.number(column)
    if abs(time) > _LATEST:
        raise row.error(column, f"{spell(time)} s is not allowed; expected at most {_LATEST:g} s")
    if people.fps is not None:
        time /= people.fps
    return person, time - people.start, _read_position(row, area, people)


def _read_position(row: TableRow, area: Area, people: People) -> Array:
    """Position (2,) m within the area; NaN for one outside that is to be clipped."""
    position = np.array([row.number("x"), row.number("y")]) - people.origin
    for column, value, size in zip(("x", "y"), position.tolist(), (area.width, area.height), strict=True):
        if abs(value) > size / 2:
            if people.outside == "clip":
                return np.full(2, np.nan)
            origin = (
                "geo.origin is the area's" if row.on_map else "people.origin is the place in the file of the area's"
            )
            far = f"; {origin} centre" if abs(value) > size else ""
            raise row.error(column, f"{spell(value, 6)} is outside the area, {-size / 2:g} to {size / 2:g} m{far}")
    return position


def resample(
    name: str, person: str, rows: dict[float, Array], times: Array, max_gap: float = math.inf, slack: float = _SLACK
) -> Array:
    """Positions (K, 2) m of one person at times; NaN while the person is absent.

    InputError if two rows are almost at the same time.

    Args:
        name: The file, for errors.
        person: The person's id, for errors.
        rows: Position (2,) m by time [s]; NaN where the person is absent.
        times: Times (K,) s.
        max_gap: Time [s] between two rows beyond which the person is absent in between.
        slack: Time [s] that a person is present before the first row and after the last.
    """
    known = np.array(sorted(rows))
    places = np.array([rows[time] for time in known.tolist()])
    positions = np.full((len(times), 2), np.nan)
    gaps = np.diff(known)
    if len(gaps) and gaps.min() < _SOONEST:
        k = int(gaps.argmin())
        near = f"{spell(known[k])} and {spell(known[k + 1])} s"
        raise InputError(
            f"{name}, column time: id {person} has rows at {near}; {_SOONEST:g} s or more apart are allowed"
        )
    from scipy.interpolate import PchipInterpolator

    outside = np.isnan(places[:, 0])
    leaves = outside[:-1] | outside[1:] | (gaps > max_gap)
    for stay in np.split(np.arange(len(known)), np.flatnonzero(leaves) + 1):
        if len(stay) < 2:
            continue
        begins, ends = known[stay[0]], known[stay[-1]]
        curve = PchipInterpolator(known[stay], places[stay], extrapolate=False)
        first, last = np.searchsorted(times, [begins - slack, ends + slack])
        positions[first:last] = curve(np.clip(times[first:last], begins, ends))
    return positions
