"""Intents: the rest of the plans that UAVs fly."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planning.planner import Plan
from sim.mission.snapshot import Snapshot
from sim.scenario.scenario import Scenario
from tracking.numerics.arrays import Array

_SLACK = 1e-6  # s


class _Decision(NamedTuple):
    due: float  # s, time from which its plans are flown
    plans: Sequence[Plan]


class Intents:
    """The plans that are flown, updated by snapshots in order of time; a plan is flown once it is due."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._step = scenario.rates.plan_step
        self._coming: deque[_Decision] = deque()
        self._flown = _Decision(0.0, ())

    def follow(self, snapshot: Snapshot) -> None:
        """Process one snapshot."""
        if snapshot.plans is not None:
            self._coming.append(_Decision(self._scenario.plan_start(snapshot.time), snapshot.plans))
        while self._coming and self._coming[0].due <= snapshot.time + _SLACK:
            self._flown = self._coming.popleft()

    def paths(self, snapshot: Snapshot) -> dict[int, Array]:
        """Path (H + 1, 2) m of each working UAV, beginning at its position, at the last snapshot."""
        due, plans = self._flown
        paths = {}
        for i in snapshot.working if plans else []:
            controls = plans[i].controls
            ends = due + self._step * np.arange(1, len(controls) + 1)
            left = np.clip(ends - snapshot.time, 0.0, self._step)  # s, remaining time of each step
            moves = np.cumsum(controls * left[:, None], axis=0)
            paths[i] = np.asarray(snapshot.poses[i].position[:2] + np.vstack([np.zeros(2), moves]))
        return paths
