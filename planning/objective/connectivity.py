"""Connectivity: a term of the objective for UAVs that are out of touch, compiled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planning.objective.terms import Objective
from planning.planner import Situation
from planning.prediction.response import camera_paths
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.trigonometry import hypot


@dataclass(frozen=True)
class Connectivity:
    """Cost of `weight` [m²] for each step and each UAV that no chain of links joins to the deciding UAV.

    UAVs are linked within the radio's range, whatever links the network has. UAVs that are not in the situation do not
    count, such as UAVs that have been out of contact for longer than their last plans. In joint plans the mean over
    the deciding UAVs counts.
    """

    weight: float

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """As `planning.objective.terms.Term.objective`; None where radios reach everywhere."""
        reach, step = float(situation.radio_range), situation.step
        if reach == math.inf:
            return None
        now, chosen = np.array([v.position for v in situation.vehicles], dtype=float), np.asarray(uavs, dtype=np.int64)
        paths = np.delete(camera_paths(now, velocities, step), chosen, axis=0)
        own, others = now[chosen], _Others(paths, *_find_groups(paths, reach))
        return lambda candidates: self.weight * _count_unreached(candidates, own, step, others, reach)


class _Others(NamedTuple):
    """The n UAVs whose plans are given; chains of links make groups of them, named by their least rows."""

    paths: Array  # (n, H, 3) m
    groups: Indices  # (H, n): group of each UAV
    sizes: Indices  # (H, n): number of UAVs in the group of each


@compiled
def _find_groups(paths: Array, reach: float) -> tuple[Indices, Indices]:
    """The `groups` and `sizes` of UAVs with these paths (n, H, 3) m."""
    n, steps, _ = paths.shape
    groups, sizes = np.empty((steps, n), np.int64), np.zeros((steps, n), np.int64)
    for h in range(steps):
        for one in range(n):
            groups[h, one] = one
            for other in range(one):
                low, high = min(groups[h, one], groups[h, other]), max(groups[h, one], groups[h, other])
                if low < high and _are_linked(paths[one, h], paths[other, h], reach):
                    for m in range(one + 1):
                        if groups[h, m] == high:
                            groups[h, m] = low
        for one in range(n):
            for other in range(n):
                sizes[h, one] += groups[h, one] == groups[h, other]
    return groups, sizes


@inlined
def _are_linked(one: Array, other: Array, reach: float) -> bool:
    x, y, z = one[0] - other[0], one[1] - other[1], one[2] - other[2]
    return bool(x * x + y * y + z * z <= reach * reach)


@compiled
def _count_unreached(candidates: Array, now: Array, step: float, others: _Others, reach: float) -> Array:
    """Number (N,) of UAVs beyond any chain of links from a deciding UAV, summed over steps, mean over deciding UAVs.

    candidates (N, k, H, 2) m/s: mean velocities of the deciding UAVs, which are at `now` (k, 3) m.
    """
    k, n, found = len(now), len(others.paths), np.zeros(len(candidates))
    places, boxes = np.empty((k, len(candidates), 3)), np.empty((k, 4))
    for j in range(k):
        for c in range(len(candidates)):
            places[j, c, 0], places[j, c, 1], places[j, c, 2] = now[j, 0], now[j, 1], now[j, 2]
    order, joined = np.empty(k, np.int64), np.empty(n, np.bool_)
    for h in range(others.paths.shape[1]):
        for j in range(k):
            box = _move(places[j], candidates[:, j, h], step)
            boxes[j, 0], boxes[j, 1], boxes[j, 2], boxes[j, 3] = box
        if k == 1:
            _add_unreached(found, places[0], boxes[0], others, h, reach)
            continue
        for c in range(len(candidates)):
            for first in range(k):
                for j in range(k):
                    order[j] = j
                order[0], order[first] = first, 0
                found[c] += k + n - _count_reached(places[:, c], others, h, reach, order, joined)
    return found / k


@inlined
def _move(places: Array, velocities: Array, step: float) -> tuple[float, float, float, float]:
    """Move places (N, 3) m at velocities (N, 2) m/s; returns their least and greatest east and north [m]."""
    west = south = math.inf
    east = north = -math.inf
    for c in range(len(places)):
        x, y = places[c, 0] + step * velocities[c, 0], places[c, 1] + step * velocities[c, 1]
        places[c, 0], places[c, 1] = x, y
        west, east = x if x < west else west, x if x > east else east
        south, north = y if y < south else south, y if y > north else north
    return west, east, south, north


@compiled
def _add_unreached(found: Array, places: Array, box: Array, others: _Others, h: int, reach: float) -> None:
    """Add to `found` (N,) the others that no chain of links joins at step h to a UAV at places (N, 3) m.

    The box (4,) m of the places, as from `_move`, decides most groups: linked to all of the places, or to none.
    """
    n, groups, sizes = len(others.paths), others.groups[h], others.sizes[h]
    west, east, south, north = box
    certain, perhaps, count, unreached = np.zeros(n, np.bool_), np.empty(n, np.int64), 0, n
    for m in range(n):
        x, y, z = others.paths[m, h, 0], others.paths[m, h, 1], others.paths[m, h, 2] - places[0, 2]
        far = hypot(max(x - west, east - x), max(y - south, north - y))
        if not certain[groups[m]] and far * far + z * z <= reach * reach:
            certain[groups[m]], unreached = True, unreached - sizes[m]
    for m in range(n):
        x, y, z = others.paths[m, h, 0], others.paths[m, h, 1], others.paths[m, h, 2] - places[0, 2]
        near = hypot(max(west - x, x - east, 0.0), max(south - y, y - north, 0.0))
        if not certain[groups[m]] and near * near + z * z <= reach * reach:
            perhaps[count], count = m, count + 1
    last = np.full(n, -1)  # place to which each group was last found to be linked
    for c in range(len(places)):
        found[c] += unreached
        for m in perhaps[:count]:
            if last[groups[m]] != c and _are_linked(places[c], others.paths[m, h], reach):
                last[groups[m]] = c
                found[c] -= sizes[m]


@inlined
def _count_reached(own: Array, others: _Others, h: int, reach: float, order: Indices, joined: Flags) -> int:
    """Number of UAVs that links join at step h to the first in `order` (k,) of those at `own` (k, 3) m, with itself.

    `joined` (n,) is overwritten, and of `order` the first become those that are reached.
    """
    groups, sizes = others.groups[h], others.sizes[h]
    joined[:] = False  # groups
    count, asked, total = 1, 0, 1  # the first UAVs in `order` are reached; those before `asked` were asked for others
    while asked < count:
        i = order[asked]
        for m in range(len(groups)):
            if not joined[groups[m]] and _are_linked(own[i], others.paths[m, h], reach):
                joined[groups[m]], total = True, total + sizes[m]
        for j in range(count, len(order)):
            linked = _are_linked(own[i], own[order[j]], reach)
            for m in range(len(groups)):
                linked |= joined[groups[m]] and _are_linked(own[order[j]], others.paths[m, h], reach)
            if linked:
                order[count], order[j] = order[j], order[count]
                count, total = count + 1, total + 1
        asked += 1
    return total
