"""Optimisers over the plans of one or more UAVs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

from planning.moves import chances, distinct, varied
from planning.sights import NOTHING, Hints
from tracking.compiled import Array
from tracking.elementary import cos_each, sin_each
from tracking.matrices import length

Objective = Callable[[Array], Array]  # candidates (N, k, H, 2) m/s -> costs (N,)


class Found(NamedTuple):
    """The best that an optimiser found, and what that took."""

    plans: Array  # (k, H, 2) m/s
    cost: float
    evaluations: int


class Optimizer(Protocol):
    """Searches plans of k UAVs; never worse than the best start."""

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        hints: Hints | None = None,
    ) -> Found:
        """The best plans found from `starts` (S, k, H, 2) m/s, each control within `max_speeds` (k,) m/s.

        The hints say more of the objective to those that make use of it.
        """
        ...


class _Task(NamedTuple):
    """What is to be minimised."""

    objective: Objective
    starts: Array
    max_speeds: Array
    hints: Hints | None

    def costs(self, plans: Array, ease: float) -> Array:
        """Of plans (N, k, H, 2) m/s, with fields of view wider by `ease` of the way at maximum speed in a step."""
        return self.hints.eased(plans, ease * self.max_speeds) if self.hints and ease else self.objective(plans)


@dataclass(frozen=True)
class CrossEntropy:
    """Cross-entropy search whose elites survive and keep apart: never worse than the best plan it is given.

    Each round changes the elites with noise that shrinks from round to round; elites compete with the new plans. Some
    of the noise is correlated in time (a UAV rarely profits from zigzag); most moves one waypoint, or the path from
    there on, and what the rest of a plan has achieved is kept as far as the UAV's speed allows. Other plans are put
    together from two elites, as in genetic algorithms: one may have seen somebody early, the other late. Elites whose
    paths are alike count as one, so that several basins, some of them narrow, live on side by side; a single Gaussian,
    as in textbook CEM, would average them. Source: [Pinneri20] for elites and coloured noise.

    The best plans often reach a target in the last moment that they can, with its image just inside the frame, so that
    plans nearby miss it and nothing leads there. So, with hints, some changes bring a target just into view, and in the
    first rounds fields of view are somewhat wider: a continuation from an easier problem (E. L. Allgower, K. Georg,
    Numerical Continuation Methods, Springer, 1990).
    """

    evaluations: int = 12_288  # the starts aside
    elites: int = 32  # in the first round, falling to `last_elites`
    last_elites: int = 12
    rounds: int = 18
    spread: float = 1.0  # of the maximum speed, at first
    shrink: float = 0.8  # of spread and distance, per round
    apart: float = 0.6  # between elites' paths, at first: of the way at maximum speed in a step, root mean square
    ease: float = 0.3  # from which it falls by how much fields of view are wider: of the way at maximum speed in a step
    eased_rounds: float = 0.5  # share of the rounds in which it falls to none
    # Search anew until so much time is used, and begin no round after it; 0: once. What is found then varies.
    seconds: float = 0.0

    def __post_init__(self) -> None:
        least = {"elites": 1, "last_elites": 1, "rounds": 1, "ease": 0, "eased_rounds": 0, "evaluations": 0}
        for name, bound in least.items():
            if getattr(self, name) < bound:
                raise ValueError(f"{name} must be at least {bound}, is {getattr(self, name)}")
        if self.eased_rounds > 1.0:
            raise ValueError(f"eased_rounds must be at most 1, is {self.eased_rounds}")

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        hints: Hints | None = None,
    ) -> Found:
        """As `Optimizer.minimise`."""
        end = perf_counter() + self.seconds if self.seconds else math.inf
        max_speeds = np.ascontiguousarray(np.broadcast_to(max_speeds, starts.shape[1]), dtype=float)
        found = self._search(_Task(objective, starts, max_speeds, hints), rng, end)
        while self.seconds and perf_counter() < end:
            task = _Task(objective, np.concatenate([found.plans[None], starts]), max_speeds, hints)
            again = self._search(task, rng, end)
            found = again._replace(evaluations=found.evaluations + again.evaluations)
        return found

    def _search(self, task: _Task, rng: np.random.Generator, end: float) -> Found:
        """One search from the starts, which begins no round after `end` [s].

        How many random numbers it draws depends on no value, so that who draws next learns nothing from it.
        """
        sights = task.hints.sights if task.hints else NOTHING
        pool = limited(task.starts, task.max_speeds)
        values = task.objective(pool)
        start, used, ease, scale = pool[np.argmin(values)], len(pool), 0.0, 1.0
        for k in range(self.rounds):
            if perf_counter() >= end:
                break
            most = self.elites + (self.last_elites - self.elites) * k // max(self.rounds - 1, 1)
            order = np.argsort(values, kind="stable")
            elite = distinct(pool, order, most, scale * self.apart, task.max_speeds)
            pool, values = pool[elite], values[elite]
            count = self.evaluations * (k + 1) // self.rounds - self.evaluations * k // self.rounds
            before, ease = ease, self._ease(k, count) if task.hints else 0.0
            if ease != before:
                pool = pool if ease else np.concatenate([pool, start[None]])
                values, used, count = task.costs(pool, ease), used + len(pool), count - most - (not ease)
            drawn = varied(pool, chances(rng, count, pool), scale * self.spread, task.max_speeds, sights)
            pool, values = np.concatenate([pool, drawn]), np.concatenate([values, task.costs(drawn, ease)])
            used, scale = used + count, scale * self.shrink
        if ease:  # time is up: see what the best are really worth
            pool = np.concatenate([start[None], pool[np.argsort(values, kind="stable")[: self.last_elites]]])
            values, used = task.objective(pool), used + len(pool)
        best = int(np.argmin(values))
        return Found(pool[best], float(values[best]), used)

    def _ease(self, k: int, count: int) -> float:
        """By how much fields of view are wider in round k; not at all if elites would take most evaluations."""
        if count <= 2 * max(self.elites, self.last_elites) or k + 1 >= self.eased_rounds * self.rounds:
            return 0.0
        return self.ease * (1.0 - (k + 1) / (self.eased_rounds * self.rounds))


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

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        hints: Hints | None = None,
    ) -> Found:
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
        rim = np.column_stack([cos_each(angles), sin_each(angles)])
        shares = np.arange(1, self.speeds + 1) / self.speeds
        return np.concatenate([np.zeros((1, 2)), *(share * max_speed * rim for share in shares)])

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        hints: Hints | None = None,
    ) -> Found:
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
    speed = length(plans)[..., None]
    most = np.reshape(max_speeds, (-1, 1, 1))
    return np.asarray(plans * np.minimum(1.0, most / np.maximum(speed, 1e-12)))
