"""How a search changes plans, and which of them it takes for different, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracking.compiled import Array, compiled

KINDS = 6


class Chances(NamedTuple):
    """The random numbers behind N children of plans of k UAVs over H steps."""

    normal: Array  # (N, 3): a change along each axis, and the logarithm of the change's size
    noise: Array  # (ceil(N / KINDS), 2 k (H + 1)): of each UAV, then of each of its steps
    steps: NDArray[np.int64]  # (N,) below 2 k H: a UAV, one of its steps, and whether later ones are meant too
    mates: NDArray[np.int64]  # (N,) below the number of parents


def chances(rng: np.random.Generator, children: int, parents: Array) -> Chances:
    """Random numbers for so many children of `parents` (E, k, H, 2)."""
    count, k, H, _ = parents.shape
    return Chances(
        rng.standard_normal((children, 3)),
        rng.standard_normal((math.ceil(children / KINDS), 2 * k * (H + 1))),
        rng.integers(2 * k * H, size=children),
        rng.integers(count, size=children),
    )


@compiled
def varied(parents: Array, drawn: Chances, spread: float, max_speeds: Array) -> Array:
    """Children (N, k, H, 2) m/s, within the limits, of parents (E, k, H, 2), each of which has as many.

    They are changed, in turn, in all steps; in one waypoint (twice as many); towards or away from a mate, another of
    the parents; by joining a mate's path; by swapping two controls. Noise has a size of `spread` maximum speeds, times
    a factor by chance; what comes from mates is as large as parents differ.
    """
    normal, noise, steps, mates = drawn
    _, k, H, _ = parents.shape
    out = np.zeros((len(normal), k, H, 2))
    for c in range(len(out)):
        plans, mate, kind = out[c], parents[mates[c]], c % KINDS
        _mix(plans, parents[c * len(parents) // len(out)], 1.0)
        size, step, j = spread * math.exp(normal[c, 2]), steps[c] // 2 % H, steps[c] // (2 * H)
        if kind == 0:
            _shake(plans, noise[c // KINDS], size * math.sqrt(0.5), max_speeds)
        elif kind < 3:
            _bend(plans[j], step, size * max_speeds[j], (normal[c, 0], normal[c, 1]), steps[c] % 2 == 0)
        elif kind == 3:
            _mix(plans, mate, 0.5 * (1.0 + normal[c, 0]))
        elif kind == 4:
            _join(plans[j], mate[j], step, max_speeds[j])
        else:
            other = (step + 1 + mates[c] % max(H - 1, 1)) % H
            for axis in range(2):
                plans[j, step, axis], plans[j, other, axis] = plans[j, other, axis], plans[j, step, axis]
        limit(plans, max_speeds)
    return out


@compiled
def _mix(plans: Array, mate: Array, share: float) -> None:
    """Move plans (k, H, 2) m/s towards others by a share of the difference; a loop, as slices take much longer."""
    for j in range(plans.shape[0]):
        for step in range(plans.shape[1]):
            for axis in range(2):
                plans[j, step, axis] += share * (mate[j, step, axis] - plans[j, step, axis])


@compiled
def _shake(plans: Array, noise: Array, size: float, max_speeds: Array) -> None:
    """Add a constant offset and white noise over the steps, of equal variance, to plans (k, H, 2) m/s."""
    k, H, _ = plans.shape
    for j in range(k):
        for step in range(H):
            for axis in range(2):
                both = noise[2 * j + axis] + noise[2 * k + 2 * (j * H + step) + axis]
                plans[j, step, axis] += size * max_speeds[j] * both


@compiled
def _bend(plan: Array, step: int, size: float, way: tuple[float, float], stay: bool) -> None:
    """Move where a step of a plan (H, 2) m/s leads some `way`, of a size in m/s; the path after it may stay."""
    for axis in range(2):
        plan[step, axis] += size * way[axis]
        if stay and step + 1 < len(plan):
            plan[step + 1, axis] -= size * way[axis]


@compiled
def _join(plan: Array, mate: Array, step: int, max_speed: float) -> None:
    """From a step on, let a plan (H, 2) m/s take to the path of another as fast as it can, and follow that."""
    x = y = 0.0  # from where the plan has got to where the other has, in steps of 1 m/s
    for h in range(len(plan)):
        x, y = x + mate[h, 0], y + mate[h, 1]
        if h >= step:
            share = max_speed / max(math.sqrt(x * x + y * y), max_speed)
            plan[h, 0], plan[h, 1] = x * share, y * share
        x, y = x - plan[h, 0], y - plan[h, 1]


@compiled
def limit(plans: Array, max_speeds: Array) -> None:
    """Shorten controls of one joint plan (k, H, 2) m/s to the speed limits (k,) of its UAVs, in place."""
    for j in range(plans.shape[0]):
        for step in range(plans.shape[1]):
            speed = math.sqrt(plans[j, step, 0] ** 2 + plans[j, step, 1] ** 2)
            if speed > max_speeds[j]:
                plans[j, step, 0] *= max_speeds[j] / speed
                plans[j, step, 1] *= max_speeds[j] / speed


@compiled
def distinct(plans: Array, order: NDArray[np.int64], most: int, apart: float, max_speeds: Array) -> NDArray[np.int64]:
    """The first of `order`, at most so many, of plans (N, k, H, 2) m/s whose paths are apart from those before them.

    apart: of the way at maximum speed in a step, root mean square over UAVs and steps.
    """
    _, k, H, _ = plans.shape
    chosen, count = np.empty(most, dtype=np.int64), 0
    paths, path = np.empty((most, 2 * k * H)), np.empty(2 * k * H)
    for i in order:
        _path(plans[i], max_speeds, path)
        alike = False
        for c in range(count):
            if _within(path, paths[c], k * H * apart * apart):
                alike = True
                break
        if not alike:
            chosen[count], paths[count] = i, path
            count += 1
            if count == most:
                break
    return chosen[:count]


@compiled
def _path(plans: Array, max_speeds: Array, path: Array) -> None:
    """Set where plans (k, H, 2) m/s lead (2 k H,), in ways at maximum speed."""
    d = 0
    for j in range(plans.shape[0]):
        x = y = 0.0
        for h in range(plans.shape[1]):
            x += plans[j, h, 0] / max_speeds[j]
            y += plans[j, h, 1] / max_speeds[j]
            path[d], path[d + 1] = x, y
            d += 2


@compiled
def _within(one: Array, other: Array, square: float) -> bool:
    """Whether the squared distance of two points (D,) is less; the last coordinates, which differ most, come first."""
    total = 0.0
    for d in range(len(one) - 1, -1, -1):
        total += (one[d] - other[d]) ** 2
        if total >= square:
            return False
    return True
