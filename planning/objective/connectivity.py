"""Connectivity: a term of the objective for UAVs that are out of touch, compiled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planning.objective.objective import Objective
from planning.planner import Situation
from planning.prediction.response import camera_paths
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.trigonometry import hypot


@dataclass(frozen=True)
class Connectivity:
    """Cost of `weight` [m²] for each step and each UAV that no chain of links joins to the deciding UAV.

    UAVs are linked within the radio's range, whatever links the network has. UAVs that are not in the situation do not
    count, such as those that have been out of contact for longer than their last plans. In joint plans the mean over
    the deciding UAVs counts.
    """

    weight: float

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """As `planning.objective.objective.Term.objective`; None where radios reach everywhere."""
        reach, step = float(situation.radio_range), situation.step
        if reach == math.inf:
            return None
        now, chosen = np.array([v.position for v in situation.vehicles], dtype=float), np.asarray(uavs, dtype=np.int64)
        own, others = now[chosen], _group(np.delete(camera_paths(now, velocities, step), chosen, axis=0), reach)
        return lambda candidates: self.weight * _count_unreached(candidates, own, step, others, reach)


class _Others(NamedTuple):
    """The n UAVs whose plans are given; chains of links make groups of them, named by their least rows."""

    paths: Array  # (n, H, 3) m
    groups: Indices  # (H, n): group of each UAV
    sizes: Indices  # (H, n): number of UAVs in the group of each


def _group(paths: Array, reach: float) -> _Others:
    """The UAVs with these paths (n, H, 3) m, in groups."""
    n, steps, _ = paths.shape
    step, one, other = np.nonzero(_find_links(paths, reach))
    links = csr_array((np.ones(len(step)), (step * n + one, step * n + other)), shape=(steps * n,) * 2)
    _, groups = connected_components(links, directed=False)
    _, first, sizes = np.unique(groups, return_index=True, return_counts=True)
    return _Others(paths, first[groups].reshape(steps, n) % max(n, 1), sizes[groups].reshape(steps, n))


@compiled
def _find_links(paths: Array, reach: float) -> Flags:
    """Flags (H, n, n) of the pairs of UAVs that are linked at each step of the paths (n, H, 3) m."""
    n, steps, _ = paths.shape
    linked = np.empty((steps, n, n), np.bool_)
    for h in range(steps):
        for one in range(n):
            for other in range(n):
                linked[h, one, other] = _are_linked(paths[one, h], paths[other, h], reach)
    return linked


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
    places = np.empty((k, len(candidates), 3))
    for j in range(k):
        places[j] = now[j]
    certain, perhaps = np.empty((k, n), np.bool_), np.empty((k, n), np.int64)
    counts, order, reached = np.empty(k, np.int64), np.empty(k, np.int64), np.empty(n, np.bool_)
    for h in range(others.paths.shape[1]):
        for j in range(k):
            for c in range(len(candidates)):
                for axis in range(2):
                    places[j, c, axis] += step * candidates[c, j, h, axis]
            counts[j] = _sort_links(places[j], others.paths[:, h], others.groups[h], reach, certain[j], perhaps[j])
        if k == 1 and counts[0] == 0:  # as in most decisions: all candidates are alike
            found += n - others.sizes[h][certain[0]].sum()
            continue
        links = certain, perhaps, counts
        for c in range(len(candidates)):
            for first in range(k):
                for j in range(k):
                    order[j] = j
                order[0], order[first] = first, 0
                found[c] += k + n - _count_reached(places[:, c], others, h, links, reach, order, reached)
    return found / k


@compiled
def _sort_links(places: Array, others: Array, groups: Indices, reach: float, certain: Flags, perhaps: Indices) -> int:
    """Set flags (n,) of the groups that are linked to all places (N, 3) m; list UAVs whose groups may be to some.

    others (n, 3) m are in `groups` (n,). Returns the number of those listed in `perhaps` (n,).
    """
    west, east, south, north = places[:, 0].min(), places[:, 0].max(), places[:, 1].min(), places[:, 1].max()
    count, certain[:] = 0, False
    for m in range(len(others)):
        x, y, z = others[m, 0], others[m, 1], others[m, 2] - places[0, 2]
        far = hypot(max(x - west, east - x), max(y - south, north - y))
        certain[groups[m]] |= far * far + z * z <= reach * reach
    for m in range(len(others)):
        x, y, z = others[m, 0], others[m, 1], others[m, 2] - places[0, 2]
        near = hypot(max(west - x, x - east, 0.0), max(south - y, y - north, 0.0))
        if not certain[groups[m]] and near * near + z * z <= reach * reach:
            perhaps[count] = m
            count += 1
    return count


@inlined
def _count_reached(
    own: Array,
    others: _Others,
    h: int,
    links: tuple[Flags, Indices, Indices],
    reach: float,
    order: Indices,
    reached: Flags,
) -> int:
    """Number of UAVs that links join at step h to the first in `order` (k,), itself included.

    own (k, 3) m: the deciding UAVs; links: as from `_sort_links` for each. `reached` (n,) is overwritten, and of
    `order`, the rows of deciding UAVs, the first become those that are reached.
    """
    groups, sizes, (certain, perhaps, counts) = others.groups[h], others.sizes[h], links
    reached[:] = False  # groups
    count, asked, total = 1, 0, 1  # the first UAVs in `order` are reached; those before `asked` were asked for others
    while asked < count:
        i = order[asked]
        for m in range(len(groups)):
            if certain[i, m] and not reached[m]:
                reached[m], total = True, total + sizes[m]
        for e in range(counts[i]):
            m = perhaps[i, e]
            if not reached[groups[m]] and _are_linked(own[i], others.paths[m, h], reach):
                reached[groups[m]], total = True, total + sizes[m]
        for j in range(count, len(order)):
            joined = _are_linked(own[i], own[order[j]], reach)
            for m in range(len(groups)):
                joined |= reached[groups[m]] and _are_linked(own[order[j]], others.paths[m, h], reach)
            if joined:
                order[count], order[j] = order[j], order[count]
                count, total = count + 1, total + 1
        asked += 1
    return total
