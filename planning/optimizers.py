"""Optimisers over the plans of one or more UAVs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tracking.compiled import Array, compiled

Objective = Callable[[Array], Array]  # candidates (N, k, H, 2) m/s -> costs (N,)


class Found(NamedTuple):
    """The best that an optimiser found, and what that took."""

    plans: Array  # (k, H, 2) m/s
    cost: float
    evaluations: int


class Optimizer(Protocol):
    """Searches plans of k UAVs; never worse than the best start."""

    def minimise(self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator) -> Found:
        """The best plans found from `starts` (S, k, H, 2) m/s, each control within `max_speeds` (k,) m/s."""
        ...


@dataclass(frozen=True)
class CrossEntropy:
    """Cross-entropy search whose elites survive and keep apart: never worse than the best plan it is given.

    Each round draws plans round the elites with noise that shrinks from round to round; elites compete with the new
    plans. Half of the noise is correlated in time (a UAV rarely profits from zigzag); the other half moves one
    waypoint, or the path from there on, which keeps what the rest of a plan has achieved. Elites whose paths
    are alike count as one, so that several basins, some of them narrow, live on side by side; a single Gaussian, as in
    textbook CEM, would average them. Source: [Pinneri20] for elites and coloured noise.
    """

    evaluations: int = 12_288  # the starts aside
    elites: int = 32
    rounds: int = 10
    spread: float = 1.0  # of the maximum speed, at first
    shrink: float = 0.7  # of spread and distance, per round
    apart: float = (
        0.5  # of the way that maximum speed makes in a step: between elites' paths, root mean square, at first
    )
    # Search anew until so much time is used, and begin no round after it; 0: once. What is found then varies.
    seconds: float = 0.0

    def minimise(self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator) -> Found:
        """As `Optimizer.minimise`."""
        end = perf_counter() + self.seconds if self.seconds else math.inf
        found = self._search(objective, starts, max_speeds, rng, end=end)
        while self.seconds and perf_counter() < end:
            again = self._search(objective, np.concatenate([found.plans[None], starts]), max_speeds, rng, end=end)
            found = again._replace(evaluations=found.evaluations + again.evaluations)
        return found

    def _search(
        self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator, *, end: float
    ) -> Found:
        """One search from the starts, which begins no round after `end` [s]."""
        _, k, H, _ = starts.shape
        max_speeds = np.ascontiguousarray(np.broadcast_to(max_speeds, k), dtype=float)
        pool = limited(starts, max_speeds)
        values = objective(pool)
        used, population, scale = len(pool), math.ceil(self.evaluations / self.rounds), 1.0
        for _ in range(self.rounds):
            if perf_counter() >= end:
                break
            order = self._elite(pool, values, scale, max_speeds)
            pool, values = pool[order], values[order]
            parents = pool[np.arange(population) * len(pool) // population]
            normal = rng.standard_normal((population, 2 * k * (H + 1) + 1))
            moves = rng.integers(2 * k * H, size=population)
            drawn = _varied(parents, normal, moves, scale * self.spread, max_speeds)
            pool, values = np.concatenate([pool, drawn]), np.concatenate([values, objective(drawn)])
            used += population
            scale *= self.shrink
        best = int(np.argmin(values))
        return Found(pool[best], float(values[best]), used)

    def _elite(self, pool: Array, values: Array, scale: float, max_speeds: Array) -> NDArray[np.int64]:
        """Indices of the best plans of `pool` (N, k, H, 2) whose paths are apart, best first."""
        _, k, H, _ = pool.shape
        order = np.argsort(values, kind="stable")
        for considered in (8 * self.elites, len(order)):  # as a rule these are among the best few
            first = order[:considered]
            paths = np.cumsum(pool[first], axis=2) / max_speeds[:, None, None]
            chosen = _distinct(paths.reshape(len(first), -1), self.elites, k * H * (scale * self.apart) ** 2)
            if len(chosen) == self.elites:
                break
        return np.asarray(first[chosen])


@dataclass(frozen=True)
class ParticleSwarm:
    """Particle swarm of [Li22] IV: 20 particles per step of the horizon, each drawn to its own and the swarm's best.

    The best starts are where up to half of the particles begin, the others begin at random; `evaluations` of 0 means
    51 moves of the whole swarm.
    """

    evaluations: int = 0  # the starts aside
    particles_per_step: int = 20
    own: float = 0.5  # c1
    swarm: float = 0.3  # c2
    inertia: float = 0.9  # w
    seconds: float = 0.0  # stop after so much time; 0: no limit

    def minimise(self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator) -> Found:
        """As `Optimizer.minimise`."""
        began = perf_counter()
        shape = (self.particles_per_step * starts.shape[2], *starts.shape[1:])
        particles = limited(rng.uniform(-1.0, 1.0, shape) * max_speeds[:, None, None], max_speeds)
        starts = limited(starts, max_speeds)
        firsts = objective(starts)
        order = np.argsort(firsts, kind="stable")[: len(particles) // 2]
        particles[: len(order)] = starts[order]
        velocities = rng.uniform(-1.0, 1.0, shape) * max_speeds[:, None, None]
        best, values = particles.copy(), objective(particles)
        used, moves = len(starts) + len(particles), math.ceil(self.evaluations / len(particles)) or 52
        for _ in range(moves - 1):
            if self.seconds and perf_counter() - began > self.seconds:
                break
            leader = best[np.argmin(values)]
            toward_own, toward_swarm = rng.random((2, *shape))
            velocities *= self.inertia
            velocities += self.own * toward_own * (best - particles) + self.swarm * toward_swarm * (leader - particles)
            particles = limited(particles + velocities, max_speeds)
            costs = objective(particles)
            better = costs < values
            best[better], values[better] = particles[better], costs[better]
            used += len(particles)
        k = int(np.argmin(values))
        return Found(best[k], float(values[k]), used)


@dataclass(frozen=True)
class Grid:
    """Exhaustive search over all sequences of a few controls, and the starts: ground truth for small cases.

    With a budget, in evaluations or seconds, what it has tried by then, in the order of the controls, is all.
    """

    directions: int = 8
    speeds: int = 1  # besides hovering
    most: int = 2_000_000  # plans without a budget in seconds
    evaluations: int = 0  # the starts aside; 0: all
    seconds: float = 0.0  # stop after so much time; 0: no limit

    def controls(self, max_speed: float) -> Array:
        """The controls (D, 2) m/s of which plans are made."""
        angles = 2 * math.pi * np.arange(self.directions) / self.directions
        rim = np.column_stack([np.cos(angles), np.sin(angles)])
        shares = np.arange(1, self.speeds + 1) / self.speeds
        return np.concatenate([np.zeros((1, 2)), *(share * max_speed * rim for share in shares)])

    def minimise(self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator) -> Found:
        """As `Optimizer.minimise`; ValueError where there are too many plans."""
        end = perf_counter() + self.seconds if self.seconds else math.inf
        _, k, H, _ = starts.shape
        sets = [self.controls(speed) for speed in max_speeds.tolist() for _ in range(H)]
        count = math.prod(len(s) for s in sets)
        tries = min(count, self.evaluations or count)
        if tries > self.most and not self.seconds:
            raise ValueError(f"optimizer grid: {count} plans of {k} UAVs over {H} steps, at most {self.most} are tried")
        starts = limited(starts, max_speeds)
        values = objective(starts)
        best = int(np.argmin(values))
        found = Found(starts[best], float(values[best]), len(starts))
        plans = itertools.islice(itertools.product(*sets), tries)
        while perf_counter() < end and (chunk := list(itertools.islice(plans, 8192))):
            candidates = np.array(chunk).reshape(-1, k, H, 2)
            values = objective(candidates)
            best = int(np.argmin(values))
            found = found._replace(evaluations=found.evaluations + len(candidates))
            if values[best] < found.cost:
                found = found._replace(plans=candidates[best], cost=float(values[best]))
        return found


def limited(plans: Array, max_speeds: Array | float) -> Array:
    """Plans (..., k, H, 2) m/s, each control shortened to the speed limit of its UAV, (k,) or one for all [m/s]."""
    speed = np.linalg.norm(plans, axis=-1, keepdims=True)
    most = np.reshape(max_speeds, (-1, 1, 1))
    return np.asarray(plans * np.minimum(1.0, most / np.maximum(speed, 1e-12)))


@compiled
def _distinct(paths: Array, most: int, apart: float) -> NDArray[np.int64]:
    """Indices of the first rows (N, D) of which each is further than `apart`, squared, from those before it."""
    chosen, count = np.empty(most, dtype=np.int64), 0
    for i in range(len(paths)):
        alike = False
        for j in range(count):
            square = 0.0
            for d in range(paths.shape[1]):
                square += (paths[i, d] - paths[chosen[j], d]) ** 2
            if square < apart:
                alike = True
                break
        if not alike:
            chosen[count] = i
            count += 1
            if count == most:
                break
    return chosen[:count]


@compiled
def _varied(plans: Array, normal: Array, moves: NDArray[np.int64], spread: float, max_speeds: Array) -> Array:
    """Plans (N, k, H, 2) m/s with noise of `spread` maximum speeds, times a factor by chance, within the limits.

    Even plans get a constant offset and white noise over the steps, of equal variance. Odd ones have one waypoint
    moved, with (moves odd) or without the path after it. normal (N, 2 k (H + 1) + 1); moves (N,) below 2 k H.
    """
    out = plans.copy()
    _, k, H, _ = plans.shape
    for c in range(len(plans)):
        size = spread * math.exp(normal[c, -1])
        if c % 2:
            step, j = moves[c] // 2 % H, moves[c] // (2 * H)
            for axis in range(2):
                change = size * max_speeds[j] * normal[c, axis]
                out[c, j, step, axis] += change
                if moves[c] % 2 == 0 and step + 1 < H:
                    out[c, j, step + 1, axis] -= change
        else:
            for j in range(k):
                for step in range(H):
                    for axis in range(2):
                        noise = normal[c, 2 * j + axis] + normal[c, 2 * k + 2 * (j * H + step) + axis]
                        out[c, j, step, axis] += size * max_speeds[j] * noise * math.sqrt(0.5)
        _limit(out[c], max_speeds)
    return out


@compiled
def _limit(plans: Array, max_speeds: Array) -> None:
    """As `limited`, in place, of one joint plan (k, H, 2) m/s."""
    for j in range(plans.shape[0]):
        for step in range(plans.shape[1]):
            speed = math.sqrt(plans[j, step, 0] ** 2 + plans[j, step, 1] ** 2)
            if speed > max_speeds[j]:
                plans[j, step, 0] *= max_speeds[j] / speed
                plans[j, step, 1] *= max_speeds[j] / speed
