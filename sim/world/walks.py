"""Ways of walking: the waypoints and speeds that people want. Steering then avoids trunks and other people."""

import math
from typing import NamedTuple

import numpy as np

from sim.scenario.environment import People
from sim.world.trajectories import SAMPLES_PER_SECOND
from tracking.errors import InputError
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.normal import standard_normal
from tracking.numerics.trigonometry import cos, sin

ROOM = 4.0  # m, room around a start in which people can turn away from obstacles

_JITTER = 2.5  # m, standard deviation of start and waypoints from those of the scenario
_STANDING = 0.01  # m/s, speed of people standing still; not zero, because steering needs a heading
_GO = (6.0, 14.0)  # s, shortest and longest time between two stops
_STOP = (2.0, 8.0)  # s, shortest and longest stop
_RAMP = 1.5  # s, time to stop or to set off
_GROUP = 3  # people; the last group may be smaller
_GAP = 1.5  # m, distance between neighbours in a group
_CLOSE = 0.5  # m, room around the starts of a group's members
_PART = (0.4, 0.9)  # earliest and latest time at which a group parts, as shares of the mission


class Itinerary(NamedTuple):
    """A person's desired way, which steering follows as far as trunks, borders and other people allow.

    Attributes:
        waypoints: (n, 2) m, beginning with the start; empty (0, 2) if the person starts anywhere and wanders.
        pace: (K,) m/s, positive speeds at intervals of 1 / SAMPLES_PER_SECOND.
        room: m, desired distance of the start beyond the least one from trunks and people.
    """

    waypoints: Array
    pace: Array
    room: float = ROOM


class Paths:
    """Walks along `people.paths`, shifted a little at random; people without a path wander."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """One itinerary per column of `paces` (K, M) m/s, with waypoints where |position| <= half (2,) m."""
        count = paces.shape[1]
        paths = [_jitter(i, path, half, rng) for i, path in enumerate(people.paths[:count])]
        nowhere = [np.zeros((0, 2))] * (count - len(paths))
        return [Itinerary(path, pace) for path, pace in zip([*paths, *nowhere], paces.T, strict=True)]


class Waypoints:
    """Walks to one random place in the area after another."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """As `Paths.itineraries`."""
        return [Itinerary(_draw_walk(rng.uniform(-half, half), pace, half, rng), pace) for pace in paces.T]


class StopAndGo:
    """Walks as in `Waypoints`, but with stops of some seconds every now and then."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """As `Paths.itineraries`."""
        slowed = [np.maximum(_STANDING, pace * _draw_stops(len(pace), rng)) for pace in paces.T]
        return Waypoints().itineraries(people, half, np.column_stack([paces[:, :0], *slowed]), rng)


class Groups:
    """Walks of groups of three, side by side to one place after another, until the group parts."""

    def itineraries(self, people: People, half: Array, paces: Array, rng: np.random.Generator) -> list[Itinerary]:
        """As `Paths.itineraries`; all members of a group have the pace of the first."""
        found = []
        for first in range(0, paces.shape[1], _GROUP):
            size = min(_GROUP, paces.shape[1] - first)
            found += _draw_group(size, paces[:, first], half, rng)
        return found


def _draw_group(size: int, pace: Array, half: Array, rng: np.random.Generator) -> list[Itinerary]:
    """Itineraries of a group that parts at a random time."""
    radius = 0.0 if size == 1 else _GAP / (2 * sin(math.pi / size))
    ring = [radius * np.array([cos(2 * math.pi * i / size), sin(2 * math.pi * i / size)]) for i in range(size)]
    inner = np.maximum(half - radius, 1.0)  # half edges for the group's centre, so that all members are in the area
    together = pace[: max(1, int(len(pace) * rng.uniform(*_PART)))]
    shared = _draw_walk(rng.uniform(-inner, inner), together, inner, rng)
    found = []
    for offset in ring:
        own = _draw_walk(shared[-1] + offset, pace, half, rng)
        points = np.clip(np.vstack([shared[:-1] + offset, own]), -half, half)
        found.append(Itinerary(points, pace, _CLOSE))
    return found


def _draw_walk(start: Array, pace: Array, half: Array, rng: np.random.Generator) -> Array:
    """Start and random places (n, 2) m to walk to in turn, as many as a person with paces (K,) m/s can reach."""
    points = [start]
    left = float(np.sum(pace)) / SAMPLES_PER_SECOND
    while left > 0:
        place = rng.uniform(-half, half)
        way = float(length(place - points[-1]))
        points.append(points[-1] + min(1.0, left / way) * (place - points[-1]))
        left -= way
    return np.array(points)


def _draw_stops(samples: int, rng: np.random.Generator) -> Array:
    """Factor (K,) of a person's pace over time: 1 while walking, 0 during stops, with ramps in between."""
    going = np.ones(samples)
    k = 0
    goes = rng.uniform() < 0.7
    while k < samples:
        end = k + round(rng.uniform(*(_GO if goes else _STOP)) * SAMPLES_PER_SECOND)
        going[k:end] = goes
        k = end
        goes = not goes
    width = round(_RAMP * SAMPLES_PER_SECOND)
    sums = np.cumsum(np.concatenate([[0.0], np.full(width - 1, going[0]), going]))
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _jitter(i: int, path: tuple[tuple[float, float], ...], half: Array, rng: np.random.Generator) -> Array:
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
