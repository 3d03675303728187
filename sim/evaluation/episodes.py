"""Episodes: spans of scans with one value."""

from typing import NamedTuple

import numpy as np

from sim.mission.snapshot import Ints


class Episode(NamedTuple):
    """A value that is the same from one scan to another, both included."""

    first: int
    last: int
    value: int


def episodes(values: Ints) -> list[Episode]:
    """Episodes of equal values (K,), in order."""
    edges = np.flatnonzero(np.diff(values)).tolist()
    firsts, lasts = [0, *(k + 1 for k in edges)], [*edges, len(values) - 1]
    return [Episode(a, b, int(values[a])) for a, b in zip(firsts, lasts, strict=True)]
