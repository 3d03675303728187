"""Exhaustive search over sequences of a few controls."""

import itertools
import math
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from planning.objective.terms import Objective
from planning.planner import limit_speed
from planning.prediction.targets_in_reach import TargetsInReach
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import cos_each, sin_each


@dataclass(frozen=True)
class GridSearch:
    """Exhaustive search over the starts and all sequences of a few controls: ground truth for small cases.

    With a budget of evaluations or seconds, sequences are tried in the order of the controls until it is used up.
    """

    directions: int = 8
    most: int = 2_000_000  # most plans to try if `seconds` sets no limit
    evaluations: int = 0  # plans to try, besides the starts; 0: all
    seconds: float = 0.0  # time after which the search stops; 0: no limit

    def controls(self, max_speed: float) -> Array:
        """Controls (D, 2) m/s of which plans consist."""
        angles = 2 * math.pi * np.arange(self.directions) / self.directions
        rim = np.column_stack([cos_each(angles), sin_each(angles)])
        return np.concatenate([np.zeros((1, 2)), max_speed * rim])

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        in_reach: TargetsInReach | None = None,
    ) -> Array:
        """As `Optimizer.minimise`; ValueError if there are too many plans."""
        end = perf_counter() + self.seconds if self.seconds else math.inf
        _, k, H, _ = starts.shape
        sets = [self.controls(speed) for speed in max_speeds.tolist() for _ in range(H)]
        count = math.prod(len(s) for s in sets)
        tries = min(count, self.evaluations or count)
        if tries > self.most and not self.seconds:
            raise ValueError(f"optimizer grid: {count} plans of {k} UAVs over {H} steps, at most {self.most} are tried")
        starts = limit_speed(starts, max_speeds)
        values = objective(starts)
        found, cost = starts[np.argmin(values)], values.min()
        plans = itertools.islice(itertools.product(*sets), tries)
        while perf_counter() < end and (chunk := list(itertools.islice(plans, 8192))):
            candidates = np.array(chunk).reshape(-1, k, H, 2)
            values = objective(candidates)
            best = int(np.argmin(values))
            if values[best] < cost:
                found, cost = candidates[best], values[best]
        return np.asarray(found)
