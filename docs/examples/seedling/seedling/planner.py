"""The planner: situations in, what the learned policy chooses out."""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from seedling.features import View, described
from seedling.policy import chosen, scores
from seedling.weights import LEARNED, Weights, load
from understory import Array, Plan, Situation, Track, beliefs_of, cos_each, sin_each, view_quadrangle

_NOWHERE = np.zeros((1, 1))
_ANGLES = 2 * math.pi * np.arange(16) / 16
_CIRCLE = np.column_stack([cos_each(_ANGLES), sin_each(_ANGLES)])
_RAYS = np.concatenate([np.zeros((1, 2)), _CIRCLE, 0.5 * _CIRCLE[::2]])  # in shares of the top speed

_learned = cache(load)


class Seedling:
    """Flies by a small network, the same for all UAVs, that learned to imitate a planner that searches."""

    decentralised: ClassVar[bool] = True

    def __init__(self, weights: str | Weights = "") -> None:
        """`weights`, or a file of them that `python -m seedling.train` made; without, the package's own."""
        self.weights = weights if isinstance(weights, Weights) else _learned(Path(weights) if weights else LEARNED)

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of two equal steps; a UAV knows those that it receives of UAVs that decided before it."""
        decided: dict[int, Plan] = {}
        for situation in team:
            moves, pairs, places = choices(situation, decided)
            reach = situation.step * situation.own.max_speed
            velocity = chosen(scores(self.weights, pairs, places), moves, reach) / situation.step
            decided[situation.own.id] = Plan(np.array([velocity, velocity]))
        return [decided[situation.own.id] for situation in team]


def choices(situation: Situation, decided: Mapping[int, Plan]) -> tuple[Array, Array, Array]:
    """Moves (K, 2) m of a UAV and their features, see `described`; decided: plans of UAVs before it, by id."""
    heard = {j: plan for j, plan in decided.items() if situation.receives(j)}
    return described(_view(situation, heard), _RAYS)


def _view(situation: Situation, heard: Mapping[int, Plan]) -> View:
    """Knowledge of a UAV as arrays."""
    vehicles, step, undetected = situation.vehicles, situation.step, situation.undetected
    positions = np.array([v.position for v in vehicles], dtype=float)
    nexts = positions.copy()
    for row, vehicle in zip(nexts, vehicles, strict=True):
        if vehicle.id in heard:
            row[:2] += step * heard[vehicle.id].controls[0]
        elif vehicle.id in situation.intents:
            row[:2] += step * situation.intents[vehicle.id].controls[1:2].sum(axis=0)
    last = situation.intents.get(situation.own.id, Plan(np.zeros((1, 2)))).controls[:1].sum(axis=0)
    means, covariances = beliefs_of(situation.tracks)
    P, Q = covariances[:, (0, 1), (0, 1)], covariances[:, (0, 1), (2, 3)]
    V = covariances[:, (2, 3), (2, 3)]
    spread = np.sqrt(np.maximum(P + 2 * step * Q + step * step * V, 0.0))
    return View(
        own=[v.id for v in vehicles].index(situation.own.id),
        views=np.array([view_quadrangle(v) for v in vehicles]),
        positions=positions,
        nexts=nexts,
        last=np.asarray(step * last),
        reach=float(step * situation.own.max_speed),
        step=float(step),
        tracks=np.ascontiguousarray(np.concatenate([means, spread], axis=1)),
        known=_known(situation.tracks, covariances, situation.time),
        cylinders=situation.forest.blockers,
        grid=situation.forest.grid,
        undetected=_NOWHERE if undetected is None else np.ascontiguousarray(undetected.people, dtype=float),
        low=(0.0, 0.0) if undetected is None else undetected.low,
        cell=(1.0, 1.0) if undetected is None else undetected.cell,
    )


def _known(tracks: Sequence[Track], covariances: Array, time: float) -> Array:
    """Trace, time since the last sighting and existence of each track (T, 3)."""
    traces = covariances[:, 0, 0] + covariances[:, 1, 1]
    ages = [0.0 if math.isnan(t.sighting[2]) else max(0.0, time - float(t.sighting[2])) for t in tracks]
    rows = [(P, age, t.existence) for t, P, age in zip(tracks, traces, ages, strict=True)]
    return np.array(rows, dtype=float).reshape(-1, 3)
