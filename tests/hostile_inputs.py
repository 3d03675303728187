"""Inputs that may be anything: seeded, most of them wrong in one or a few places, the right ones tiny.

Each input is the arguments of a command and the files in the folder it is called in. Input i of a seed is the same
whatever comes before it: `case(i)`.
"""

import io
import json
import os
import random
import sqlite3
import zipfile
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import msgspec
import numpy as np
import synthetic
from studies import invented

from sim.archive import save
from sim.recording import Recorder
from sim.scenario import Scenario, Uav, resolved
from sim.study.store import NAME, Store
from sim.study.study import read
from sim.study.tasks import tasks

# No value lies between what flies at once and what no mission means: that would be flown, for hours.
NUMBERS = [
    0,
    1,
    2,
    3,
    5,
    7,
    -1,
    0.1,
    0.5,
    -0.0,
    1e-9,
    1e-300,
    1e-320,
    1e9,
    1e300,
    1e308,
    -1e308,
    10**9,
    10**19,
    10**400,
]
NUMBERS += [-(10**19), 10**5000, float("inf"), float("nan")]
WORDS = [
    "",
    "x",
    "hover",
    "ideal",
    "none",
    "\x00",
    "\x1b[2J",
    "a\nb",
    "é",
    "\u202e",
    "٣",
    "²",
    "/dev/zero",
    "../..",
    "x" * 9999,
]
DEEP = 3000  # brackets
TINY = {"duration": 0.4, "people.count": 2, "sensing.mode": "ideal", "trees.density": 3}
PLANNERS = ["hover", "greedy", "lawnmower", "sma-nbo(horizon=1, evaluations=64)"]
COMMANDS = [
    "run",
    "compare",
    "frames",
    "replay",
    "explain",
    "export",
    "planners",
    "scenarios",
    "studies",
    "check-planner",
]


@dataclass(frozen=True)
class Case:
    """A command and the files that it finds; a file is its bytes, or a function that makes it at a path."""

    kind: str
    arguments: tuple[str, ...]
    files: dict

    def make(self, folder):
        """Write the files into a folder."""
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content) if isinstance(content, bytes) else content(path)


def case(number, seed=0):
    """Input of a number."""
    rng = random.Random(f"{seed} {number}")
    kind = rng.choice(list(KINDS))
    arguments, files = KINDS[kind](rng)
    fitting = (
        argument.replace("\0", "").encode(errors="replace").decode() for argument in arguments
    )  # as a shell does
    return Case(kind, tuple(fitting), files)


def nested(rng):
    """Brackets by the thousand, closed or not."""
    left, right = rng.choice(["[]", "()", "{}", ("{a=", "}"), ('{"a":', "}"), ("-", ""), ("a.", "")])
    return left * DEEP + "1" + right * DEEP * rng.randint(0, 1)


def value(rng, plain=0.6):
    """A number, a word, or a list or table of them."""
    if rng.random() < plain:
        return rng.choice(NUMBERS)
    shape = rng.random()
    if shape < 0.5:
        return rng.choice([*WORDS, True, False])
    if shape < 0.9:
        return [value(rng, 0.9) for _ in range(rng.randint(0, 3))]
    return {rng.choice(["x", "links", "start", "a.b", ""]): value(rng, 0.9)}


def toml(found):
    """A value in TOML."""
    if isinstance(found, bool):
        return str(found).lower()
    if isinstance(found, str):
        return json.dumps(found)
    if isinstance(found, list | tuple):
        return f"[{', '.join(map(toml, found))}]"
    if isinstance(found, dict):
        return f"{{{', '.join(f'{json.dumps(key)} = {toml(item)}' for key, item in found.items())}}}"
    return long(found)


def long(number):
    """A number as text, of however many digits."""
    return "1" + "0" * 5000 if isinstance(number, int) and number == 10**5000 else str(number)


@cache
def keys():
    """Every key of a scenario, those of the first UAV among them."""

    def under(kind, prefix):
        for name in kind.__struct_fields__:
            inner = getattr(Scenario(), name, None) if kind is Scenario else None
            yield from under(type(inner), f"{name}.") if isinstance(inner, msgspec.Struct) else [f"{prefix}{name}"]

    return [*under(Scenario, ""), *(f"uavs.{i}.{name}" for i in range(2) for name in Uav.__struct_fields__)]


def key(rng):
    """A key, mostly one that there is."""
    known = rng.choice(keys())
    return rng.choice(
        [known] * 12 + [known.upper(), f"{known}.x", known.partition(".")[0], "uavs.²", "", "a." * DEEP + "a"]
    )


def flaw(rng, text):
    """A text with something wrong in it."""
    i, j = sorted(rng.randint(0, len(text)) for _ in range(2))
    return rng.choice(
        [
            text[:i],
            text[:i] + text[j:],
            text + text,
            text[:i] + nested(rng) + text[i:],
            text[:i] + rng.choice(WORDS) + text[i:],
            text[:i] + toml(value(rng)) + text[j:],
            f"{text}\nx = {nested(rng)}",
            "",
        ]
    )


