"""The results of a study in one SQLite file, with a row for each trial that has ended."""

import errno
import math
import sqlite3
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from sim.facts.columns import make_dataframe
from sim.mission.atomic_files import number_names
from sim.study.cells import Levels
from sim.study.trials import StudyTrial, TrialRow
from tracking.errors import InputError, one_line

SCHEMA = 2  # version of the tables, in the file's user_version; docs/how-to/studies.md describes them
NAME = "study.sqlite"
_TABLES = (
    "CREATE TABLE study (name TEXT NOT NULL)",
    """CREATE TABLE trials (
        key TEXT PRIMARY KEY, scenario TEXT NOT NULL, factors TEXT NOT NULL, settings TEXT NOT NULL,
        planner TEXT NOT NULL, seed INTEGER NOT NULL, version TEXT NOT NULL, status TEXT NOT NULL,
        error TEXT NOT NULL, metrics TEXT NOT NULL, ospa BLOB NOT NULL, scans_per_s REAL NOT NULL,
        finished TEXT NOT NULL DEFAULT (datetime('now')), repeat INTEGER NOT NULL DEFAULT 0,
        recording TEXT NOT NULL DEFAULT '', machine TEXT NOT NULL DEFAULT ''
    )""",
    "CREATE VIEW metrics AS SELECT t.key, j.key AS name, j.value FROM trials t, json_each(t.metrics) j",
    "CREATE VIEW factors AS SELECT t.key, json_extract(j.value, '$[0]') AS name, json_extract(j.value, '$[1]') AS level"
    " FROM trials t, json_each(t.factors) j",
)


class _StoredTrial(msgspec.Struct, frozen=True):
    """A trial in the form of its row in the table."""

    scenario: str
    factors: str
    settings: str
    planner: str
    seed: int | str  # text if it has more than 63 bits
    repeat: int
    recording: str
    machine: str
    version: str
    status: Literal["done", "failed"]
    error: str
    metrics: str
    ospa: bytes
    scans_per_s: float


_FIELDS = _StoredTrial.__struct_fields__
_COLUMNS = ", ".join(_FIELDS)
_DAMAGED = (sqlite3.Error, UnicodeDecodeError)  # errors of a file that is locked or no valid store


class StoreError(Exception):
    """Results cannot be written; the message is one line. Earlier results stay in the store."""


class Store:
    """A study's results on disk. One process writes, and each trial is one transaction.

    Note: SQLite uses its rollback journal rather than a write-ahead log. The latter needs memory that readers share,
    which network file systems lack, and puts the newest results into a second file, which is easily left behind.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path, study: str) -> None:
        self.path = path
        self.study = study
        self._connection = connection

    @staticmethod
    @contextmanager
    def open(folder: Path, study: str) -> Iterator["Store"]:
        """The store in a folder, created if missing; InputError if it is another study's, too new, or no store."""
        path = folder / NAME
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if path.exists() and not path.is_file():
                raise InputError(f"--out: {path}: cannot be used: is not a file")  # SQLite would wait for a pipe
            if (folder / "mission.npz").exists():
                raise InputError(f"--out: {folder} holds a mission; allowed is a new folder, or that of a study")
        except FileExistsError as error:
            raise InputError(f"--out: {folder} is not a folder; allowed is a new folder, or that of a study") from error
        except OSError as error:
            raise _make_error(path, error, "--out: ") from error
        with _connect(path) as connection:
            _prepare(connection, path, study)
            yield Store(connection, path, study)

    def read_finished_rows(self, trials: Sequence[StudyTrial]) -> dict[str, TrialRow]:
        """Rows of the trials that did not fail, by key, with the scenario, factors and planner of the given trials."""
        wanted = {trial.key: trial for trial in trials}
        rows = self._connection.execute(f"SELECT key, {_COLUMNS} FROM trials WHERE status = 'done'").fetchall()
        found = {key: _decode_row(self.path, self.study, values) for key, *values in rows if key in wanted}
        return {key: msgspec.structs.replace(row, **wanted[key].place) for key, row in found.items()}

    def label(self, trials: Sequence[StudyTrial]) -> None:
        """Write anew the scenario, factors, settings and planner of stored trials.

        The present study may name the same trials differently than the one that flew them.
        """
        with self._transaction():
            for trial in trials:
                place = _encode_place(trial)
                self._connection.execute(
                    "UPDATE trials SET scenario = ?, factors = ?, settings = ?, planner = ?"
                    " WHERE key = ? AND (scenario, factors, settings, planner) IS NOT (?, ?, ?, ?)",
                    (*place, trial.key, *place),
                )

    def add(self, trial: StudyTrial, row: TrialRow) -> None:
        """Write a trial that has ended, in place of an earlier attempt; StoreError if that fails."""
        values = (trial.key, *msgspec.structs.astuple(_encode_row(trial, row)))
        with self._transaction():
            self._connection.execute(
                f"INSERT OR REPLACE INTO trials (key, {_COLUMNS}) VALUES ({', '.join('?' * len(values))})", values
            )

    def count_others(self, trials: Sequence[StudyTrial]) -> Counter[str]:
        """Number of stored trials, including failed ones, that belong to none of the trials, by package version."""
        keys = {trial.key for trial in trials}
        rows = self._connection.execute("SELECT key, version FROM trials ORDER BY version")
        return Counter(version for key, version in rows if key not in keys)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        try:
            with self._connection:  # commits or rolls back
                self._connection.execute("BEGIN IMMEDIATE")
                yield
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {error}") from error


