"""Observations: knowledge of a UAV as arrays of fixed shape, for training and for planners with a trained policy."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.planner import Situation, Vehicle
from tracking.errors import InputError
from tracking.geometry.camera import ALL_ROUND
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.track import beliefs_of
from tracking.undetected import raster_shape

OWN = ("x", "y", "z", "vx", "vy", "edge")
TRACK = ("dx", "dy", "vx", "vy", "xx", "xy", "yy", "existence", "unseen")
NEIGHBOUR = ("dx", "dy", "dz", "vx", "vy", "edge")
TREE = ("dx", "dy", "radius")
Observed = dict[str, Any]  # arrays by name
_MOST_ROWS = 10_000
_SPREAD = [0, 1, 5]  # xx, xy and yy in a covariance of four by four
_VARIANCE, _DURATION = 100.0, 60.0  # m² and s that scaled observations give as 1


@dataclass(frozen=True)
class Observations:
    """Knowledge of one UAV as arrays of fixed shape, without ground truth.

    Rows are sorted by distance, the nearest first, and padded with zeros; masks `*_mask` are one for actual rows:

    - `own` (6,): x, y, z [m], velocity east and north [m/s], edge of its field of view [m];
    - `tracks` (T, 9): offset [m] and velocity [m/s] east and north, covariance xx, xy and yy of the position [m²],
      probability of existence, time [s] since the last known sure detection or, if there is none, since the start;
    - `neighbours` (N, 6): offset east, north and up [m], velocity [m/s], edge [m]; missing in a fleet of one;
    - `trees` (K, 3): offset east and north, radius of the canopy [m];
    - `undetected` (rows, columns): expected number of undetected people in each cell, rows from south to north, if it
      is asked for.

    Attributes:
        neighbours: number of rows of neighbours, such as the size of the fleet minus one.
        tracks: number of rows of tracks.
        trees: number of rows of trees.
        flat: True for one vector of 32-bit floats in place of the arrays: `neighbours`, `neighbours_mask`, `own`,
            `tracks`, `tracks_mask`, `trees`, `trees_mask`, `undetected` and, of a team, `working`, each row by row.
        scaled: True for lengths in halves of the area's longer edge, speeds in the UAV's speed limit, covariances in
            100 m² and times in minutes, all of them cut off at -1 and 1, and numbers of people at 1.
        undetected: True for the map of undetected people, which has far more numbers than all the rest.
    """

    neighbours: int
    tracks: int = 10
    trees: int = 10
    flat: bool = False
    scaled: bool = False
    undetected: bool = False

    def __post_init__(self) -> None:
        for name, least in (("neighbours", 0), ("tracks", 1), ("trees", 1)):
            rows = getattr(self, name)
            if not isinstance(rows, int | np.integer) or isinstance(rows, bool) or not least <= rows <= _MOST_ROWS:
                raise InputError(f"{name} {rows!r} is not allowed; expected an integer, {least} to {_MOST_ROWS}")
        for name in ("flat", "scaled", "undetected"):
            check_flag(name, getattr(self, name))

    def of(self, situation: Situation) -> Any:  # noqa: ANN401 - arrays by name, or a vector
        """Observation of one UAV: arrays of 32-bit floats, and masks of 8-bit integers; a vector if `flat`."""
        found = self._observe(situation)
        return _flatten(found) if self.flat else found

    def of_team(self, team: Iterable[Situation]) -> Any:  # noqa: ANN401 - as `of`
        """Observations of all UAVs of a team of `neighbours` + 1, as the environment of Gymnasium has them.

        Each array has a row for each UAV by its id, zero without a situation; `working` is one for those with one.
        """
        each = {situation.own.id: self._observe(situation) for situation in team}
        if max(each) > self.neighbours:
            few = f"neighbours: {self.neighbours} is too few for a team with UAV {max(each)}"
            raise InputError(f"{few}; expected the size of the fleet less one")
        some, uavs = next(iter(each.values())), range(self.neighbours + 1)
        nothing = {name: np.zeros_like(array) for name, array in some.items()}
        found = {name: np.stack([each.get(uav, nothing)[name] for uav in uavs]) for name in some}
        found["working"] = np.array([uav in each for uav in uavs], dtype=np.int8)
        return _flatten(found) if self.flat else found

    def _observe(self, situation: Situation) -> Observed:
        here = situation.own.position
        own = np.array([*here, *situation.own.velocity, _measure_edge(situation, situation.own)])
        others = [[*(v.position - here), *v.velocity, _measure_edge(situation, v)] for v in situation.neighbours]
        parts = {
            "tracks": (_make_track_rows(situation), self.tracks),
            "neighbours": (np.array(others, dtype=float).reshape(-1, len(NEIGHBOUR)), self.neighbours),
            "trees": (situation.forest.canopies[:, :3] - [here[0], here[1], 0.0], self.trees),
        }
        if not self.neighbours:
            del parts["neighbours"]
        found: Observed = {"own": _float32(own)}
        for name, (rows, most) in parts.items():
            found[name], found[f"{name}_mask"] = _pad(rows, most)
        if self.undetected:
            known = situation.undetected
            people = np.zeros(raster_shape(situation.area)) if known is None else known.people
            found["undetected"] = _float32(people)
        return found | _scale(found, situation) if self.scaled else found


def check_flag(name: str, value: object) -> None:
    """InputError unless a choice is True or False."""
    if not isinstance(value, bool):
        raise InputError(f"{name} {value!r} is not allowed; expected True or False")


def _scale(found: Observed, situation: Situation) -> Observed:
    """The same arrays, but masks, in units in which they are from -1 to 1."""
    length, speed = max(situation.area) / 2, situation.own.max_speed
    units = {
        "own": [length] * 3 + [speed] * 2 + [length],
        "tracks": [length] * 2 + [speed] * 2 + [_VARIANCE] * 3 + [1.0, _DURATION],
        "neighbours": [length] * 3 + [speed] * 2 + [length],
        "trees": [length] * 3,
        "undetected": [1.0],
    }
    return {name: _float32(np.clip(found[name] / unit, -1.0, 1.0)) for name, unit in units.items() if name in found}


def _flatten(found: Observed) -> NDArray[np.float32]:
    """One vector of arrays in the order of their names, as Gymnasium flattens them."""
    return np.concatenate([_float32(found[name]).ravel() for name in sorted(found)])


def _make_track_rows(situation: Situation) -> Array:
    """Rows (T, 9) of the tracks."""
    means, covariances = beliefs_of(situation.tracks)
    rows = np.empty((len(means), len(TRACK)))
    rows[:, :4] = means
    rows[:, :2] -= situation.own.position[:2]
    rows[:, 4:7] = covariances.reshape(-1, 16)[:, _SPREAD]
    rows[:, 7] = [track.existence for track in situation.tracks]
    seen = [0.0 if math.isnan(track.sighting[2]) else track.sighting[2] for track in situation.tracks]
    rows[:, 8] = situation.time - np.array(seen, dtype=float)
    return rows


@compiled
def _pad(rows: Array, most: int) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
    """The `most` nearest rows by the offset with which each begins, padded with zeros, and their mask."""
    table, mask = np.zeros((most, rows.shape[1]), dtype=np.float32), np.zeros(most, dtype=np.int8)
    left = np.empty(len(rows))
    for n in range(len(rows)):
        left[n] = rows[n, 0] * rows[n, 0] + rows[n, 1] * rows[n, 1]
    for k in range(min(most, len(rows))):
        nearest = np.argmin(left)
        table[k], mask[k], left[nearest] = rows[nearest], 1, np.inf
    return table, mask


def _measure_edge(situation: Situation, vehicle: Vehicle) -> float:
    """Edge [m] of a vehicle's field of view on the ground if it looks down; that of the area if it is unlimited."""
    if vehicle.camera.fov >= ALL_ROUND:
        return max(situation.area)
    return float(vehicle.position[2] * vehicle.camera.pixels / vehicle.camera.focal)


def _float32(values: object) -> NDArray[np.float32]:
    return np.asarray(values, dtype=np.float32)
