"""Planners to compare with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planning.intent import base_control
from planning.planner import Plan, Situation


@dataclass(frozen=True)
class Hover:
    """Stays where it is."""

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Zero velocity for every UAV."""
        return [Plan(np.zeros((1, 2))) for _ in team]


@dataclass(frozen=True)
class Greedy:
    """The base policy alone: every UAV flies to the most uncertain track within 40 m, whatever the others do."""

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """One base-policy step for every UAV."""
        return [Plan(base_control(s.own, s.own.position[:2], s.tracks, 0.0, s.step)[None]) for s in team]
