"""Surroundings of UAVs: the part of a situation that can bear on their plans."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planning.planner import Situation
from planning.prediction.field_of_view import viewing_range
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.distances import length
from tracking.track import beliefs_of

# m: at least this far, nothing is left out. So the worlds of up to 200 x 150 m have recordings of the same bytes.
LEAST_RADIUS = 250.0
_REACHES = 3.0  # two would do for targets that are where they are expected
_DEVIATIONS = 5.0  # of targets' beliefs


def find_surroundings(situation: Situation, uavs: Sequence[int], horizon: int) -> tuple[Situation, Indices]:
    """The part of a situation around its UAVs in rows `uavs`, and the rows of the UAVs that this part has.

    A UAV's reach is the distance at which it can have something in view within the horizon. Targets out of reach, and
    UAVs that reach none of the targets in reach, add the same to the costs of all plans, up to rounding.
    """
    vehicles, duration = situation.vehicles, horizon * situation.step
    near, radius = find_near_uavs(situation, uavs, horizon)
    means, covariances = beliefs_of(situation.tracks)
    spread = np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
    drift = length(means[:, 2:]) + _DEVIATIONS * np.sqrt(covariances[:, 2, 2] + covariances[:, 3, 3])
    centres = np.array([vehicles[i].position[:2] for i in uavs])
    tracked = _are_within(means[:, :2], centres, radius + _DEVIATIONS * spread + duration * drift)
    if tracked.all() and near.all():
        return situation, np.arange(len(vehicles))
    rows = np.flatnonzero(near)
    others = tuple(vehicles[i] for i in rows if vehicles[i] is not situation.own)
    tracks = tuple(situation.tracks[t] for t in np.flatnonzero(tracked))
    return replace(situation, neighbours=others, tracks=tracks), rows


def find_near_uavs(situation: Situation, uavs: Sequence[int], horizon: int) -> tuple[Flags, float]:
    """Mask (n,) of the UAVs in the surroundings of those in rows `uavs`, and the radius of the surroundings [m]."""
    vehicles, duration = situation.vehicles, horizon * situation.step
    radius = max(LEAST_RADIUS, _REACHES * max(v.max_speed * duration + viewing_range(v) for v in vehicles))
    places = np.array([v.position[:2] for v in vehicles])
    return _are_within(places, places[list(uavs)], radius), radius


def _are_within(places: Array, centres: Array, radii: Array | float) -> Flags:
    """Mask (N,) of places (N, 2) m that are at most radii (N,) m from any of some centres (k, 2) m."""
    return np.asarray(np.min(length(places[:, None] - centres), axis=1, initial=np.inf) <= radii)
