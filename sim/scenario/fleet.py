"""Size of a fleet: the first of the UAVs that are listed, or these and copies of them that start beside them."""

import math
from collections.abc import Sequence
from itertools import product
from typing import Annotated

import msgspec
from msgspec import Meta, Struct

from sim.scenario.environment import Area
from sim.scenario.quantities import Point
from sim.scenario.uavs import UavSettings

MOST_UAVS = 200
_GAP = 10.0  # m, least distance of the start of a copy from all others


class Fleet(Struct, frozen=True, forbid_unknown_fields=True):
    """The number of UAVs."""

    # number of UAVs: the first of `uavs`, or all of them and copies of them in turn, each of which starts at the place
    # nearest to its model, on a grid of 10 m, that is 10 m from all others; by default as many as `uavs` lists
    size: Annotated[int, Meta(ge=1, le=MOST_UAVS)] | None = None


def resize(fleet: tuple[UavSettings, ...], size: int | None, area: Area) -> tuple[UavSettings, ...]:
    """The fleet with so many UAVs, None for as many as there are; ValueError if the area has no room for copies."""
    found = list(fleet[:size])
    while len(found) < (size or 0):
        model = fleet[len(found) % len(fleet)]
        found.append(msgspec.structs.replace(model, start=_find_free_place(model.start, found, area)))
    return tuple(found)


def _find_free_place(start: Point, others: Sequence[UavSettings], area: Area) -> Point:
    """The free place nearest to `start` on a grid through it, of equal ones that nearest to the area's middle."""
    columns, rows = (math.ceil(side / _GAP) for side in (area.width, area.height))
    moves = product(range(-columns, columns + 1), range(-rows, rows + 1))
    grid = [(start[0] + i * _GAP, start[1] + j * _GAP) for i, j in moves]
    inside = [(x, y) for x, y in grid if abs(x) <= area.width / 2 and abs(y) <= area.height / 2]
    taken = [other.start for other in others]
    free = [place for place in inside if all(_measure_squared(place, other) >= _GAP * _GAP for other in taken)]
    if not free:
        raise ValueError(f"fleet.size: the area has room for {len(others)} UAVs that start {_GAP:g} m apart, no more")
    return min(free, key=lambda place: (_measure_squared(place, start), _measure_squared(place, (0.0, 0.0)), place))


def _measure_squared(one: Point, other: Point) -> float:
    """Squared distance [m²] of two places."""
    x, y = one[0] - other[0], one[1] - other[1]
    return x * x + y * y