def file(rng, text, suffix):
    """A name and a file of that text; now and then no such file, or one that no text is in."""
    name = f"given{suffix}"
    if rng.random() < 0.85:
        return name, {name: text.encode("utf-8", "surrogatepass")}
    odd = [
        b"",
        text.encode("utf-16"),
        b"\xff\xfe" + rng.randbytes(200),
        rng.randbytes(20) * 300_000,
        os.mkfifo,
        Path.mkdir,
        partial(Path.symlink_to, target="/dev/zero"),
        partial(Path.symlink_to, target="/dev/full"),
        partial(Path.symlink_to, target="/dev/random"),
        partial(Path.symlink_to, target=name),
        partial(sparse, size=40 * 2**30),
        partial(sparse, size=10**7),
    ]
    return name, {name: rng.choice(odd)}


def sparse(path, size):
    """A file of zeros that takes no room on disk."""
    with path.open("wb") as made:
        made.truncate(size)


def tiny(rng, changes=()):
    """A tiny mission as overrides, with changes."""
    settings = {**{name: toml(item) for name, item in TINY.items()}, **dict(changes)}
    return [argument for name, text in settings.items() for argument in ("--set", f"{name}={text}")]


def flown(rng, *arguments):
    return ("run", *arguments, "--no-video", "--planner", rng.choice(PLANNERS), "--out", "out")


def overridden(rng):
    changes = [
        (key(rng), rng.choice([toml(value(rng)), toml(value(rng)), nested(rng)]))
        for _ in range(rng.choice([1, 1, 1, 2, 3]))
    ]
    return flown(rng, *tiny(rng, changes)), {}


def scenario_file(rng):
    lines = [f"{name} = {toml(item)}" for name, item in TINY.items()]
    lines += [f"{key(rng) or 'x'} = {toml(value(rng))}" for _ in range(rng.choice([0, 1, 1, 2]))]
    text = "\n".join(lines)
    name, files = file(rng, flaw(rng, text) if rng.random() < 0.4 else text, ".toml")
    return flown(rng, name, "--duration", "0.4"), files


def trajectories(rng):
    rows = [["t", "id", "x", "y"]]
    rows += [
        [f"{t / 2:g}", who, f"{rng.uniform(-40, 40):.2f}", f"{rng.uniform(-40, 40):.2f}"]
        for who in "ab"
        for t in range(4)
    ]
    for _ in range(rng.choice([0, 1, 1, 2, 5])):
        i, j = rng.randrange(len(rows)), rng.randrange(4)
        odd = [
            "0",
            "1e-320",
            "0.50000000001",
            "1e308",
            "-1e308",
            "nan",
            "inf",
            "",
            "x",
            '"',
            '"a\nb"',
            "y" * 200_000,
            "1" * 5000,
        ]
        rows[i][j] = rng.choice([*odd, *WORDS, long(rng.choice(NUMBERS))])
    if rng.random() < 0.2:
        rows.append(rng.choice([[], ["0"], ["0"] * 9, ["\0"] * 4, rows[1], ["0", "z", "0", "0"]]))
    text = "\n".join(map(",".join, rows))
    name, files = file(rng, text, ".csv")
    changed = [("people.trajectories", json.dumps(name))]
    return flown(rng, *tiny(rng, changed)), files


def option(rng, name):
    """A value of an option, right or wrong."""
    right = {
        "--seed": "3", "--duration": "0.4", "--planner": rng.choice(PLANNERS), "--time": "0.2", "--uav": "0",
        "--target": "1", "--size": "256", "--to": "csv", "--seeds": "0,1", "--maps": "2", "--workers": "1",
        "--timeout": "60", "--speed": "2", "--layout": "map", "--metric": "ospa.mean_m", "--baseline": "hover",
        "--sensing": "ideal", "--keep": "recordings", "--out": "out", "--set": "duration=0.4", "--rerun": "x.rrd",
    }  # fmt: skip
    wrong = [
        long(rng.choice(NUMBERS)),
        rng.choice(WORDS),
        f"{long(rng.choice(NUMBERS))}h",
        "0-9999999999",
        "0-99999",
        "9-0",
    ]
    wrong += [
        "1" * 5000,
        f"0:{long(rng.choice(NUMBERS))}",
        f"hover({nested(rng)})",
        f"sma-nbo(horizon={rng.choice(WORDS)})",
    ]
    wrong += [
        f"{rng.choice(['greedy', 'sma-nbo', 'x' * 5000, 'os'])}({rng.choice(OPTIONS)}={long(rng.choice(NUMBERS))})"
    ]
    wrong += [
        "os:system",
        "os.path:x",
        "x" * 5000 + ":y",
        "sys:exit",
        "json:JSONDecoder",
        "a:b:c",
        ":",
        "/dev/full",
        "given/out",
    ]
    wrong += ["given/out.png", "given/x.mp4", "/proc/out", "n" * 300, "out.png", "new/out.mp4"]
    return right[name] if rng.random() < 0.4 else rng.choice(wrong)


