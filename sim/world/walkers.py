"""Walking people: their speeds with Levy step lengths, their itineraries, starts and trajectories."""

import math
from collections.abc import Sequence

import numpy as np

from sim.scenario.environment import WALKS, Area, People
from sim.world.pedestrian_steering import SEPARATION, simulate
from sim.world.trajectories import SAMPLES_PER_SECOND, Trajectories
from sim.world.walks import Itinerary
from tracking.errors import InputError
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.exponential import exp_each, power, power_each
from tracking.numerics.normal import normal_cdf_each, standard_normal
from tracking.numerics.trigonometry import arctan2

TRUNK_CLEARANCE = 0.4  # m, least distance from the bark of a trunk to a person's axis
MARGIN = 1.0  # m, least distance from the border

_PACE_TIME = 4.0  # s, time after which the correlation of a person's pace has fallen to 1/e
_DRIFT_TIME = 4.0  # s, the same for the turn rate of people without a path
_DRIFT = 0.1  # rad/s, standard deviation of that turn rate
_LEVY_EXPONENT = 2.0
_LEAST_SIDE = 4.0  # m, smallest half edge of the area within the margins
_ATTEMPTS = 1000  # number of draws to find a free start
_AT_ONCE = 1024  # moving averages


def walk(people: People, area: Area, forest: Forest, *, duration: float, rng: np.random.Generator) -> Trajectories:
    """Trajectories of `people.count` people for `duration` s; NaN while a person is absent.

    Ways of walking decide where people want to go. After the last waypoint, or if they have none, people wander. They
    avoid obstacles, such as the forest's trunks, by turning, never by stopping. Absent people walk, too, and others
    avoid them.
    """
    count = people.count
    samples = math.ceil(duration * SAMPLES_PER_SECOND) + 1
    half = np.array([area.width, area.height]) / 2 - MARGIN
    if count and min(half) < _LEAST_SIDE:
        least = 2 * (MARGIN + _LEAST_SIDE)
        raise InputError(f"area: {area.width:g} x {area.height:g} m; people need {least:g} m each way to walk in")
    trunks = np.array([(t.x, t.y, t.trunk_radius + TRUNK_CLEARANCE) for t in forest.trees]).reshape(-1, 3)
    pace, drift, start = rng.spawn(3)
    speeds = draw_paces(people, samples, pace)
    drifts = _DRIFT * _smooth_noise(count, samples, _DRIFT_TIME, drift)
    wanted = _make_itineraries(people, half, speeds, start)
    states, paths = _draw_starts(wanted, trunks, half, start)
    speeds = np.column_stack([speeds[:, :0], *(itinerary.pace for itinerary in wanted)])
    positions = simulate(states, speeds, drifts, _sample_routes(paths), trunks, half)
    if people.stay is not None:
        (presence,) = rng.spawn(1)
        positions[~_draw_presence(count, samples, people.stay, presence)] = np.nan
    return Trajectories(np.arange(samples) / SAMPLES_PER_SECOND, positions)


def _make_itineraries(people: People, half: Array, speeds: Array, rng: np.random.Generator) -> list[Itinerary]:
    """Itineraries of all people, divided evenly among the ways of walking."""
    ends = [round(people.count * k / len(people.walks)) for k in range(len(people.walks) + 1)]
    found: list[Itinerary] = []
    for name, first, last in zip(people.walks, ends, ends[1:], strict=False):
        walk = WALKS.make(name)
        own = speeds[:, first:last]
        if name in WALKS.built_in:
            found += walk.itineraries(people, half, own, rng)
            continue
        with WALKS.errors(name, "walk", walk, "itineraries"):
            made = [Itinerary(*itinerary) for itinerary in walk.itineraries(people, half.copy(), own.copy(), rng)]
            _check(made, half, own)
        found += made
    return found


def _check(made: Sequence[Itinerary], half: Array, paces: Array) -> None:
    """ValueError unless these are valid itineraries within the area, one per column of `paces`."""
    if len(made) != paces.shape[1]:
        raise ValueError(f"it made {len(made)} itineraries for {paces.shape[1]} people")
    for waypoints, pace, room in made:
        if not math.isfinite(room):
            raise ValueError(f"room {room!r} is not a finite number")
        if np.shape(pace) != paces.shape[:1] or not np.all((np.asarray(pace) > 0) & np.isfinite(pace)):
            raise ValueError(f"a pace is not {len(paces)} finite numbers above zero")
        points = np.asarray(waypoints, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) == 1 or not np.all(np.abs(points) <= half):
            raise ValueError(f"waypoints are not n x 2 finite numbers within {half.tolist()} m, n = 0 or n > 1")


