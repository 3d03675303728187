"""Values, texts and files that may be anything; each is drawn from a `random.Random`."""

import json
import os
from functools import cache, partial
from pathlib import Path

import msgspec
from msgspec import inspect

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import UavSettings

NUMBERS = [0, 1, 2, 3, 5, 7, -1, 0.1, 0.5, -0.0, 1e-9, 1e-300, 1e-320, 1e9, 1e300, 1e308, -1e308, 10**9, 10**19]
NUMBERS += [10**400, -(10**19), 10**5000, float("inf"), float("nan")]
WORDS = ["", "x", "hover", "ideal", "none", "\x00", "\x1b[2J", "a\nb", "é", "\u202e", "٣", "²", "/dev/zero", "../.."]
WORDS += ["x" * 9999]
DEEP = 3000  # brackets


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
        for name in kind.__struct_encode_fields__:
            inner = getattr(Scenario(), name, None) if kind is Scenario else None
            yield from under(type(inner), f"{name}.") if isinstance(inner, msgspec.Struct) else [f"{prefix}{name}"]

    return [*under(Scenario, ""), *(f"uavs.{i}.{name}" for i in range(2) for name in UavSettings.__struct_fields__)]


def numbers(kind, name=""):
    """Names and types of the numbers in a type."""
    if isinstance(kind, inspect.IntType | inspect.FloatType):
        yield name, kind
    elif isinstance(kind, inspect.StructType):
        for field in kind.fields:
            yield from numbers(field.type, f"{name}.{field.encode_name}".lstrip("."))
    else:
        parts = [getattr(kind, attribute, ()) for attribute in ("types", "item_types")]
        for inner in [*parts[0], *parts[1], *([kind.item_type] if isinstance(kind, inspect.VarTupleType) else [])]:
            yield from numbers(inner, "uavs.0" if name == "uavs" else name)


# What takes time in proportion.
LOADS = {"duration", "area.width", "area.height", "trees.density", "people.count", "uavs.0.pixels", "network.rounds"}
LOADS |= {"rates.physics", "rates.sensing", "rates.planning", "sensing.false_alarms", "uavs.0.rate"}
WAYS = {
    "dynamics": ["quadrotor", "kinematic"], "uavs.0.mount": ["gimbal", "body"], "sensing.noise": ["camera"],
    "sensing.occlusion": ["disc"], "sensing.field_of_view": ["unlimited"], "tracking.initial_tracks": ["none"],
    "tracking.management": ["existence"], "tracking.motion": ["ncv"], "network.fusion": ["kla"],
    "sensing.mode": ["camera"], "wind.velocity": [[12.0, 0.0], [-8.0, 8.0]], "sensing.detector": ["segmentation"],
    "rates.physics": [5, 60, 1000], "people.count": [0, 1, 9], "duration": [1e-9, 1.0], "network.rounds": [0, 20],
    "tracking.confirm": [[1, 1], [62, 62]], "tracking.delete": [[1, 62]], "trees.density": [0, 9],
}  # fmt: skip


@cache
def ranges():
    """Least and most of each number that may be anything in between."""
    low, high = (lambda kind: kind.ge if kind.ge is not None else kind.gt or 0), (lambda kind: kind.le or kind.lt)
    found = {name: (low(kind), high(kind)) for name, kind in numbers(inspect.type_info(Scenario)) if high(kind)}
    return {name: bounds for name, bounds in found.items() if name not in LOADS and "cuts" not in name}


def key(rng):
    """A key, mostly one that there is."""
    known = rng.choice(keys())
    near = [known.upper(), f"{known}.x", known.partition(".")[0], "uavs.²", "", "a." * DEEP + "a"]
    return rng.choice([known] * 12 + near)


def flaw(rng, text):
    """A text with something wrong in it."""
    i, j = sorted(rng.randint(0, len(text)) for _ in range(2))
    cut = [text[:i], text[:i] + text[j:], text + text, text[:i] + nested(rng) + text[i:]]
    changed = [text[:i] + rng.choice(WORDS) + text[i:], text[:i] + toml(value(rng)) + text[j:]]
    return rng.choice([*cut, *changed, f"{text}\nx = {nested(rng)}", ""])


def file(rng, text, suffix):
    """A name and a file of that text; now and then no such file, or one that no text is in."""
    name = f"given{suffix}"
    if rng.random() < 0.85:
        return name, {name: text.encode("utf-8", "surrogatepass")}
    odd = [b"", text.encode("utf-16"), b"\xff\xfe" + rng.randbytes(200), rng.randbytes(20) * 300_000, os.mkfifo]
    odd.append(Path.mkdir)
    odd += [partial(Path.symlink_to, target=t) for t in ("/dev/zero", "/dev/full", "/dev/random", name)]
    odd += [partial(sparse, size=40 * 2**30), partial(sparse, size=10**7)]
    return name, {name: rng.choice(odd)}


def sparse(path, size):
    """A file of zeros that takes no room on disk."""
    with path.open("wb") as made:
        made.truncate(size)
