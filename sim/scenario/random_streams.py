"""Independent random streams of one mission."""

import zlib

import numpy as np


def stream(seed: int, component: str, *index: int, repeat: int = 0) -> np.random.Generator:
    """The stream of one component, or of its part with an index; the others' use of chance does not change it.

    repeat: 0 for what the seed alone decides, which makes a map: forest, people and how they look. The chance of
    sensors, network, wind and planner has other streams in each repeat; those of repeat 0 are the seed's own.
    """
    path = (_key(component), *index) if repeat == 0 else (_key("repeat"), repeat, _key(component), *index)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=path))


def numbered(seed: int, repeat: int) -> str:
    """Seed and repeat for display; the first repeat is not mentioned."""
    return f"seed {seed}, repeat {repeat}" if repeat else f"seed {seed}"


def _key(name: str) -> int:
    return zlib.crc32(name.encode())