OPTIONS = ["horizon", "sweeps", "samples", "beta", "evaluations", "seconds", "search", "separation", "existence", "x"]
TAKES = {
    "run": ["--seed", "--duration", "--planner", "--out", "--set"],
    "compare": ["--seeds", "--maps", "--planner", "--sensing", "--workers", "--timeout", "--metric", "--baseline"],
    "frames": ["--uav", "--time", "--size", "--out"],
    "replay": ["--layout", "--speed", "--time", "--out", "--rerun"],
    "explain": ["--time", "--target", "--out"],
    "export": ["--to", "--out"],
}


def arguments(rng):
    """A command with options of its own and others'; it finds a recording in `run` and a file named `given`."""
    command = rng.choice([*TAKES, *TAKES, *TAKES, *COMMANDS, rng.choice(WORDS)])
    every = sorted({name for names in TAKES.values() for name in names})
    chosen = rng.sample(TAKES.get(command, every), rng.randint(0, len(TAKES.get(command, every[:4]))))
    words = [command, *(word for name in chosen for word in (name, option(rng, name)))]
    if command in ("frames", "export", "explain", "replay"):
        needed = {"frames": ["--uav", "--time"], "export": ["--to"]}.get(command, [])
        words += ["run", *(word for name in needed if name not in chosen for word in (name, option(rng, name)))]
    if command in ("run", "compare"):
        words += [*tiny(rng), "--duration", "0.4"]
        words += (
            ["--no-video"]
            if command == "run"
            else ["--seeds", "0", "--workers", "1"] * (not {"--maps", "--seeds"} & {*chosen})
        )
    if rng.random() < 0.05:
        words.append(rng.choice([*WORDS, "--nonsense", "--set", "-1"]))
    return tuple(words), {"given": b"x", "run/mission.npz": recording()}


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


def study(rng):
    lines = STUDY.splitlines()
    for _ in range(rng.choice([1, 1, 2])):
        i = rng.randrange(len(lines))
        new = [
            f"{lines[i].partition('=')[0]}= {toml(value(rng))}",
            f"{lines[i].partition('=')[0]}= {nested(rng)}",
            f"{key(rng) or 'x'} = {toml(value(rng))}",
            'seeds = "0-99999999999"',
            f'planners = ["hover", {toml(rng.choice(WORDS))}]',
            f"1 = {{ {rng.choice(keys())} = {toml(value(rng))}, planner.x = {toml(value(rng))} }}",
            rng.choice(["[factors.R]", "[factors.planner]", "[factors.x]", '[factors.""]']),
            f"[[exclude]]\nR = {toml(value(rng))}",
        ]
        lines[i] = rng.choice(new)
    text = "\n".join(lines)
    whole = rng.random() < 0.7
    name, files = file(rng, text if whole else flaw(rng, text), ".toml")
    short = ["--duration", "0.2", "--sensing", "ideal"]  # what has no settings left is tiny, too
    few = [] if whole and rng.random() < 0.5 else ["--maps", "1", "--planner", "hover"]
    return ("compare", name, "--out", "out", "--workers", "1", *short, *few), files


COLUMNS = ["key", "scenario", "factors", "settings", "planner", "seed", "version", "error", "metrics", "ospa"]
COLUMNS += ["scans_per_s", "finished"]


def store(rng):
    """A study that is flown already, and whose store is not what it was."""
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
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "given.toml"
        path.write_text(STUDY)
        listed = tasks(read(str(path)))
        with Store.opened(Path(folder), "tiny") as made:
            for task in listed:
                made.add(task, invented(task))
        return (Path(folder) / NAME).read_bytes()


@cache
def recording():
    """A mission of five scans that was never flown."""
    setting = synthetic.scenario(uavs=2, people=2)
    recorder, forest = Recorder(), synthetic.forest(setting, count=5)
    for snapshot in synthetic.snapshots(setting, forest, 5):
        recorder.add(snapshot)
    made = recorder.recording(scenario=resolved(setting), planner="hover", seed=2, forest=forest)
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "mission.npz"
        save(made, path)
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


def npy(array):
    content = io.BytesIO()
    np.lib.format.write_array(content, np.asanyarray(array), allow_pickle=False)
    return content.getvalue()


KINDS = {
    "override": overridden,
    "scenario": scenario_file,
    "trajectories": trajectories,
    "arguments": arguments,
    "study": study,
    "store": store,
    "recording": recorded,
}
