"""Cross-entropy search with surviving, distinct elites."""

import math
from dataclasses import dataclass
from time import perf_counter
from typing import Annotated, NamedTuple

import numpy as np

from planning.objective.terms import Objective
from planning.optimizers.mutations import choose_distinct, draw_chances, mutate_plans
from planning.options import Range, check_options
from planning.planner import limit_speed
from planning.prediction.targets_in_reach import NO_TARGETS, TargetsInReach
from tracking.numerics.arrays import Array


class _Problem(NamedTuple):
    """A minimisation problem."""

    objective: Objective
    starts: Array
    max_speeds: Array
    in_reach: TargetsInReach | None

    def costs(self, plans: Array, ease: float) -> Array:
        """Costs of plans (N, k, H, 2) m/s with fields of view that are wider by `ease` steps at maximum speed."""
        return self.objective(plans, ease * self.max_speeds) if ease else self.objective(plans)


@dataclass(frozen=True)
class CrossEntropy:
    """Cross-entropy search with surviving, distinct elites: never worse than the best plan that it is given.

    Each round changes the elites with noise that shrinks from round to round; elites compete with the new plans. Some
    noise is correlated in time, because zigzag rarely helps. Most noise moves one waypoint, or the path from there on,
    and keeps the rest of the plan as far as the UAV's speed allows. Other plans combine two elites, as in genetic
    algorithms: one elite may see a target early, and the other may see another target late. Elites with similar paths
    count as one, so that several basins of the objective survive; the single Gaussian of textbook CEM would average
    them. Source: [Pinneri20] for elites and coloured noise.

    The best plans often bring a target just inside the frame at the last possible step. Plans nearby miss the target,
    so random noise hardly finds the best ones. Therefore, if targets in reach are given, some changes bring a target
    just into view, and fields of view are wider in the first rounds: a continuation from a relaxed problem
    (E. L. Allgower, K. Georg, Numerical Continuation Methods, Springer, 1990).

    Attributes:
        evaluations: number of plans evaluated besides the starts.
        elites: number of elites in the first round, falling to `last_elites`.
        last_elites: number of elites in the last round.
        rounds: number of rounds.
        spread: initial size of the noise, in maximum speeds.
        shrink: factor of `spread` and `apart` from round to round.
        apart: initial root-mean-square distance of elites' paths, in steps at maximum speed.
        ease: initial widening of fields of view, in steps at maximum speed.
        eased_rounds: share of the rounds after which fields of view have their true size.
        seconds: time [s] for which searches are repeated and after which no round begins; 0: one search. Otherwise
            results vary.
    """

    evaluations: Annotated[int, Range(0, 10_000_000)] = 12_288
    elites: Annotated[int, Range(1, 1_000_000)] = 32
    last_elites: Annotated[int, Range(1, 1_000_000)] = 12
    rounds: Annotated[int, Range(1, 1_000_000)] = 18
    spread: float = 1.0
    shrink: float = 0.8
    apart: float = 0.6
    ease: Annotated[float, Range(0, 1e3)] = 0.3
    eased_rounds: Annotated[float, Range(0, 1)] = 0.5
    seconds: float = 0.0

    def __post_init__(self) -> None:
        check_options(self)

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        in_reach: TargetsInReach | None = None,
    ) -> Array:
        """As `Optimizer.minimise`."""
        end = perf_counter() + self.seconds if self.seconds else math.inf
        max_speeds = np.ascontiguousarray(np.broadcast_to(max_speeds, starts.shape[1]), dtype=float)
        found = self._search(_Problem(objective, starts, max_speeds, in_reach), rng, end)
        while self.seconds and perf_counter() < end:
            problem = _Problem(objective, np.concatenate([found[None], starts]), max_speeds, in_reach)
            found = self._search(problem, rng, end)
        return found

    def _search(self, problem: _Problem, rng: np.random.Generator, end: float) -> Array:
        """Search once from the starts, and begin no round after `end` [s].

        The number of random draws is independent of costs, so that later draws do not depend on beliefs.
        """
        in_reach = NO_TARGETS if problem.in_reach is None else problem.in_reach
        pool = limit_speed(problem.starts, problem.max_speeds)
        values = problem.objective(pool)
        start, ease, scale = pool[np.argmin(values)], 0.0, 1.0
        for k in range(self.rounds):
            if perf_counter() >= end:
                break
            most = self.elites + (self.last_elites - self.elites) * k // max(self.rounds - 1, 1)
            order = np.argsort(values, kind="stable")
            elite = choose_distinct(pool, order, most, scale * self.apart, problem.max_speeds)
            pool, values = pool[elite], values[elite]
            count = self.evaluations * (k + 1) // self.rounds - self.evaluations * k // self.rounds
            before, ease = ease, 0.0 if problem.in_reach is None else self._widen_views(k, count)
            if ease != before:
                pool = pool if ease else np.concatenate([pool, start[None]])
                values, count = problem.costs(pool, ease), count - most - (not ease)
            drawn = mutate_plans(
                pool, draw_chances(rng, count, pool), scale * self.spread, problem.max_speeds, in_reach
            )
            pool, values = np.concatenate([pool, drawn]), np.concatenate([values, problem.costs(drawn, ease)])
            scale *= self.shrink
        if ease:  # time ended before the fields of view had their true size: compare the best plans by true costs
            pool = np.concatenate([start[None], pool[np.argsort(values, kind="stable")[: self.last_elites]]])
            values = problem.objective(pool)
        return np.asarray(pool[np.argmin(values)])

    def _widen_views(self, k: int, count: int) -> float:
        """Widening of fields of view in round k; zero if evaluating the elites anew would take most evaluations."""
        if count <= 2 * max(self.elites, self.last_elites) or k + 1 >= self.eased_rounds * self.rounds:
            return 0.0
        return self.ease * (1.0 - (k + 1) / (self.eased_rounds * self.rounds))
