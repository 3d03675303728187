"""Contacts of UAVs with other bodies."""

import math
from typing import NamedTuple

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled

KINDS = ("uav", "canopy", "trunk", "person", "ground")


class Contact(NamedTuple):
    """Contact of a UAV: the kind of the other body, one of `KINDS`, and its index in that kind."""

    uav: int
    kind: str
    other: int


@compiled
def nearest(positions: Array, commands: Array, seconds: float) -> float:
    """Lower bound [m] of the distance of any two of positions (n, 3) m that move at commands (n, 2) m/s for so long."""
    least = math.inf
    for i in range(len(positions)):
        for j in range(i):
            gap = positions[i] - positions[j]
            closing = commands[i] - commands[j]
            way = math.sqrt(closing[0] * closing[0] + closing[1] * closing[1]) * seconds
            least = min(least, math.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]) - way)
    return least