def choose_folder(default: Path, study: str, trials: Sequence[StudyTrial]) -> Path:
    """The first of `default`, `default`-2, ... that is new, or has this study's store without any other trials.

    So a study goes on where it was, also with more planners, seeds or repeats, and its report replaces no other one.
    Trials of earlier code are no others. InputError if there is a store that cannot be read.
    """
    keys = {trial.key for trial in trials}
    runs = {(*_encode_place(trial), _encode_seed(trial.seed), trial.repeat) for trial in trials}
    for folder in number_names(default):
        file = folder / NAME
        if not file.is_file():
            if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
                return folder
            continue
        with _connect(file) as connection:
            if _read_version(connection, file) == 0:
                return folder
            columns = "key, scenario, factors, settings, planner, seed, repeat"
            held = connection.execute(f"SELECT {columns} FROM trials").fetchall()
            others = any(key not in keys and tuple(run) not in runs for key, *run in held)
            if _read_name(connection, file) == study and not others:
                return folder
    raise AssertionError("there is always another number")


def read_rows(path: str | Path) -> list[TrialRow]:
    """All rows of a store, sorted by scenario, factors, planner, seed and repeat; InputError if it is no store.

    path: the folder of a study, or the store in it.

    Rows of one trial in several package versions are in the order in which they were written.
    """
    path = Path(path)
    file = path / NAME if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{file}: there is no store of a study")
    with _connect(file) as connection:
        if _read_version(connection, file) == 0:
            raise InputError(f"{file}: holds no study")
        study = _read_name(connection, path)
        order = "scenario, factors, planner, length(seed), seed, repeat, rowid"
        rows = connection.execute(f"SELECT {_COLUMNS} FROM trials ORDER BY {order}").fetchall()
    return [_decode_row(path, study, values) for values in rows]


def tabulate_rows(rows: Sequence[TrialRow]) -> Any:  # noqa: ANN401 - a data frame of either library
    """Trials as a pandas data frame, or a polars one if pandas is not installed.

    There is one row per trial, with a column for each factor, such as `factor.lambda`, and for each metric.
    OSPA over time is left out.
    """
    names = {name: None for row in rows for name in row.metrics}
    factors = {name: None for row in rows for name, _ in row.factors}
    plain = ("study", "scenario", "planner", "seed", "repeat", "version", "machine", "recording", "status", "error")
    columns: dict[str, list[Any]] = {name: [getattr(row, name) for row in rows] for name in plain}
    for name in factors:
        columns[f"factor.{name}"] = [dict(row.factors).get(name) for row in rows]
    for name in names:
        columns[name] = [row.metrics.get(name, math.nan) for row in rows]
    return make_dataframe(columns)