def _draw_presence(count: int, samples: int, stay: float, rng: np.random.Generator) -> Flags:
    """Mask (K, M) of the samples at which people are present; each person comes and leaves once."""
    last = (samples - 1) / SAMPLES_PER_SECOND
    stays = stay * rng.uniform(0.5, 1.5, count)
    arrivals = rng.uniform(-stays, last, count)
    times = np.arange(samples)[:, None] / SAMPLES_PER_SECOND
    return np.asarray((times >= arrivals) & (times <= arrivals + stays))


def draw_paces(people: People, samples: int, rng: np.random.Generator) -> Array:
    """Speeds (K, M) m/s, smooth in time, with a truncated Levy distribution at any instant.

    A stationary Gaussian process is mapped through its distribution function to the quantiles of a density that is
    proportional to length^-`_LEVY_EXPONENT` between the speed limits.
    """
    gaussian = _smooth_noise(people.count, samples, _PACE_TIME, rng)
    exponent = 1 - _LEVY_EXPONENT
    slowest, fastest = power(people.min_speed, exponent), power(people.max_speed, exponent)
    speeds = power_each(slowest + normal_cdf_each(gaussian) * (fastest - slowest), 1 / exponent)
    return np.asarray(np.clip(speeds, people.min_speed, people.max_speed))


def _smooth_noise(count: int, samples: int, time: float, rng: np.random.Generator) -> Array:
    """Independent Gaussian processes (K, M) of unit variance with correlation exp(-(lag / time)²)."""
    width = time / 2 * SAMPLES_PER_SECOND
    reach = math.ceil(4 * width)
    kernel = exp_each(-0.5 * np.square(np.arange(-reach, reach + 1) / width))
    kernel /= length(kernel)
    # Drawn sample by sample, so that a longer mission begins like a shorter one.
    return _smooth(standard_normal(rng, (samples + 2 * reach, count)), kernel)


@compiled
def _smooth(white: Array, kernel: Array) -> Array:
    """Moving averages (K, M) of white noise (K + L - 1, M) along the first axis, weighted by a kernel (L,)."""
    shape = len(white) - len(kernel) + 1, white.shape[1]
    smooth, drawn = np.zeros(shape[0] * shape[1]), white.ravel()
    for first in range(0, len(smooth), _AT_ONCE):
        sums = smooth[first : first + _AT_ONCE]
        for n in range(len(kernel)):
            values = drawn[first + n * shape[1] :]
            for i in range(len(sums)):  # a vectorised loop over numbers that stay near the processor
                sums[i] += kernel[n] * values[i]
    return smooth.reshape(shape)


def _draw_starts(
    wanted: Sequence[Itinerary], trunks: Array, half: Array, rng: np.random.Generator
) -> tuple[Array, list[Array]]:
    """Initial states (M, 4), clear of trunks and of one another, and each person's path (n, 2) m from there.

    A state is position m, heading rad and turn rate rad/s.
    """
    states = np.zeros((len(wanted), 4))
    paths = []
    for i, (waypoints, _, room) in enumerate(wanted):
        path = np.array(waypoints, dtype=float)
        for attempt in range(_ATTEMPTS):
            drawn = path[0] + 0.01 * attempt * standard_normal(rng, 2) if len(path) else rng.uniform(-half, half)
            # In dense forests the required room shrinks from attempt to attempt.
            if _is_clear(drawn, states[:i], trunks, half, room=room * (1 - 0.9 * attempt / _ATTEMPTS)):
                break
        else:
            text = f"no free place for person {i} to start; allowed are {i} people in a forest and area as these"
            raise InputError(f"people.count = {len(wanted)}: {text}")
        path[:1] = drawn
        ahead = path[1] if len(path) else rng.uniform(-half, half)
        states[i, :3] = *drawn, arctan2(ahead[1] - drawn[1], ahead[0] - drawn[0])
        paths.append(path)
    return states, paths


def _is_clear(point: Array, others: Array, trunks: Array, half: Array, *, room: float) -> bool:
    """True if a point (2,) m is in the area and `room` m more than the least distance from trunks and others."""
    return bool(
        np.all(np.abs(point) <= half)
        and np.all(length(others[:, :2] - point) > SEPARATION + room)
        and np.all(length(trunks[:, :2] - point) > trunks[:, 2] + room)
    )


def _sample_routes(paths: Sequence[Array]) -> Array:
    """Points (M, P, 2) m along each path, about 1 m apart; NaN after its end."""
    dense = []
    for path in paths:
        if not len(path):
            dense.append(path)
            continue
        lengths = np.concatenate([[0.0], np.cumsum(length(np.diff(path, axis=0)))])
        along = np.arange(0.0, lengths[-1], 1.0)
        dense.append(np.column_stack([np.interp(along, lengths, path[:, axis]) for axis in (0, 1)]))
    routes = np.full((len(paths), max(map(len, dense), default=0), 2), np.nan)
    for route, points in zip(routes, dense, strict=True):
        route[: len(points)] = points
    return routes
