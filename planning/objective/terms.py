"""The objective, which optimisers minimise, and its terms besides the tracks: separation and search, compiled."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from planning.planner import Situation
from planning.prediction.field_of_view import view_quadrangle, viewing_range
from planning.prediction.quadrangle import inside, radius_in_view
from planning.prediction.response import camera_paths
from planning.prediction.surroundings import LEAST_RADIUS, find_near_uavs
from tracking.geometry.leaf_gaps import middle_detectability
from tracking.geometry.line_of_sight import Grid
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.distances import length
from tracking.numerics.trigonometry import hypot

# Function from candidates (N, k, H, 2) m/s to costs (N,) m². Candidates are commands in optimisers and mean velocities
# in terms. The term of tracks also takes `ease` (k,) m/s: fields of view are wider by ease times a step on each side.
Objective = Callable[..., Array]


class Term(Protocol):
    """A term of the objective besides the uncertainty of tracks.

    Example:
        ```python
        class Calm:
            def objective(self, situation, velocities, uavs):
                return lambda candidates: (candidates**2).sum(axis=(1, 2, 3))
        ```
    """

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """Cost [m²] as a function of the mean velocities of UAVs `uavs`; the others fly `velocities`. None if zero.

        velocities (n, H, 2) m/s: a row for each UAV of `situation.vehicles`.
        """


_PRICE = 1e6  # m² per m and step, above any gain in knowledge


@dataclass(frozen=True)
class Separation:
    """Penalty far above any gain in knowledge for plans that bring UAVs nearer than `distance` [m] in space.

    UAVs are assumed to fly straight between steps. If all plans come too near, the plan that keeps the most distance
    costs least.
    """

    distance: float

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective:
        """As `planning.objective.terms.Term.objective`."""
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
                    gap = _find_least_lengths(own[:, j] - other)
                    short += np.maximum(self.distance - gap, 0.0).sum(axis=1)
            return _PRICE * short

        return cost


def _find_least_lengths(relative: Array) -> Array:
    """Least length (N, H) m of a vector that moves linearly from each of (N, H + 1, 3) m to the next."""
    start, way = relative[:, :-1], np.diff(relative, axis=1)
    along = -(start * way).sum(axis=-1) / np.maximum((way * way).sum(axis=-1), 1e-12)
    return np.asarray(length(start + np.clip(along, 0.0, 1.0)[..., None] * way))


_SPACING = 5.0  # m, between the places whose views are computed
_DETECTION = 0.99  # probability that a person in plain view is found within a step
_FEWEST = 1e-4  # people in a cell; cells with fewer are ignored
_RUN = 16  # cells in a row that are looked at together
_ENTRIES = 4096  # sequences of places that are kept; an optimiser tries some thousand different ones
_QUARTERS = np.array([(a, b) for a in (-0.25, 0.25) for b in (-0.25, 0.25)])  # from a cell's middle, in its edges


class _Sights(NamedTuple):
    """What n UAVs see and how far they fly, all in m."""

    aims: Array  # (n, 2): their aim points, from the UAVs
    radii: Array  # (n,): of the largest circles about the aim points that are in view
    ways: Array  # (n,): flown in a step


class _Cells(NamedTuple):
    """The C cells in which there may be undetected people."""

    centres: Array  # (C, 2) m
    quarters: Array  # (4, 2) m: the middles of a cell's quarters, from its centre
    people: Array  # (H, C): people left after each step; the plans of the other UAVs lower it


class _Visibility(NamedTuple):
    """Visibility of C cells from V places, as a sparse matrix."""

    starts: Indices  # (V + 1,): index of each place's first cell
    cells: Indices  # (M,)
    shares: Array  # (M,): share of the cell in view


class _Seeing(NamedTuple):
    """The UAV at each of V places, and the fields of view of the n UAVs."""

    uavs: Indices  # (V,)
    views: Array  # (n, 5, 3), see `field_of_view.view_quadrangle`
    farthest: Array  # (n,) m: distance beyond which no cell is in view


class _Raster(NamedTuple):
    """Views of k UAVs from square rasters of places, one raster each; places are numbered through all UAVs."""

    low: Array  # (k, 2) m: the south-west corner
    side: Indices  # (k,): places along each edge
    first: Indices  # (k,): number of the first place
    views: _Visibility
    costs_to_go: Array  # (V,): steps from a final place until people left by others can be in view, summed over people
    # Most of the plans that an optimiser tries visit a sequence of places that other plans visited before.
    visited: Indices  # (_ENTRIES, H k): sequences of places; each has one entry, which others may take over
    found: Array  # (_ENTRIES,): sums over people detected from them
    left: Array  # (C,): ones, a workspace of `_sum_found`


@dataclass(frozen=True)
class Search:
    """Search for undetected people: each counts as a track of covariance trace `weight` [m²] at each step.

    A camera has the view from the nearest of places 5 m apart. As cost-to-go, each person that the other UAVs leave
    undetected also counts at each step that the nearest UAV then needs to have the person in the largest circle about
    the middle of its image. In joint plans each UAV assumes that the others end where they intend to; the mean over the
    UAVs counts.

    Note: the cost-to-go also counts people that the plan itself detects, so that it depends only on the plan's end.
    """

    weight: float

    def objective(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """As `planning.objective.terms.Term.objective`; None where no undetected people are expected."""
        undetected = situation.undetected
        if undetected is None or not np.any(undetected.people > _FEWEST):
            return None
        cells = np.flatnonzero(undetected.people.ravel() > _FEWEST)
        south, west = np.divmod(cells, undetected.people.shape[1])
        centres = np.array(undetected.low) + np.array(undetected.cell) * (np.column_stack([west, south]) + 0.5)
        now = np.array([v.position for v in situation.vehicles], dtype=float)
        fleet = camera_paths(now, velocities, situation.step)
        left = np.repeat(undetected.people.ravel()[cells][None], velocities.shape[1], axis=0)
        raster = _make_raster(situation, uavs, fleet, _Cells(centres, _QUARTERS * undetected.cell, left))
        for h in range(len(left) - 2, -1, -1):
            left[h] += left[h + 1]  # now people still to be counted from each step on
        total = float(np.cumsum(left[0])[-1])  # a sum in the order of the cells
        return partial(_compute_costs, float(self.weight), total, left, raster, now[list(uavs)], situation.step)


def _make_raster(situation: Situation, uavs: Sequence[int], fleet: Array, cells: _Cells) -> _Raster:
    """Raster of the places in reach of UAVs; people whom the other UAVs detect are removed from `cells.people`."""
    vehicles, steps, step = situation.vehicles, fleet.shape[1], situation.step
    shown = np.array([view_quadrangle(v) for v in vehicles])
    sights = _make_sights(shown, [step * v.max_speed for v in vehicles])
    reach = [math.ceil(steps * step * vehicles[i].max_speed / _SPACING) for i in uavs]  # places in each direction
    low = np.array([vehicles[i].position[:2] - _SPACING * r for i, r in zip(uavs, reach, strict=True)], dtype=float)
    side = 2 * np.array(reach) + 1
    near, _ = find_near_uavs(situation, uavs, steps)
    places = [path if keep else path[:0] for path, keep in zip(fleet, near, strict=True)]
    for j, i in enumerate(uavs):
        places[i] = _make_square(low[j], int(side[j]), float(vehicles[i].position[2]))
    first = np.cumsum([0, *map(len, places)])
    owners = np.repeat(np.arange(len(vehicles)), np.diff(first))
    # A cell in view may begin this far beyond the range.
    farthest = np.array([viewing_range(v) if keep else 0.0 for v, keep in zip(vehicles, near, strict=True)]) + float(
        np.ptp(cells.quarters, axis=0).max()
    )
    forest = situation.forest
    views = _find_views(np.concatenate(places), _Seeing(owners, shown, farthest), cells, forest.blockers, forest.grid)
    for i in np.flatnonzero(near).tolist():
        if i not in uavs:
            _thin(cells.people, views, first[i])
    costs_to_go = np.zeros(first[-1])
    for i in uavs:
        costs_to_go[first[i] : first[i + 1]] = _count_steps_to_go(places[i], i, fleet[:, -1], cells, sights)
    visited, found = np.full((_ENTRIES, steps * len(uavs)), -1), np.empty(_ENTRIES)
    return _Raster(low, side, first[list(uavs)], views, costs_to_go, visited, found, np.ones(len(cells.centres)))


def _make_square(low: Array, side: int, height: float) -> Array:
    """Places (V, 3) m of a square raster with a south-west corner (2,) m and a number of places along each edge."""
    norths, easts = np.divmod(np.arange(side * side), side)
    return np.column_stack([low[0] + _SPACING * easts, low[1] + _SPACING * norths, np.full(side * side, height)])


def _make_sights(views: Array, ways: Sequence[float]) -> _Sights:
    """Sights of n UAVs with fields of view (n, 5, 3) that fly `ways` (n,) m in a step."""
    return _Sights(views[:, 4, :2].copy(), radius_in_view(views), np.array(ways))


@compiled
def _count_steps_to_go(places: Array, uav: int, ends: Array, cells: _Cells, sights: _Sights) -> Array:
    """Steps from places (V, 3) m of a UAV until people can be in view, summed over people; the others are at `ends`.

    ends (n, 3) m. Cells beyond `LEAST_RADIUS` are left out if another UAV is certain to be nearer to them.
    """
    total = np.zeros(len(places))
    east, north = places[:, 0] + sights.aims[uav, 0], places[:, 1] + sights.aims[uav, 1]
    low, high = (east.min(), north.min()), (east.max(), north.max())
    away, radius, way, nearer = np.empty(_RUN), sights.radii[uav], sights.ways[uav], 0
    for first in range(0, len(cells.centres), _RUN):
        centres, people = cells.centres[first : first + _RUN], cells.people[-1, first : first + _RUN]
        x0, x1, y0, y1 = centres[:, 0].min(), centres[:, 0].max(), centres[:, 1].min(), centres[:, 1].max()
        gap = hypot(max(low[0] - x1, x0 - high[0], 0.0), max(low[1] - y1, y0 - high[1], 0.0))
        least = max(gap - radius, 0.0) / way * (1.0 - 1e-9)  # steps to any of these cells, whatever the rounding
        limit = least if gap > LEAST_RADIUS else 0.0
        certain, nearer = _count_steps_of_others(away, centres, (x0, x1, y0, y1), limit, (uav, nearer), ends, sights)
        if certain:
            continue
        for c in range(len(centres)):
            x, y = centres[c]
            for v in range(len(places) if away[c] > least else 0):  # the inner loop, so that places are side by side
                total[v] += min(max(hypot(east[v] - x, north[v] - y) - radius, 0.0) / way, away[c]) * people[c]
            for v in range(0 if away[c] > least else len(places)):
                total[v] += away[c] * people[c]
    return total


@compiled
def _count_steps_of_others(
    away: Array,
    centres: Array,
    box: tuple[float, float, float, float],
    limit: float,
    rows: tuple[int, int],
    ends: Array,
    sights: _Sights,
) -> tuple[bool, int]:
    """Set the steps `away` after which others see cells in a box, or stop at one that sees all before `limit` steps.

    rows: the UAV itself, and the other one to begin with. Returns whether it stopped, and the UAV that is nearest.
    """
    away[:] = np.inf
    nearest, latest = rows[1], np.inf  # latest: steps after which some UAV has seen all
    for turn in range(len(ends)):
        other = (rows[1] + turn) % len(ends)
        radius, way = sights.radii[other], sights.ways[other]
        x, y = ends[other, 0] + sights.aims[other, 0], ends[other, 1] + sights.aims[other, 1]
        gap = hypot(max(box[0] - x, x - box[1], 0.0), max(box[2] - y, y - box[3], 0.0))
        if other == rows[0] or max(gap - radius, 0.0) / way * (1.0 - 1e-9) > latest:
            continue
        steps = max(hypot(max(x - box[0], box[1] - x), max(y - box[2], box[3] - y)) - radius, 0.0) / way
        if steps < latest:
            nearest, latest = other, steps
        if steps < limit:
            return True, other
        for c in range(len(centres)):
            away[c] = min(away[c], max(hypot(x - centres[c, 0], y - centres[c, 1]) - radius, 0.0) / way)
    return False, nearest


@compiled
def _find_views(places: Array, seeing: _Seeing, cells: _Cells, blockers: Array, grid: Grid) -> _Visibility:
    """Views from places (V, 3) m of cells, which are in order from south to north, by their quarters."""
    uavs, view, farthest = seeing
    starts = np.zeros(len(places) + 1, np.int64)
    found, shares = [0], [0.0]  # the first entries only tell Numba the types of the lists
    for v in range(len(places)):
        camera, far = (places[v, 0], places[v, 1], places[v, 2]), farthest[uavs[v]]
        within = np.searchsorted(cells.centres[:, 1], np.array([camera[1] - far, camera[1] + far]))
        for c in range(within[0], within[1]):
            if abs(cells.centres[c, 0] - camera[0]) > far:
                continue
            seen = 0.0
            for k in range(len(cells.quarters)):
                x, y = cells.centres[c, 0] + cells.quarters[k, 0], cells.centres[c, 1] + cells.quarters[k, 1]
                if inside(view[uavs[v]], x - camera[0], y - camera[1]):
                    pixel = view[uavs[v], 4, 2]
                    seen += middle_detectability(camera, (x, y, TARGET_HEIGHT), pixel, blockers, grid)
            if seen > 0.0:
                found.append(c)
                shares.append(seen / len(cells.quarters))
        starts[v + 1] = len(found) - 1
    return _Visibility(starts, np.array(found)[1:], np.array(shares)[1:])


@compiled
def _thin(left: Array, views: _Visibility, first: int) -> None:
    """Remove those detected by a UAV at place first + h after step h from the people left after each step (H, C)."""
    for h in range(len(left)):
        for m in range(views.starts[first + h], views.starts[first + h + 1]):
            for later in range(h, len(left)):
                left[later, views.cells[m]] *= 1.0 - _DETECTION * views.shares[m]


@compiled
def _compute_costs(
    weight: float, total: float, to_come: Array, raster: _Raster, own: Array, step: float, candidates: Array
) -> Array:
    """Objective (N,) m² of mean velocities (N, k, H, 2) m/s of UAVs now at `own` (k, 3) m; to_come (H, C) people.

    total: people to come from the first step on, summed over the cells.
    """
    result, (H, k) = np.full(len(candidates), total), (len(to_come), len(own))
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
        if not _are_equal(raster.visited[entry], places):
            for m in range(len(places)):  # assigning the array would take 2 s to compile, for its error
                raster.visited[entry, m] = places[m]
            raster.found[entry] = _sum_found(raster.views, places, to_come, raster.left)
        result[n] -= raster.found[entry]
    return weight * result


@inlined
def _are_equal(one: Indices, other: Indices) -> bool:
    for m in range(len(one)):
        if one[m] != other[m]:
            return False
    return True


@compiled
def _sum_found(views: _Visibility, places: Indices, to_come: Array, left: Array) -> float:
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
