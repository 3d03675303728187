"""Independent random streams of one mission."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, component: str, *index: int) -> np.random.Generator:
    """The stream of one component, or of its part with an index; the others' use of chance does not change it."""
    key = zlib.crc32(component.encode())
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(key, *index)))
