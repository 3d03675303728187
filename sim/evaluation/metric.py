"""A metric: a number that says how good a mission was, with its unit and which way is better."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sim.evaluation.score import Score, score
from sim.recording.recording import Recording
from sim.sensing.fault import Fault

Better = Literal["lower", "higher", "neither"]
UNKNOWN = "–"  # stands where there is no number


@dataclass(frozen=True, eq=False)
class Outcome:
    """A mission that was flown: its recording, and facts of the flight that it does not hold."""

    recording: Recording
    seconds: Mapping[str, float] = field(default_factory=dict)  # wall time of each stage, and `start_up` if known
    wall_s: float = 0.0  # wall time of all
    faults: list[Fault] = field(default_factory=list)
    planning_s: Sequence[float] = ()  # wall time of each decision

    @cached_property
    def scores(self) -> list[Score]:
        """The score of each UAV."""
        return [score(self.recording, i) for i in range(self.recording.poses.shape[1])]

    @property
    def flown(self) -> list[Score]:
        """The scores of the UAVs that flew a scan at least."""
        return [score for score in self.scores if len(score.gospa)]


@dataclass(frozen=True)
class Metric:
    """A number for a mission, and how it is shown: `scale` turns its value into the unit."""

    label: str
    of: Callable[[Outcome], float | None] | None = None  # None where there was nothing to count
    unit: str = ""
    better: Better = "lower"
    scale: float = 1.0
    digits: int = 2
    least: float = 0.0  # that a value can be, not in the unit
    most: float = math.inf
    name: str = ""  # in rows; of a metric from outside, its import string
    key: str | None = None  # dotted, in summary.json, if it is not the name; empty: not there

    def __call__(self, outcome: Outcome) -> float | None:
        """The metric of a mission."""
        return self.of(outcome) if self.of else None

    @property
    def title(self) -> str:
        """Label with unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def text(self, value: float, *, signed: bool = False) -> str:
        """The value in the unit, without it; a dash where it is undefined. Signed zeros were rounded."""
        if math.isnan(value):
            return UNKNOWN
        shown = f"{value * self.scale:{'+' if signed and value else ''}.{self.digits}f}"
        return shown[1:] if float(shown) == 0 and shown[0] == "-" and not (signed and value) else shown

    def within(self, low: float, high: float, *, signed: bool = False) -> str:
        """An interval as text; empty where there is none."""
        if math.isnan(low) or math.isnan(high):
            return ""
        return f"[{self.text(low, signed=signed)}, {self.text(high, signed=signed)}]"


def mean(values: ArrayLike) -> float | None:
    """The mean, or None where there is nothing."""
    array = np.asarray(values, dtype=float)
    return float(array.mean()) if array.size else None
