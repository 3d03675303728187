"""Stores and recordings that may be anything: sound ones of which something was changed."""

import io
import json
import sqlite3
import zipfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from helpers.hostile_values import DEEP, NUMBERS, WORDS, file, flaw, keys
from helpers.recordings import npy, record
from helpers.studies import store as fill
from sim.mission.archive import save
from sim.study.definition import read_study
from sim.study.store import NAME
from sim.study.trials import list_trials

STUDY = """[study]
name = "tiny"
planners = ["hover"]
seeds = "0"

[set]
duration = 0.2
people.count = 1
sensing.mode = "ideal"
trees.density = 1

[factors.R]
1 = { trees.canopy_radius = 1 }
"""


COLUMNS = ["key", "scenario", "factors", "settings", "planner", "seed", "version", "error", "metrics", "ospa"]
COLUMNS += ["scans_per_s", "finished"]


def store(rng):
    """A study that is flown already, with a store that was changed afterwards."""
    cell = rng.choice(
        [*NUMBERS[:14], *WORDS, b"", b"123", b"\xff" * 400, None, "{}", "[]", "[" * DEEP, '{"a":' * DEEP, '{"x": "y"}']
    )
    changes = [
        (f"UPDATE trials SET {rng.choice(COLUMNS)} = ?", (cell,)),
        ("UPDATE study SET name = ?", (cell if cell is not None else "",)),
        ("DELETE FROM study", ()),
        (f"DROP TABLE {rng.choice(['study', 'trials'])}", ()),
        (f"DROP VIEW {rng.choice(['metrics', 'factors'])}", ()),
        (f"PRAGMA user_version = {rng.choice([-1, 0, 1, 2, 2**31 - 1])}", ()),
        ("INSERT INTO study VALUES ('other')", ()),
        ("ALTER TABLE trials RENAME TO kept", ()),
        (f"ALTER TABLE trials DROP COLUMN {rng.choice(COLUMNS[1:])}", ()),
        ("ALTER TABLE study RENAME COLUMN name TO title", ()),
    ]
    content = changed_store(*rng.choice(changes)) if rng.random() < 0.7 else damaged(rng, filled_store())
    _, files = file(rng, "", ".sqlite") if rng.random() < 0.1 else ("", {"": content})
    found = next(iter(files.values()))
    return ("compare", "given.toml", "--out", "out", "--workers", "1"), {
        "given.toml": STUDY.encode(),
        f"out/{NAME}": found,
    }


def damaged(rng, content):
    """Bytes of which some are others, or missing."""
    data = bytearray(content)
    for _ in range(rng.choice([1, 10, 100])):
        data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data[: rng.choice([len(data), rng.randrange(len(data))])])


def changed_store(statement, values):
    """The store after a statement of SQL; as it was where that is refused."""
    connection = sqlite3.connect(":memory:")
    connection.deserialize(filled_store())
    try:
        with connection:
            connection.execute(statement, values)
    except (sqlite3.Error, OverflowError):
        pass  # such as of a key that there is already
    return connection.serialize()


@cache
def filled_store():
    """The store of the study, all trials done."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "given.toml"
        path.write_text(STUDY)
        fill(Path(folder), list_trials(read_study(str(path))))
        return (Path(folder) / NAME).read_bytes()


@cache
def recording():
    """A mission of five scans that was never flown."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mission.npz"
        save(record(5, trees=5, seed=2, uavs=2, people=2), path)
        return path.read_bytes()


def recorded(rng):
    """A command on a recording of which something was changed."""
    with zipfile.ZipFile(io.BytesIO(recording())) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for _ in range(rng.choice([0, 1, 1, 1, 2])):
        name = rng.choice(sorted(members))
        members[name] = changed_array(rng, name, members[name])
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    content = packed.getvalue() if rng.random() < 0.8 else damaged(rng, packed.getvalue())
    ways = [
        ("frames", "--uav", "1", "--time", "0.4"), ("export", "--to", rng.choice(["csv", "stonesoup", "mot"])),
        ("replay", "--layout", "map"), ("replay", "--page"), ("replay", "--rerun", "x.rrd"),
        ("explain",), ("explain", "--time", "0.4", "--target", "1"),
    ]  # fmt: skip
    command, *options = rng.choice(ways)
    return (command, "run", *options), {"run/mission.npz": content}


def changed_array(rng, name, content):
    """The content of a member with another value, shape or type."""
    if rng.random() < 0.1:
        return damaged(rng, content)
    try:
        array = np.load(io.BytesIO(content))
    except ValueError:  # it was damaged before
        return content
    if array.dtype.kind == "U":
        return npy(np.array(changed_text(rng, name, str(array))))
    way = rng.random()
    if way < 0.6 and array.size:
        with np.errstate(all="ignore"):
            array = array.copy()
            index = rng.randrange(array.size)
            known = [x for x in NUMBERS if array.dtype.kind == "f" or (x == x and abs(x) < 2**63)]
            number = rng.choice([x for x in known if not isinstance(x, int) or abs(x) < 2**63])
            array.reshape(-1)[slice(index, index + rng.choice([1, 1, 99]))] = number
    elif way < 0.8:
        array = array[..., None] if array.ndim == 0 else array[: rng.randint(0, len(array))]
    else:
        with np.errstate(all="ignore"):
            array = array.astype(rng.choice(["<f4", ">f8", "<i8", "<f8", "|b1", "<U8"]))
    return npy(array)


def changed_text(rng, name, text):
    if name != "scenario.npy" or rng.random() < 0.2:
        return flaw(rng, text).replace("\0", "")
    data = json.loads(text)
    *path, last = rng.choice(keys()).split(".")
    node = data
    for part in path:
        node = node[int(part)] if part.isdigit() else node[part]
    node[last] = rng.choice([x for x in NUMBERS if x != 10**5000])
    return json.dumps(data)
