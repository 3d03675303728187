"""The planner: situations in, what the learned policy chooses out."""

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from planning.planner import Plan, Situation
from planning.prediction.field_of_view import view_quadrangle
from seedling.policy import View, choose
from seedling.weights import LEARNED, Weights, load
from tracking.numerics.arrays import Array
from tracking.numerics.universal import cos_each, sin_each
from tracking.track import Track, beliefs_of

_NOWHERE = np.zeros((1, 1))
_ANGLES = 2 * math.pi * np.arange(12) / 12
_CIRCLE = np.column_stack([cos_each(_ANGLES), sin_each(_ANGLES)])
_RAYS = np.concatenate([np.zeros((1, 2)), _CIRCLE, 0.65 * _CIRCLE, 0.3 * _CIRCLE])  # in shares of the top speed

_learned = cache(load)


class Seedling:
    """Flies by a small network, the same for all UAVs, that was trained in missions; remembers whom it watched."""

    decentralised: ClassVar[bool] = True
    stateful: ClassVar[bool] = True

    def __init__(self, weights: str = "") -> None:
        """`weights`: a file that `python -m seedling.train` made; without, the package's own."""
        self.weights: Weights = _learned(Path(weights) if weights else LEARNED)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Forget whom each UAV watched; the policy has no chance of its own."""
        self._attention: dict[int, dict[int, float]] = {}  # by UAV and track

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of two equal steps; a UAV knows those that it receives of UAVs that decided before it."""
        decided: dict[int, Plan] = {}
        for situation in team:
            heard = {j: plan for j, plan in decided.items() if situation.receives(j)}
            decided[situation.own.id] = self._decide(situation, heard)
        return [decided[situation.own.id] for situation in team]

    def _decide(self, situation: Situation, heard: dict[int, Plan]) -> Plan:
        own = situation.own
        tracks, last = situation.tracks, self._attention.get(own.id, {})
        chosen, attention = choose(self.weights, _view(situation, heard, last), _RAYS)
        self._attention[own.id] = {track.id: a for track, a in zip(tracks, attention.tolist(), strict=True)}
        velocity = chosen / situation.step
        return Plan(np.array([velocity, velocity]))


def _view(situation: Situation, heard: dict[int, Plan], last: dict[int, float]) -> View:
    """Knowledge of a UAV as arrays."""
    vehicles, step, unseen = situation.vehicles, situation.step, situation.unseen
    positions = np.array([v.position for v in vehicles], dtype=float)
    nexts = positions.copy()
    for row, vehicle in zip(nexts, vehicles, strict=True):
        if vehicle.id in heard:
            row[:2] += step * heard[vehicle.id].controls[0]
        elif vehicle.id in situation.intents:
            row[:2] += step * situation.intents[vehicle.id].controls[1:2].sum(axis=0)
    means, covariances = beliefs_of(situation.tracks)
    P, Q = covariances[:, (0, 1), (0, 1)], covariances[:, (0, 1), (2, 3)]
    V = covariances[:, (2, 3), (2, 3)]
    spread = np.sqrt(np.maximum(P + 2 * step * Q + step * step * V, 0.0))
    return View(
        own=[v.id for v in vehicles].index(situation.own.id),
        views=np.array([view_quadrangle(v) for v in vehicles]),
        positions=positions,
        nexts=nexts,
        reach=float(step * situation.own.max_speed),
        step=float(step),
        tracks=np.ascontiguousarray(np.concatenate([means, spread], axis=1)),
        known=_known(situation.tracks, covariances, situation.time, last),
        cylinders=situation.forest.blockers,
        grid=situation.forest.grid,
        unseen=_NOWHERE if unseen is None else np.ascontiguousarray(unseen.people, dtype=float),
        low=(0.0, 0.0) if unseen is None else unseen.low,
        cell=(1.0, 1.0) if unseen is None else unseen.cell,
    )


def _known(tracks: Sequence[Track], covariances: Array, time: float, last: dict[int, float]) -> Array:
    """Trace, time since the last sighting, existence and last attention of each track (T, 4)."""
    traces = covariances[:, 0, 0] + covariances[:, 1, 1]
    ages = [0.0 if math.isnan(t.sighting[2]) else max(0.0, time - float(t.sighting[2])) for t in tracks]
    rows = [(P, age, t.existence, last.get(t.id, 0.0)) for t, P, age in zip(tracks, traces, ages, strict=True)]
    return np.array(rows, dtype=float).reshape(-1, 4)
