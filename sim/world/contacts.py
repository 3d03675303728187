"""Contacts of UAVs with other bodies."""

import math
from typing import NamedTuple

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled

KINDS = ("uav", "canopy", "trunk", "person", "ground")
_NAMES = {"uav": "UAV", "canopy": "the canopy of tree", "trunk": "the trunk of tree", "person": "person"}


class Contact(NamedTuple):
    """Contact of a UAV: the kind of the other body, one of `KINDS`, and its index in that kind."""

    uav: int
    kind: str
    other: int


def touched(kind: str, other: int) -> str:
    """The body that a UAV touched in words; as in `Contact`."""
    return "the ground" if kind == "ground" else f"{_NAMES[kind]} {other}"


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