@contextmanager
def _connect(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection; errors of SQLite in the block become InputErrors or, if the disk is full, StoreErrors."""
    try:
        with closing(sqlite3.connect(path, timeout=60.0, isolation_level=None)) as connection:
            yield connection
    except _DAMAGED as error:
        raise _make_error(path, error) from error


def _prepare(connection: sqlite3.Connection, path: Path, study: str) -> None:
    """Create the tables of a new store, or check that an existing store is this study's."""
    connection.execute("BEGIN IMMEDIATE")
    if _read_version(connection, path) == 0:
        for table in _TABLES:
            connection.execute(table)
        connection.execute("INSERT INTO study VALUES (?)", (study,))
        connection.execute(f"PRAGMA user_version = {SCHEMA}")
    name = _read_name(connection, path)
    if name != study:
        raise InputError(f"--out: {path.parent} holds study {name!r}, not {study!r}; name another folder")
    connection.execute("COMMIT")


def _read_name(connection: sqlite3.Connection, path: Path) -> str:
    """Name of a store's study; InputError if there is none."""
    names = connection.execute("SELECT name FROM study LIMIT 2").fetchall()
    if len(names) != 1 or not isinstance(names[0][0], str):
        raise InputError(f"{path}: is a damaged store: it names no study; name another folder")
    return str(names[0][0])


def _read_version(connection: sqlite3.Connection, path: Path) -> int:
    """Version of the schema, 0 for an empty file; InputError if the file is no store or has another version."""
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if version not in (0, SCHEMA):
        raise InputError(
            f"{path}: is a store of version {version}, but this program reads {SCHEMA}; name another folder"
        )
    if version == 0 and tables:
        raise InputError(f"{path}: is a database, but no store of a study; name another folder")
    return int(version)


def _make_error(path: Path, error: Exception, field: str = "") -> Exception:
    """The error to raise for a file or folder: a StoreError if the disk is full, otherwise an InputError."""
    if getattr(error, "errno", None) == errno.ENOSPC or (isinstance(error, sqlite3.Error) and "full" in str(error)):
        return StoreError(f"{path}: {getattr(error, 'strerror', None) or error}")
    return InputError(f"{field}{path}: cannot be used: {getattr(error, 'strerror', None) or error}")


def _encode_json(value: object) -> str:
    return msgspec.json.encode(value).decode()


def _encode_place(trial: StudyTrial) -> tuple[str, str, str, str]:
    """Scenario, factors, settings and planner of a trial, as its row has them."""
    return trial.scenario, _encode_json(trial.factors), _encode_json(trial.settings), trial.planner


def _encode_seed(seed: int) -> int | str:
    """A seed as SQLite keeps it: its integers have 64 bits, and a column of them rounds text of digits to a number."""
    return seed if seed < 2**63 else f"{seed:_}"


def _encode_row(trial: StudyTrial, row: TrialRow) -> _StoredTrial:
    plain = {name: getattr(row, name) for name in _FIELDS if name != "scans_per_s"}
    plain |= {name: _encode_json(plain[name]) for name in ("factors", "settings", "metrics")}
    plain["seed"] = _encode_seed(row.seed)
    plain["ospa"] = row.ospa.astype("<f4").tobytes()
    return _StoredTrial(**plain, scans_per_s=trial.setting.rates.sensing)


def _decode_row(path: Path, study: str, values: Sequence[Any]) -> TrialRow:
    """A trial from the values of its row; InputError if they are invalid."""
    try:
        stored = msgspec.convert(dict(zip(_FIELDS, values, strict=True)), _StoredTrial, builtin_types=(bytes,))
        if not stored.scans_per_s > 0:
            raise ValueError(f"scans_per_s is {stored.scans_per_s:g}")
        plain = msgspec.structs.asdict(stored)
        rate = plain.pop("scans_per_s")
        numbers = msgspec.json.decode(stored.metrics, type=dict[str, float | None])
        plain["factors"] = msgspec.json.decode(stored.factors, type=Levels)
        plain["settings"] = msgspec.json.decode(stored.settings, type=dict[str, str])
        plain["metrics"] = {name: math.nan if value is None else value for name, value in numbers.items()}
        plain["seed"] = int(stored.seed)
        plain["ospa"] = np.frombuffer(stored.ospa, dtype="<f4").astype(np.float32)
        return TrialRow(**plain, study=study, times=np.arange(len(plain["ospa"])) / rate)
    except (ValueError, RecursionError) as error:  # errors of msgspec are ValueErrors
        why = one_line(error)
        raise InputError(f"{path}: is a damaged store: a trial in it: {why}; name another folder") from error
