"""Walking people: Levy step lengths, waypoints, and ways round trunks and one another."""

import math

import numpy as np

from sim.scenario.bounds import Point
from sim.scenario.environment import Area, People
from sim.world.pedestrian_steering import SEPARATION, simulate
from sim.world.trajectories import SAMPLES_PER_SECOND, Trajectories
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.exponential import power
from tracking.numerics.normal import normal_cdf_each, standard_normal
from tracking.numerics.trigonometry import arctan2
from tracking.numerics.universal import exp_each, power_each
from tracking.plugins.registry import InputError

TRUNK_CLEARANCE = 0.4  # m, from a trunk's bark to a person's axis
MARGIN = 1.0  # m, from the border

_PACE_TIME = 4.0  # s, after which the correlation of a person's pace has fallen to 1/e
_DRIFT_TIME = 4.0  # s, the same for the turn rate of people without a path
_DRIFT = 0.1  # rad/s, standard deviation of that turn rate
_JITTER = 2.5  # m, standard deviation of start and waypoints about the scenario's
_ROOM = 4.0  # m, about a start, to turn before anything in the way
_ATTEMPTS = 1000  # to find a free start


def walk(people: People, area: Area, forest: Forest, *, duration: float, rng: np.random.Generator) -> Trajectories:
    """Trajectories of `people.count` people for `duration` s.

    Person i follows the waypoints `people.paths[i]`, all of them moved a little at random, and goes on after the
    last; people without a path start anywhere and wander. All avoidance is by turning, never by stopping.
    """
    count, samples = people.count, math.ceil(duration * SAMPLES_PER_SECOND) + 1
    half = np.array([area.width, area.height]) / 2 - MARGIN
    if count and min(half) < _ROOM:
        least = 2 * (MARGIN + _ROOM)
        raise InputError(f"area: {area.width:g} x {area.height:g} m; people need {least:g} m each way to walk in")
    trunks = np.array([(t.x, t.y, t.trunk_radius + TRUNK_CLEARANCE) for t in forest.trees]).reshape(-1, 3)
    pace, drift, start = rng.spawn(3)
    speeds = paces(people, samples, pace)
    drifts = _DRIFT * _smooth_noise(count, samples, _DRIFT_TIME, drift)
    paths = [_jittered(i, path, half, start) for i, path in enumerate(people.paths[:count])]
    states = _starts(count, paths, trunks, half, start)
    positions = simulate(states, speeds, drifts, _routes(count, paths), trunks, half)
    return Trajectories(np.arange(samples) / SAMPLES_PER_SECOND, positions)


def paces(people: People, samples: int, rng: np.random.Generator) -> Array:
    """Speeds (K, M) m/s, smooth in time; at any instant step lengths are truncated Levy.

    The density of a step's length is proportional to length^-levy_exponent between the speed limits: a stationary
    Gaussian process, mapped through its distribution to that law's quantiles.
    """
    gaussian = _smooth_noise(people.count, samples, _PACE_TIME, rng)
    exponent = 1 - people.levy_exponent
    slowest, fastest = power(people.min_speed, exponent), power(people.max_speed, exponent)
    speeds = power_each(slowest + normal_cdf_each(gaussian) * (fastest - slowest), 1 / exponent)
    return np.asarray(np.clip(speeds, people.min_speed, people.max_speed))


def _smooth_noise(count: int, samples: int, time: float, rng: np.random.Generator) -> Array:
    """Independent Gaussian processes (K, M) of unit variance with correlation exp(-(lag / time)²)."""
    width = time / 2 * SAMPLES_PER_SECOND
    reach = math.ceil(4 * width)
    kernel = exp_each(-0.5 * np.square(np.arange(-reach, reach + 1) / width))
    kernel /= length(kernel)
    # Drawn instant by instant, so that a longer mission begins as a shorter one.
    return _smoothed(standard_normal(rng, (samples + 2 * reach, count)), kernel)


@compiled
def _smoothed(white: Array, kernel: Array) -> Array:
    """Moving averages (K, M) of numbers (K + L - 1, M) along the first axis, weighted by a kernel (L,)."""
    smooth = np.zeros((len(white) - len(kernel) + 1, white.shape[1]))
    for k in range(len(smooth)):
        for n in range(len(kernel)):
            for i in range(white.shape[1]):
                smooth[k, i] += kernel[n] * white[k + n, i]
    return smooth


def _jittered(i: int, path: tuple[Point, ...], half: Array, rng: np.random.Generator) -> Array:
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


def _starts(count: int, paths: list[Array], trunks: Array, half: Array, rng: np.random.Generator) -> Array:
    """Position m, heading rad and turn rate rad/s (M, 4) of all people at the start, clear of trunks and others.

    Starts of `paths` move there too.
    """
    states = np.zeros((count, 4))
    for i in range(count):
        for attempt in range(_ATTEMPTS):
            if i < len(paths):
                drawn = paths[i][0] + 0.01 * attempt * standard_normal(rng, 2)
            else:
                drawn = rng.uniform(-half, half)
            # In a thicket, less and less room has to do.
            if _clear(drawn, states[:i], trunks, half, room=_ROOM * (1 - 0.9 * attempt / _ATTEMPTS)):
                break
        else:
            raise InputError(f"people.count = {count}: no free place for person {i} to start")
        if i < len(paths):
            paths[i][0] = drawn  # the route begins where the person does
        ahead = paths[i][1] if i < len(paths) else rng.uniform(-half, half)
        states[i, :3] = *drawn, arctan2(ahead[1] - drawn[1], ahead[0] - drawn[0])
    return states


def _clear(point: Array, others: Array, trunks: Array, half: Array, *, room: float) -> bool:
    """True if a point (2,) m is inside and keeps `room` m more than the least distance from trunks and others."""
    return bool(
        np.all(np.abs(point) <= half)
        and np.all(length(others[:, :2] - point) > SEPARATION + room)
        and np.all(length(trunks[:, :2] - point) > trunks[:, 2] + room)
    )


def _routes(count: int, paths: list[Array]) -> Array:
    """Points (M, P, 2) m about 1 m apart along each path, NaN after its end."""
    dense = []
    for path in paths:
        lengths = np.concatenate([[0.0], np.cumsum(length(np.diff(path, axis=0)))])
        along = np.arange(0.0, lengths[-1], 1.0)
        dense.append(np.column_stack([np.interp(along, lengths, path[:, axis]) for axis in (0, 1)]))
    routes = np.full((count, max(map(len, dense), default=0), 2), np.nan)
    for route, points in zip(routes, dense, strict=False):
        route[: len(points)] = points
    return routes
