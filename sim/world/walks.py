"""Ways of walking: where people want to go, and how fast. Steering then keeps them clear of trunks and one another."""

import math
from typing import NamedTuple

import numpy as np

from sim.scenario.environment import People
from sim.world.trajectories import SAMPLES_PER_SECOND
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.normal import standard_normal
from tracking.numerics.trigonometry import cos, sin
from tracking.plugins.registry import InputError

ROOM = 4.0  # m, about a start, to turn before anything in the way

_JITTER = 2.5  # m, standard deviation of start and waypoints about the scenario's
_STANDING = 0.01  # m/s, of people standing still: steering needs a heading
_GO = (6.0, 14.0)  # s, shortest and longest time between two stops
_STOP = (2.0, 8.0)  # s, shortest and longest stop
_RAMP = 1.5  # s, to stop or to set off
_GAP = 1.5  # m, between neighbours in a group
_CLOSE = 0.5  # m, beyond the least distances, that starts of a group have
_PART = (0.4, 0.9)  # of the mission, first and last time at which a group parts


class Itinerary(NamedTuple):
    """A person's wishes, which steering follows as far as trunks, borders and other people allow."""

    waypoints: Array  # (n, 2) m, the first is the start; none of a person that starts anywhere and wanders
    pace: Array  # (K,) m/s, more than zero, a sample each 1 / SAMPLES_PER_SECOND
    room: float = ROOM  # m, beyond the least distances from trunks and people, that the start should have


class Levy:
    """People along `people.paths`, moved a little at random; those without a path wander."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """One itinerary a column of `paces` (K, M) m/s; waypoints stay where |position| <= half (2,) m."""
        count = paces.shape[1]
        paths = [_jittered(i, path, half, rng) for i, path in enumerate(people.paths[:count])]
        nowhere = [np.zeros((0, 2))] * (count - len(paths))
        return [Itinerary(path, pace) for path, pace in zip([*paths, *nowhere], paces.T, strict=True)]


class Waypoints:
    """People on their way to one place after another, each anywhere in the area."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """As those of `Levy`."""
        return [Itinerary(_wandering(rng.uniform(-half, half), pace, half, rng), pace) for pace in paces.T]


class StopAndGo:
    """As `Waypoints`, but people stand still for some seconds every now and then."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """As those of `Levy`."""
        slowed = np.column_stack([paces[:, :0], *(np.maximum(_STANDING, p * _going(len(p), rng)) for p in paces.T)])
        return Waypoints().itineraries(people, half, slowed, rng)


class Groups:
    """Groups of `people.group` that walk to one place after another side by side, until each goes a way of its own."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """As those of `Levy`; members walk as fast as the first."""
        found = []
        for first in range(0, paces.shape[1], people.group):
            size = min(people.group, paces.shape[1] - first)
            found += _group(size, paces[:, first], half, rng)
        return found


def _group(size: int, pace: Array, half: Array, rng: np.random.Generator) -> list[Itinerary]:
    """Itineraries of a group that parts after a time of chance."""
    radius = 0.0 if size == 1 else _GAP / (2 * sin(math.pi / size))
    ring = [radius * np.array([cos(2 * math.pi * i / size), sin(2 * math.pi * i / size)]) for i in range(size)]
    inner = np.maximum(half - radius, 1.0)  # within which all members fit
    together = pace[: max(1, int(len(pace) * rng.uniform(*_PART)))]
    shared = _wandering(rng.uniform(-inner, inner), together, inner, rng)
    found = []
    for offset in ring:
        own = _wandering(shared[-1] + offset, pace, half, rng)
        points = np.clip(np.vstack([shared[:-1] + offset, own]), -half, half)
        found.append(Itinerary(points, pace, _CLOSE))
    return found


def _wandering(start: Array, pace: Array, half: Array, rng: np.random.Generator) -> Array:
    """Start and places (n, 2) m to walk to one after another, as far as these paces (K,) m/s lead."""
    points, left = [start], float(np.sum(pace)) / SAMPLES_PER_SECOND
    while left > 0:
        place = rng.uniform(-half, half)
        way = float(length(place - points[-1]))
        points.append(points[-1] + min(1.0, left / way) * (place - points[-1]))
        left -= way
    return np.array(points)


def _going(samples: int, rng: np.random.Generator) -> Array:
    """Share (K,) of a person's pace over time: one, and zero during stops, with ramps between."""
    going, k, goes = np.ones(samples), 0, rng.uniform() < 0.7
    while k < samples:
        end = k + round(rng.uniform(*(_GO if goes else _STOP)) * SAMPLES_PER_SECOND)
        going[k:end] = goes
        k, goes = end, not goes
    width = round(_RAMP * SAMPLES_PER_SECOND)
    sums = np.cumsum(np.concatenate([[0.0], np.full(width - 1, going[0]), going]))
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _jittered(i: int, path: tuple[tuple[float, float], ...], half: Array, rng: np.random.Generator) -> Array:
    """Start and waypoints (n, 2) m of person i, moved at random but kept inside."""
    points = np.array(path, dtype=float).reshape(-1, 2)
    if len(points) < 2:
        raise InputError(f"people.paths[{i}]: expected two or more waypoints, got {len(points)}")
    outside = np.any(np.abs(points) > half, axis=1)
    if np.any(outside):
        x, y = points[outside][0]
        raise InputError(
            f"people.paths[{i}]: ({x:g}, {y:g}) is not inside the area; "
            f"allowed are |x| <= {half[0]:g} and |y| <= {half[1]:g} m"
        )
    return np.clip(points + _JITTER * standard_normal(rng, points.shape), -half, half)
