"""Baseline planners: hover, random, greedy and lawnmower."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from planning.options import Range, check_options
from planning.planner import Exchange, Plan, Situation, limit_speed
from planning.prediction.field_of_view import aim_point, view_quadrangle
from planning.prediction.intent import base_control
from planning.prediction.quadrangle import radius_in_view
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.trigonometry import cos_each, sin_each


@dataclass(frozen=True)
class Hover:
    """Stays where it is."""

    exchange = Exchange(0)
    decentralised: ClassVar[bool] = True

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Zero velocity for every UAV."""
        return [Plan(np.zeros((1, 2))) for _ in team]


@dataclass(frozen=True)
class Random:
    """Flies at velocities drawn evenly from those that the UAV can fly: a floor for planners that look ahead."""

    exchange = Exchange(0)
    decentralised: ClassVar[bool] = True

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """One step at a velocity drawn from the disc of the UAV's top speed."""
        angles, radii = 2 * math.pi * rng.random(len(team)), np.sqrt(rng.random(len(team)))
        rims = radii[:, None] * np.column_stack([cos_each(angles), sin_each(angles)])
        return [Plan(s.own.max_speed * rim[None]) for s, rim in zip(team, rims, strict=True)]


@dataclass(frozen=True)
class Greedy:
    """The base policy alone: every UAV flies to the most uncertain track within 40 m, without coordination."""

    exchange = Exchange(0)
    decentralised: ClassVar[bool] = True

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """One base-policy step for every UAV."""
        return [Plan(base_control(s)[None]) for s in team]


@dataclass(frozen=True)
class Lawnmower:
    """Coverage without feedback: every UAV sweeps a strip of the area to and fro, on lines at most a footprint apart.

    A goal moves along the lines at the fraction `pace` of the UAV's top speed, and the UAV follows it.
    """

    pace: Annotated[float, Range(0, 1, above=True)] = 0.9
    exchange = Exchange(0)

    def __post_init__(self) -> None:
        check_options(self)

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """One step along each UAV's lines."""
        return [self._step(s, k, len(team)) for k, s in enumerate(team)]

    def _step(self, situation: Situation, strip: int, strips: int) -> Plan:
        own = situation.own
        corners = _lay_lines(situation, strip, strips)
        lengths = length(np.diff(corners, axis=0))
        run = self.pace * own.max_speed * (situation.time + situation.step)
        reached = np.concatenate([[0.0], np.cumsum(lengths)])
        way = float(reached[-1])
        run = way - abs(run % (2 * way) - way) if way else 0.0  # to and fro
        goal = np.array([np.interp(run, reached, corners[:, axis]) for axis in (0, 1)])
        gap = goal - aim_point(own) - own.position[:2]
        return Plan(limit_speed((gap / situation.step)[None], own.max_speed))


def _lay_lines(situation: Situation, strip: int, strips: int) -> Array:
    """Corners (K, 2) m of the lines that the aim point follows over one strip of the area's height."""
    width, height = situation.area
    half = radius_in_view(view_quadrangle(situation.own))
    low = -height / 2 + height / strips * strip
    count = max(1, int(np.ceil(height / strips / (2 * half))))
    rows = low + height / strips * (np.arange(count) + 0.5) / count
    ends = np.array([-1.0, 1.0]) * max(width / 2 - half, 0.0)
    return np.array([(x, y) for k, y in enumerate(rows) for x in (ends if k % 2 == 0 else ends[::-1])])
