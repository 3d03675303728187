"""Terms of the objective besides that of tracks: separation of UAVs, and search for undetected targets, compiled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from planning.planner import Situation, Vehicle
from planning.prediction.field_of_view import view_quadrangle, viewing_range
from planning.prediction.intent import camera_paths
from planning.prediction.quadrangle import inside, radius_in_view
from planning.prediction.targets_in_reach import Objective
from tracking.geometry.line_of_sight import Grid, unobstructed
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
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

    def term(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective:
        """As `planning.composition.Term.term`."""
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
_QUARTERS = np.array([(a, b) for a in (-0.25, 0.25) for b in (-0.25, 0.25)])  # from a cell's middle, in its edges

# Aim point (x, y) of a UAV, radius of the circle about it that is in view, and distance flown in a step, all in m.
_Sight = tuple[float, float, float, float]


class _Views(NamedTuple):
    """Visibility of C cells from V places, as a sparse matrix."""

    starts: Indices  # (V + 1,): index of each place's first cell
    cells: Indices  # (M,)
    shares: Array  # (M,): share of the cell in view


class _Raster(NamedTuple):
    """Views of k UAVs from square rasters of places, one raster each; places are numbered through all UAVs."""

    low: Array  # (k, 2) m: the south-west corner
    side: Indices  # (k,): places along each edge
    first: Indices  # (k,): number of the first place
    views: _Views
    costs_to_go: Array  # (V,): steps from a final place until people left by others can be in view, summed over people


@dataclass(frozen=True)
class Search:
    """Search for undetected people: each counts as a track of covariance trace `weight` [m²] at each step.

    A camera has the view from the nearest of places 5 m apart. The cost-to-go counts each person that the other UAVs
    leave undetected, for the steps until the nearest UAV can have the person in the largest circle about the middle of
    its image. In joint plans each UAV assumes that the others end where they intend to; the mean over the UAVs counts.

    Note: the cost-to-go also counts people that the plan itself detects, so that it depends only on the plan's end.
    """

    weight: float

    def term(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """As `planning.composition.Term.term`; None where no undetected people are expected."""
        undetected = situation.undetected
        cells = np.zeros(0, np.int64) if undetected is None else np.flatnonzero(undetected.people.ravel() > _FEWEST)
        if undetected is None or len(cells) == 0:
            return None
        centres = undetected.centres().reshape(-1, 2)[cells]
        points = centres[:, None] + _QUARTERS * undetected.cell
        vehicles = situation.vehicles
        fleet = camera_paths(np.array([v.position for v in vehicles], dtype=float), velocities, situation.step)
        left = np.repeat(undetected.people.ravel()[cells][None], velocities.shape[1], axis=0)
        for i in sorted(set(range(len(vehicles))) - set(uavs)):
            _thin(left, _viewed([vehicles[i]], [fleet[i]], points, situation.forest))
        raster = _raster(situation, uavs, fleet, (centres, points, left[-1]))
        to_come = np.cumsum(left[::-1], axis=0)[::-1].copy()  # people still to be counted from each step on
        own = np.array([vehicles[i].position[:2] for i in uavs], dtype=float)
        return partial(_costs, float(self.weight), to_come, raster, own, situation.step)


def _raster(situation: Situation, uavs: Sequence[int], fleet: Array, undetected: tuple[Array, Array, Array]) -> _Raster:
    """Raster of the places in reach of UAVs.

    undetected: centres (C, 2) m and quarters (C, 4, 2) m of cells, and people left in them (C,).
    """
    centres, points, people = undetected
    deciding, step = [situation.vehicles[i] for i in uavs], situation.step
    reach = [math.ceil(fleet.shape[1] * step * v.max_speed / _SPACING) for v in deciding]  # places in each direction
    low = np.array([v.position[:2] - _SPACING * r for v, r in zip(deciding, reach, strict=True)], dtype=float)
    side = 2 * np.array(reach) + 1
    places, costs_to_go = [], []
    for j, (uav, vehicle) in enumerate(zip(uavs, deciding, strict=True)):
        x, y = np.meshgrid(*(low[j][:, None] + _SPACING * np.arange(side[j])))
        places.append(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, vehicle.position[2])]))
        away = np.full(len(centres), np.inf)
        for i, other in enumerate(situation.vehicles):
            if i != uav:
                away = np.minimum(away, _steps_off(fleet[i, -1], centres, _sight(other, step)))
        costs_to_go.append(_costs_to_go(places[j], centres, _sight(vehicle, step), people, away))
    first = np.cumsum([0, *map(len, places[:-1])])
    return _Raster(low, side, first, _viewed(deciding, places, points, situation.forest), np.concatenate(costs_to_go))


def _sight(vehicle: Vehicle, step: float) -> _Sight:
    view = view_quadrangle(vehicle)
    return float(view[4, 0]), float(view[4, 1]), radius_in_view(view), vehicle.max_speed * step


@compiled
def _steps_off(place: Array, centres: Array, sight: _Sight) -> Array:
    """Steps (C,) that a UAV flies from a place (2 or 3,) m until cells (C, 2) m can be in the circle about its aim."""
    (x, y, radius, way), steps = sight, np.empty(len(centres))
    for c in range(len(centres)):
        gap = hypot(place[0] + x - centres[c, 0], place[1] + y - centres[c, 1])
        steps[c] = max(gap - radius, 0.0) / way
    return steps


@compiled
def _costs_to_go(places: Array, centres: Array, sight: _Sight, people: Array, away: Array) -> Array:
    """Steps until people can be in view, from a place (V,) or after `away` (C,) steps by others; summed over people."""
    total = np.empty(len(places))
    for v in range(len(places)):
        total[v] = np.sum(np.minimum(_steps_off(places[v], centres, sight), away) * people)
    return total


def _viewed(vehicles: Sequence[Vehicle], places: Sequence[Array], points: Array, forest: Forest) -> _Views:
    """Views of UAVs, each from its places (V, 3) m, on cells given by four points (C, 4, 2) m each."""
    cell = float(np.ptp(points[0], axis=0).max(initial=0.0))
    sight = np.array([view_quadrangle(v) for v in vehicles]), np.array([viewing_range(v) + cell for v in vehicles])
    uavs = np.repeat(np.arange(len(vehicles)), [len(own) for own in places])
    return _views(np.concatenate(places), uavs, sight, points, (forest.blockers, forest.grid))


@compiled
def _views(
    places: Array, uavs: Indices, sight: tuple[Array, Array], points: Array, trees: tuple[Array, Grid]
) -> _Views:
    """Views from places (V, 3) m of UAVs (V,); sight: fields of view (k, 5, 3), and how far cells matter (k,) m."""
    (view, farthest), (blockers, grid) = sight, trees
    starts = np.zeros(len(places) + 1, np.int64)
    cells, shares = [0], [0.0]  # the first entries only tell Numba the types of the lists
    for v in range(len(places)):
        camera = places[v, 0], places[v, 1], places[v, 2]
        for c in range(len(points)):
            if max(abs(points[c, 0, 0] - camera[0]), abs(points[c, 0, 1] - camera[1])) > farthest[uavs[v]]:
                continue
            seen = 0
            for k in range(points.shape[1]):
                x, y = points[c, k, 0], points[c, k, 1]
                if inside(view[uavs[v]], x - camera[0], y - camera[1]):
                    seen += unobstructed(camera, (x, y, TARGET_HEIGHT), blockers, grid)
            if seen:
                cells.append(c)
                shares.append(seen / points.shape[1])
        starts[v + 1] = len(cells) - 1
    return _Views(starts, np.array(cells)[1:], np.array(shares)[1:])


def _thin(left: Array, views: _Views) -> None:
    """Remove those detected by a UAV at place h after step h from the people left after each step (H, C)."""
    for h in range(len(left)):
        rows = slice(views.starts[h], views.starts[h + 1])
        left[h:, views.cells[rows]] *= 1.0 - _DETECTION * views.shares[rows]


@compiled
def _costs(weight: float, to_come: Array, raster: _Raster, own: Array, step: float, candidates: Array) -> Array:
    """Objective (N,) m² of mean velocities (N, k, H, 2) m/s of UAVs now at `own` (k, 2) m; to_come (H, C) people."""
    result = np.full(len(candidates), to_come[0].sum())
    left = np.ones(to_come.shape[1])
    places = np.empty((len(to_come), len(own)), np.int64)
    for n in range(len(candidates)):
        for j in range(len(own)):
            x, y = own[j, 0] - raster.low[j, 0], own[j, 1] - raster.low[j, 1]
            for h in range(len(to_come)):
                x += step * candidates[n, j, h, 0]
                y += step * candidates[n, j, h, 1]
                places[h, j] = raster.first[j] + round(y / _SPACING) * raster.side[j] + round(x / _SPACING)
            result[n] += raster.costs_to_go[places[-1, j]] / len(own)
        result[n] -= _found(raster.views, places, to_come, left)
    return weight * result


@compiled
def _found(views: _Views, places: Indices, to_come: Array, left: Array) -> float:
    """Sum over people detected from places (H, k) of the steps from then on; left (C,) is ones before and after."""
    total = 0.0
    for h in range(len(places)):
        for place in places[h]:
            for m in range(views.starts[place], views.starts[place + 1]):
                cell, found = views.cells[m], _DETECTION * views.shares[m]
                total += left[cell] * found * to_come[h, cell]
                left[cell] *= 1.0 - found
    for place in places.ravel():
        left[views.cells[views.starts[place] : views.starts[place + 1]]] = 1.0
    return total
