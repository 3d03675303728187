"""SMA-NBO with a cost-to-go of our own: nobody may stray far from the nearest camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from understory import (
    Array,
    Composed,
    CrossEntropy,
    Plan,
    Situation,
    aim_point,
    apply,
    length,
    make_objective,
    make_pursuits,
    mean_velocities,
    nominal_positions,
    response,
)


@dataclass(frozen=True)
class Shepherd:
    """Sequential NBO that lets nobody stray from the nearest camera."""

    horizon: int = 4  # steps of a plan
    far: float = 10.0  # m; the smaller, the more straying counts
    decentralised: ClassVar[bool] = True  # a claim that `understory check-planner` tests

    def __post_init__(self) -> None:
        if not (isinstance(self.horizon, int) and self.horizon >= 1 and self.far > 0):
            raise ValueError(f"horizon must be at least 1 and far above 0, are {self.horizon!r} and {self.far!r}")

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of the team, in its order."""
        return Herding(horizon=self.horizon, far=self.far).plan(team, rng)


@dataclass(frozen=True)
class Herding(Composed):
    """Belief propagation, the order in which UAVs decide and what they send are the testbed's; the decision is ours.

    To the objective over the horizon comes, for each track, the trace of its covariance now times the distance from
    where it will be at the end to the nearest UAV then, in units of `far`.
    """

    far: float = 10.0  # m

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """Plans (k, H, 2) m/s of the UAVs in rows `uavs` while the others fly `controls` (n, H, 2) m/s."""
        vehicles, rows, step = situation.vehicles, list(uavs), situation.step
        nominal = nominal_positions(situation, self.horizon)  # (H, T, 2) m
        traces = np.array([t.belief.covariance[0, 0] + t.belief.covariance[1, 1] for t in situation.tracks])
        seen_from = np.array([v.position[:2] + aim_point(v) for v in vehicles])
        belief, follows = self.propagator.predict(situation, self.horizon, rng), response(vehicles, step)

        def values(candidates: Array) -> Array:  # (N, k, H, 2) m/s -> (N,) m²
            joint = np.repeat(controls[None], len(candidates), axis=0)
            joint[:, rows] = candidates
            flown = mean_velocities(follows, joint)  # quadrotors take time to follow a command
            ends = seen_from + step * flown.sum(axis=2)  # (N, n, 2) m
            gaps = length(ends[:, :, None] - nominal[-1]).min(axis=1)  # (N, T) m
            over_horizon = make_objective(belief, flown[0], rows, 0.0)(flown[:, rows])
            return np.asarray(over_horizon + apply(gaps, traces) / self.far)

        intents = controls[rows][None]  # (1, k, H, 2)
        starts = [intents]
        for j, i in enumerate(rows):
            for chase in make_pursuits(nominal, vehicles[i], step):
                start = intents.copy()
                start[0, j] = chase
                starts.append(start)
        speeds = np.array([vehicles[i].max_speed for i in rows])
        return CrossEntropy(evaluations=1024).minimise(values, np.concatenate(starts), speeds, rng)
