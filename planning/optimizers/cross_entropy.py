"""Cross-entropy search whose elites survive and keep apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

import numpy as np

from planning.objective.objective import Objective
from planning.optimizers.mutations import chances, distinct, varied
from planning.optimizers.optimizer import Found, limited
from planning.prediction.targets_in_reach import NOTHING, Hints
from tracking.numerics.compiled import Array


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
