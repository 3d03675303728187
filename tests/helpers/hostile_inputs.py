"""Inputs that may be anything: seeded, most of them wrong in one or a few places, the right ones tiny.

Each input is the arguments of a command and the files in the folder it is called in. Input i of a seed is the same
whatever comes before it: `case(i)`.
"""

import json
import random
from dataclasses import dataclass

from helpers.hostile_stores import STUDY, recorded, recording, store
from helpers.hostile_values import NUMBERS, WAYS, WORDS, file, flaw, key, keys, long, nested, ranges, toml, value

TINY = {"duration": 0.4, "people.count": 2, "sensing.mode": "ideal", "trees.density": 3}
PLANNERS = ["hover", "greedy", "lawnmower", "sma-nbo(horizon=1, evaluations=64)"]
COMMANDS = ["run", "compare", "frames", "replay", "explain", "export", "planners", "scenarios", "studies"]
COMMANDS += ["check-planner"]


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
    # As a shell does.
    fitting = (argument.replace("\0", "").encode(errors="replace").decode() for argument in arguments)
    return Case(kind, tuple(fitting), files)


def within(rng):
    """A mission at the edges of what is allowed, or anywhere between them."""
    changes = [(name, toml(rng.choice(WAYS[name]))) for name in rng.sample(sorted(WAYS), rng.randint(0, 3))]
    for name in rng.sample(sorted(ranges()), rng.randint(1, 4)):
        least, most = ranges()[name]
        between = least + (most - least) * 10 ** rng.uniform(-6, 0)
        number = rng.choice([least, most, between, between, between])
        changes.append((name, toml(number if isinstance(least, float) else round(number))))
    return flown(rng, *tiny(rng, changes)), {}


def tiny(rng, changes=()):
    """A tiny mission as overrides, with changes."""
    settings = {**{name: toml(item) for name, item in TINY.items()}, **dict(changes)}
    return [argument for name, text in settings.items() for argument in ("--set", f"{name}={text}")]


def flown(rng, *arguments):
    return ("run", *arguments, "--no-video", "--planner", rng.choice(PLANNERS), "--out", "out")


def overridden(rng):
    count = rng.choice([1, 1, 1, 2, 3])
    changes = [(key(rng), rng.choice([toml(value(rng)), toml(value(rng)), nested(rng)])) for _ in range(count)]
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
        [f"{t / 2:g}", person, f"{rng.uniform(-40, 40):.2f}", f"{rng.uniform(-40, 40):.2f}"]
        for person in "ab"
        for t in range(4)
    ]
    for _ in range(rng.choice([0, 1, 1, 2, 5])):
        i, j = rng.randrange(len(rows)), rng.randrange(4)
        odd = ["0", "1e-320", "0.50000000001", "1e308", "-1e308", "nan", "inf", "", "x", '"', '"a\nb"', "y" * 200_000]
        odd.append("1" * 5000)
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
        "--target": "1", "--size": "256", "--seeds": "0,1", "--repeats": "2", "--workers": "1",
        "--timeout": "60", "--speed": "2", "--layout": "map", "--metric": "ospa.mean_m", "--baseline": "hover",
        "--keep": "recordings", "--out": "out", "--set": "duration=0.4", "--rerun": "x.rrd",
        "--to": rng.choice(["csv", "coco", "yolo"]), "--every": "0.2", "--val": "0", "--test": "1",
    }  # fmt: skip
    wrong = [long(rng.choice(NUMBERS)), rng.choice(WORDS), f"{long(rng.choice(NUMBERS))}h", "0-9999999999", "0-99999"]
    wrong += ["9-0", "1" * 5000, f"0:{long(rng.choice(NUMBERS))}", f"hover({nested(rng)})"]
    wrong += [f"sma-nbo(horizon={rng.choice(WORDS)})", rng.choice(["greedy", "sma-nbo", "x" * 5000, "os"])]
    wrong[-1] += f"({rng.choice(OPTIONS)}={long(rng.choice(NUMBERS))})"
    wrong += ["os:system", "os.path:x", "x" * 5000 + ":y", "json:JSONDecoder", "a:b:c", ":", "/dev/full"]
    wrong += ["given/out", "given/out.png", "given/x.mp4", "/proc/out", "n" * 300, "out.png", "new/out.mp4"]
    return right[name] if rng.random() < 0.4 else rng.choice(wrong)


OPTIONS = ["horizon", "sweeps", "samples", "beta", "evaluations", "seconds", "search", "separation", "existence", "x"]
TAKES = {
    "run": ["--seed", "--duration", "--planner", "--out", "--set"],
    "compare": ["--seeds", "--planner", "--repeats", "--workers", "--timeout", "--metric", "--baseline"],
    "frames": ["--uav", "--time", "--size", "--out"],
    "replay": ["--layout", "--speed", "--time", "--out", "--rerun"],
    "explain": ["--time", "--target", "--out"],
    "export": ["--to", "--out", "--every", "--val", "--test", "--seeds"],
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
        few = ["--seeds", "0", "--workers", "1"] * ("--seeds" not in chosen)
        words += ["--no-video"] if command == "run" else few
    if rng.random() < 0.05:
        words.append(rng.choice([*WORDS, "--nonsense", "--set", "-1"]))
    return tuple(words), {"given": b"x", "run/mission.npz": recording()}


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
    short = ["--duration", "0.2", "--set", "sensing.mode=ideal"]  # what has no settings left is tiny, too
    few = [] if whole and rng.random() < 0.5 else ["--seeds", "0", "--planner", "hover"]
    return ("compare", name, "--out", "out", "--workers", "1", *short, *few), files


KINDS = {
    "override": overridden,
    "within": within,
    "scenario": scenario_file,
    "trajectories": trajectories,
    "arguments": arguments,
    "study": study,
    "store": store,
    "recording": recorded,
}
