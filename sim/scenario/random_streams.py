"""Independent random streams of one mission."""

import zlib

import numpy as np


def stream(seed: int, component: str, *index: int, repeat: int = 0) -> np.random.Generator:
    """The random stream of one component, or of its part with an index, independent of all other components.

    repeat: always 0 for the map (forest, people and their appearance), which the seed alone decides. Sensors, network,
    wind and planner have different streams in each repeat; the streams of repeat 0 depend on the seed alone.
    """
    path = (
        (_number_name(component), *index)
        if repeat == 0
        else (_number_name("repeat"), repeat, _number_name(component), *index)
    )
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=path))


def format_seed(seed: int, repeat: int) -> str:
    """Seed and repeat for display; repeat 0 is not mentioned."""
    return f"seed {seed}, repeat {repeat}" if repeat else f"seed {seed}"


def _number_name(name: str) -> int:
    return zlib.crc32(name.encode())
