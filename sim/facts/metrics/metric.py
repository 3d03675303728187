"""The type of metrics: a number for a mission that was flown, and its display."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sim.facts.metrics.fleet_facts import find_error_sources
from sim.facts.metrics.score import Score, score
from sim.facts.metrics.unmatched import Unmatched, find_unmatched_tracks
from sim.mission.fault import Fault
from sim.mission.recording import Recording
from tracking.numerics.arrays import Array

Better = Literal["lower", "higher", "neither"]
UNKNOWN = "–"  # shown in place of a missing number


@dataclass(frozen=True, eq=False)
class Outcome:
    """A mission that was flown: its recording, and facts of the flight that the recording does not contain.

    Attributes:
        recording: the recording.
        seconds: wall time [s] of each stage, and `start_up`; a summary also has `page` and `other`, and they add up.
        wall_s: total wall time [s].
        faults: faults of the mission, breakdowns included.
        planning_s: wall time [s] of each decision.
        planning_cpu_s: processor time [s] of all decisions.
    """

    recording: Recording
    seconds: Mapping[str, float] = field(default_factory=dict)
    wall_s: float = 0.0
    faults: list[Fault] = field(default_factory=list)
    planning_s: Sequence[float] = ()
    planning_cpu_s: float = 0.0

    @cached_property
    def scores(self) -> list[Score]:
        """The score of each UAV; none if people are unknown."""
        uavs = self.recording.uav_count if self.recording.labelled else 0
        return [score(self.recording, i) for i in range(uavs)]

    @cached_property
    def error_sources(self) -> Array:
        """Parts of squared GOSPA, as `find_error_sources` returns them."""
        return find_error_sources(self.recording, self.scores)

    @cached_property
    def unmatched(self) -> list[Unmatched]:
        """Tracks that stand for no person."""
        return list(find_unmatched_tracks(self.recording))

    @property
    def flown(self) -> list[Score]:
        """The scores of the UAVs that worked for at least one scan."""
        return [score for score in self.scores if len(score.gospa)]


Computation = Callable[[Outcome], float | None]


@dataclass(frozen=True)
class Metric:
    """A number for a mission and its display; `scale` converts the value into the unit.

    Attributes:
        label: name in tables.
        compute: computes the value; returns None if there is nothing to count.
        unit: unit of the shown value.
        better: whether "lower" or "higher" values are better, or neither.
        scale: factor from the value to the shown one.
        digits: decimal places of the shown value.
        least: bounds of the value before scaling, at which intervals are cut off.
        most: upper bound, as `least`.
        meaning: what is counted, in the reference.
        printed: place in the table that `run` prints, with a section for each ten; 0 if it is not there.
        compared: `compare` shows it unless asked for others.
        name: column in studies and dotted key in summary.json; the import string of a plug-in metric.
        judges: compares with the people; False if it has a value also where they are unknown.
        in_summary: False if another entry of summary.json tells it, such as the list of faults.
    """

    label: str
    compute: Computation | None = None
    unit: str = ""
    better: Better = "lower"
    scale: float = 1.0
    digits: int = 2
    least: float = -math.inf
    most: float = math.inf
    meaning: str = ""
    printed: int = 0
    compared: bool = False
    name: str = ""
    judges: bool = True
    in_summary: bool = True

    def __call__(self, outcome: Outcome) -> float | None:
        """The value of a mission; None if there is nothing to count, or to compare with."""
        known = outcome.recording.labelled or not self.judges
        return self.compute(outcome) if self.compute and known else None

    @property
    def title(self) -> str:
        """Label with unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def text(self, value: float, *, signed: bool = False) -> str:
        """A value in the metric's unit, without the unit's name; a dash for NaN.

        A signed difference that rounds to zero keeps its sign.
        """
        if math.isnan(value):
            return UNKNOWN
        shown = f"{value * self.scale:{'+' if signed and value else ''}.{self.digits}f}"
        return shown[1:] if float(shown) == 0 and shown[0] == "-" and not (signed and value) else shown

    def with_unit(self, value: float | None) -> str:
        """A value with its unit; a dash if there is none."""
        return UNKNOWN if value is None or math.isnan(value) else f"{self.text(value)} {self.unit}".rstrip()


def mean(values: ArrayLike) -> float | None:
    """The mean of all values; None if there are none."""
    array = np.asarray(values, dtype=float)
    return float(array.mean()) if array.size else None
