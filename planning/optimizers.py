"""Optimisers over the plans of one or more UAVs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

from tracking.compiled import Array

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
    """Cross-entropy search whose elites survive: never worse than the best plan it is given.

    Each round draws plans round the elites with noise that is correlated in time (a UAV rarely profits from zigzag)
    and shrinks from round to round; elites compete with the new plans. Plans of several basins live on side by side,
    which a single Gaussian, as in textbook CEM, would average. Source: [Pinneri20] for elites and coloured noise.
    """

    evaluations: int = 2048  # the starts aside
    elites: int = 16
    rounds: int = 8
    spread: float = 0.5  # of the maximum speed, at first
    shrink: float = 0.65  # of the spread, per round
    seconds: float = 0.0  # search anew until so much time is used; 0: once. What is found then depends on the machine

    def minimise(self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator) -> Found:
        """As `Optimizer.minimise`."""
        began = perf_counter()
        found = self._search(objective, starts, max_speeds, rng)
        while perf_counter() - began < self.seconds:
            again = self._search(objective, np.concatenate([found.plans[None], starts]), max_speeds, rng)
            found = again._replace(evaluations=found.evaluations + again.evaluations)
        return found

    def _search(self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator) -> Found:
        pool = limited(starts, max_speeds)
        values = objective(pool)
        used, population = len(pool), math.ceil(self.evaluations / self.rounds)
        spread = self.spread * max_speeds[:, None, None]
        for _ in range(self.rounds):
            order = np.argsort(values, kind="stable")[: self.elites]
            pool, values = pool[order], values[order]
            parents = pool[rng.integers(len(pool), size=population)]
            drawn = limited(parents + spread * _correlated(parents.shape, rng), max_speeds)
            pool, values = np.concatenate([pool, drawn]), np.concatenate([values, objective(drawn)])
            used += len(drawn)
            spread = spread * self.shrink
        best = int(np.argmin(values))
        return Found(pool[best], float(values[best]), used)


@dataclass(frozen=True)
class ParticleSwarm:
    """Particle swarm of [Li22] IV: 20 particles per step of the horizon, each drawn to its own and the swarm's best.

    Particles start at the starts and, beyond those, at random; `evaluations` of 0 means 51 moves of the whole swarm.
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
        order = np.argsort(firsts, kind="stable")[: len(particles)]
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
    """Exhaustive search over all sequences of a few controls, and the starts: ground truth for small cases."""

    directions: int = 8
    speeds: int = 1  # besides hovering
    most: int = 2_000_000  # plans

    def controls(self, max_speed: float) -> Array:
        """The controls (D, 2) m/s of which plans are made."""
        angles = 2 * math.pi * np.arange(self.directions) / self.directions
        rim = np.column_stack([np.cos(angles), np.sin(angles)])
        shares = np.arange(1, self.speeds + 1) / self.speeds
        return np.concatenate([np.zeros((1, 2)), *(share * max_speed * rim for share in shares)])

    def minimise(self, objective: Objective, starts: Array, max_speeds: Array, rng: np.random.Generator) -> Found:
        """As `Optimizer.minimise`; ValueError where there are too many plans."""
        _, k, H, _ = starts.shape
        sets = [self.controls(speed) for speed in max_speeds.tolist() for _ in range(H)]
        count = math.prod(len(s) for s in sets)
        if count > self.most:
            raise ValueError(f"optimizer grid: {count} plans of {k} UAVs over {H} steps, at most {self.most} are tried")
        starts = limited(starts, max_speeds)
        values = objective(starts)
        best = int(np.argmin(values))
        found = Found(starts[best], float(values[best]), len(starts) + count)
        plans = itertools.product(*sets)
        while chunk := list(itertools.islice(plans, 65_536)):
            candidates = np.array(chunk).reshape(-1, k, H, 2)
            values = objective(candidates)
            best = int(np.argmin(values))
            if values[best] < found.cost:
                found = found._replace(plans=candidates[best], cost=float(values[best]))
        return found


def limited(plans: Array, max_speeds: Array | float) -> Array:
    """Plans (..., k, H, 2) m/s, each control shortened to the speed limit of its UAV, (k,) or one for all [m/s]."""
    speed = np.linalg.norm(plans, axis=-1, keepdims=True)
    most = np.reshape(max_speeds, (-1, 1, 1))
    return np.asarray(plans * np.minimum(1.0, most / np.maximum(speed, 1e-12)))


def _correlated(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Noise (N, k, H, 2): a constant offset and white noise over the steps, of equal variance, unit in total."""
    constant = rng.standard_normal((*shape[:2], 1, shape[3]))
    return np.asarray((constant + rng.standard_normal(shape)) / np.sqrt(2))
