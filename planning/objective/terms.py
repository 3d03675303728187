"""Terms of the objective besides that of tracks: separation of UAVs, and search for undetected targets, compiled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from planning.objective.objective import Objective
from planning.planner import Situation
from planning.prediction.field_of_view import view_quadrangle, viewing_range
from planning.prediction.quadrangle import inside, radius_in_view
from planning.prediction.response import camera_paths
from tracking.geometry.line_of_sight import Grid, is_unobstructed
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.distances import length
from tracking.numerics.trigonometry import hypot

_PRICE = 1e6  # m² per m and step, above any gain in knowledge


@dataclass(frozen=True)
class Separation:
    """Penalty far above any gain in knowledge for plans that bring UAVs nearer than `distance` [m] in space.

    UAVs are taken to fly straight between steps. If all plans come too near, the one that keeps the most distance costs
    least.
    """

    distance: float

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective:
        """As `planning.objective.objective.Term.objective`."""
        now = np.array([v.position for v in situation.vehicles], dtype=float)
        chosen = np.asarray(uavs, dtype=np.int64)
        others = np.delete(
            np.concatenate([now[:, None], camera_paths(now, velocities, situation.step)], axis=1), chosen, axis=0
        )

        def cost(candidates: Array) -> Array:
            ahead = camera_paths(now[chosen], candidates, situation.step)
            start = np.broadcast_to(now[chosen, None], (*ahead.shape[:2], 1, 3))
            own = np.concatenate([start, ahead], axis=2)
            short = np.zeros(len(own))
            for j in range(len(chosen)):
                for other in [*(other[None] for other in others), *(own[:, i] for i in range(j))]:
                    gap = _closest(own[:, j] - other)
                    short += np.maximum(self.distance - gap, 0.0).sum(axis=1)
            return _PRICE * short

        return cost


def _closest(relative: Array) -> Array:
    """Least length (N, H) m of a vector that moves linearly from each of (N, H + 1, 3) m to the next."""
    start, way = relative[:, :-1], np.diff(relative, axis=1)
    along = -(start * way).sum(axis=-1) / np.maximum((way * way).sum(axis=-1), 1e-12)
    return np.asarray(length(start + np.clip(along, 0.0, 1.0)[..., None] * way))


_SPACING = 5.0  # m, between the places whose views are computed
_DETECTION = 0.99  # probability that a person in plain view is found within a step
_FEWEST = 1e-4  # people in a cell; cells with fewer are ignored
_ENTRIES = 4096  # sequences of places that are kept; an optimiser tries some thousand different ones
_QUARTERS = np.array([(a, b) for a in (-0.25, 0.25) for b in (-0.25, 0.25)])  # from a cell's middle, in its edges


class _Sight(NamedTuple):
    """What a UAV sees and how far it flies, all in m."""

    east: float  # of its aim point, from the UAV
    north: float
    radius: float  # of the largest circle about the aim point that is in view
    way: float  # flown in a step


class _Cells(NamedTuple):
    """The C cells in which there may be undetected people."""

    centres: Array  # (C, 2) m
    points: Array  # (C, 4, 2) m: the middles of their quarters
    people: Array  # (H, C): people left after each step; the plans of the other UAVs lower it


class _Views(NamedTuple):
    """Visibility of C cells from V places, as a sparse matrix."""

    starts: Indices  # (V + 1,): index of each place's first cell
    cells: Indices  # (M,)
    shares: Array  # (M,): share of the cell in view


class _Seeing(NamedTuple):
    """Whose views V places have, and the fields of view of the n UAVs."""

    uavs: Indices  # (V,)
    views: Array  # (n, 5, 3), see `field_of_view.view_quadrangle`
    farthest: Array  # (n,) m: distance beyond which no cell is in view


class _Raster(NamedTuple):
    """Views of k UAVs from square rasters of places, one raster each; places are numbered through all UAVs."""

    low: Array  # (k, 2) m: the south-west corner
    side: Indices  # (k,): places along each edge
    first: Indices  # (k,): number of the first place
    views: _Views
    costs_to_go: Array  # (V,): steps from a final place until people left by others can be in view, summed over people
    # Most of the plans that an optimiser tries visit a sequence of places that other plans visited before.
    visited: Indices  # (_ENTRIES, H k): sequences of places; each has one entry, which others may take over
    found: Array  # (_ENTRIES,): sums over people detected from them


@dataclass(frozen=True)
class Search:
    """Search for undetected people: each counts as a track of covariance trace `weight` [m²] at each step.

    A camera has the view from the nearest of places 5 m apart. The cost-to-go counts each person that the other UAVs
    leave undetected, for the steps until the nearest UAV can have the person in the largest circle about the middle of
    its image. In joint plans each UAV assumes that the others end where they intend to; the mean over the UAVs counts.

    Note: the cost-to-go also counts people that the plan itself detects, so that it depends only on the plan's end.
    """

    weight: float

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """As `planning.objective.objective.Term.objective`; None where no undetected people are expected."""
        undetected = situation.undetected
        if undetected is None or not np.any(undetected.people > _FEWEST):
            return None
        cells = np.flatnonzero(undetected.people.ravel() > _FEWEST)
        centres = undetected.centres().reshape(-1, 2)[cells]
        now = np.array([v.position for v in situation.vehicles], dtype=float)
        fleet = camera_paths(now, velocities, situation.step)
        left = np.repeat(undetected.people.ravel()[cells][None], velocities.shape[1], axis=0)
        raster = _raster(situation, uavs, fleet, _Cells(centres, centres[:, None] + _QUARTERS * undetected.cell, left))
        to_come = np.cumsum(left[::-1], axis=0)[::-1].copy()  # people still to be counted from each step on
        return partial(_costs, float(self.weight), to_come, raster, now[list(uavs)], situation.step)


def _raster(situation: Situation, uavs: Sequence[int], fleet: Array, cells: _Cells) -> _Raster:
    """Raster of the places in reach of UAVs; people whom the other UAVs detect are removed from `cells.people`."""
    centres, points, left = cells
    vehicles, steps, step = situation.vehicles, fleet.shape[1], situation.step
    shown = np.array([view_quadrangle(v) for v in vehicles])
    sights = [_sight(view, step * v.max_speed) for view, v in zip(shown, vehicles, strict=True)]
    reach = [math.ceil(steps * step * vehicles[i].max_speed / _SPACING) for i in uavs]  # places in each direction
    low = np.array([vehicles[i].position[:2] - _SPACING * r for i, r in zip(uavs, reach, strict=True)], dtype=float)
    side = 2 * np.array(reach) + 1
    places = list(fleet)
    for j, i in enumerate(uavs):
        places[i] = _square(low[j], int(side[j]), float(vehicles[i].position[2]))
    first = np.cumsum([0, *map(len, places)])
    owners = np.repeat(np.arange(len(vehicles)), np.diff(first))
    # A cell in view may begin this far beyond the range.
    farthest = np.array([viewing_range(v) for v in vehicles]) + float(np.ptp(points[0], axis=0).max(initial=0.0))
    forest = situation.forest
    seeing = _Seeing(owners, shown, farthest)
    views = _views(np.concatenate(places), seeing, points, forest.blockers, forest.grid)
    for i in sorted(set(range(len(vehicles))) - set(uavs)):
        _thin(left, views, first[i])
    costs_to_go = np.zeros(first[-1])
    for i in uavs:
        away = np.full(len(centres), np.inf)
        for other in range(len(vehicles)):
            if other != i:
                away = np.minimum(away, _steps_off(fleet[other, -1], centres, sights[other]))
        costs_to_go[first[i] : first[i + 1]] = _costs_to_go(places[i], centres, sights[i], left[-1], away)
    visited, found = np.full((_ENTRIES, steps * len(uavs)), -1), np.empty(_ENTRIES)
    return _Raster(low, side, first[list(uavs)], views, costs_to_go, visited, found)


def _square(low: Array, side: int, height: float) -> Array:
    """Places (V, 3) m of a square raster with a south-west corner (2,) m and a number of places along each edge."""
    norths, easts = np.divmod(np.arange(side * side), side)
    return np.column_stack([low[0] + _SPACING * easts, low[1] + _SPACING * norths, np.full(side * side, height)])


def _sight(view: Array, way: float) -> _Sight:
    """Sight of a UAV with a field of view (5, 3) that flies `way` m in a step."""
    return _Sight(float(view[4, 0]), float(view[4, 1]), radius_in_view(view), way)


def _steps_off(place: Array, centres: Array, sight: _Sight) -> Array:
    """Steps (C,) that a UAV flies from a place (2 or 3,) m until cells (C, 2) m can be in the circle about its aim."""
    gaps = length(place[:2] + np.array([sight.east, sight.north]) - centres)
    return np.asarray(np.maximum(gaps - sight.radius, 0.0) / sight.way)


@compiled
def _costs_to_go(places: Array, centres: Array, sight: _Sight, people: Array, away: Array) -> Array:
    """Steps until people can be in view, from a place (V,) or after `away` (C,) steps by others; summed over people."""
    total, east, north = np.zeros(len(places)), places[:, 0] + sight.east, places[:, 1] + sight.north
    radius, way = sight.radius, sight.way
    for c in range(len(centres)):
        for v in range(len(places)):  # the inner loop, so that several places are summed at once
            gap = hypot(east[v] - centres[c, 0], north[v] - centres[c, 1])
            total[v] += min(max(gap - radius, 0.0) / way, away[c]) * people[c]
    return total


@compiled
def _views(places: Array, seeing: _Seeing, points: Array, blockers: Array, grid: Grid) -> _Views:
    """Views from places (V, 3) m; cells, from south to north, are given by four points (C, 4, 2) m each."""
    uavs, view, farthest = seeing
    starts = np.zeros(len(places) + 1, np.int64)
    cells, shares = [0], [0.0]  # the first entries only tell Numba the types of the lists
    for v in range(len(places)):
        camera, far = (places[v, 0], places[v, 1], places[v, 2]), farthest[uavs[v]]
        within = np.searchsorted(points[:, 0, 1], np.array([camera[1] - far, camera[1] + far]))
        for c in range(within[0], within[1]):
            if abs(points[c, 0, 0] - camera[0]) > far:
                continue
            seen = 0
            for k in range(points.shape[1]):
                x, y = points[c, k, 0], points[c, k, 1]
                if inside(view[uavs[v]], x - camera[0], y - camera[1]):
                    seen += is_unobstructed(camera, (x, y, TARGET_HEIGHT), blockers, grid)
            if seen:
                cells.append(c)
                shares.append(seen / points.shape[1])
        starts[v + 1] = len(cells) - 1
    return _Views(starts, np.array(cells)[1:], np.array(shares)[1:])


def _thin(left: Array, views: _Views, first: int) -> None:
    """Remove those detected by a UAV at place first + h after step h from the people left after each step (H, C)."""
    for h in range(len(left)):
        seen = slice(views.starts[first + h], views.starts[first + h + 1])
        left[h:, views.cells[seen]] *= 1.0 - _DETECTION * views.shares[seen]


@compiled
def _costs(weight: float, to_come: Array, raster: _Raster, own: Array, step: float, candidates: Array) -> Array:
    """Objective (N,) m² of mean velocities (N, k, H, 2) m/s of UAVs now at `own` (k, 3) m; to_come (H, C) people."""
    result = np.full(len(candidates), to_come[0].sum())
    left, (H, k) = np.ones(to_come.shape[1]), (len(to_come), len(own))
    places = np.empty(H * k, np.int64)
    for n in range(len(candidates)):
        entry = 0
        for j in range(k):
            x, y = own[j, 0] - raster.low[j, 0], own[j, 1] - raster.low[j, 1]
            for h in range(H):
                x += step * candidates[n, j, h, 0]
                y += step * candidates[n, j, h, 1]
                place = raster.first[j] + round(y / _SPACING) * raster.side[j] + round(x / _SPACING)
                places[h * k + j], entry = place, (131 * entry + place) % _ENTRIES
            result[n] += raster.costs_to_go[places[(H - 1) * k + j]] / k
        if not _equal(raster.visited[entry], places):
            raster.visited[entry] = places
            raster.found[entry] = _found(raster.views, places, to_come, left)
        result[n] -= raster.found[entry]
    return weight * result


@inlined
def _equal(one: Indices, other: Indices) -> bool:
    for m in range(len(one)):
        if one[m] != other[m]:
            return False
    return True


@compiled
def _found(views: _Views, places: Indices, to_come: Array, left: Array) -> float:
    """Sum over people detected from places (H k,) of the steps from then on; left (C,) is ones before and after."""
    total, k = 0.0, len(places) // len(to_come)
    for p in range(len(places)):
        for m in range(views.starts[places[p]], views.starts[places[p] + 1]):
            cell, found = views.cells[m], _DETECTION * views.shares[m]
            total += left[cell] * found * to_come[p // k, cell]
            left[cell] *= 1.0 - found
    for place in places:
        for m in range(views.starts[place], views.starts[place + 1]):
            left[views.cells[m]] = 1.0
    return total
