"""What a tracker assumes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tracking.filter.kalman import NearlyConstantVelocity
from tracking.numerics.compiled import Array
from tracking.numerics.elementary import log, power

LIVES = ("m_of_n", "existence")
FUSIONS = ("kla", "hcmci")
MOST_SCANS = 62  # that fit into the bits of the integer in which the evidence on a track is counted


@dataclass(frozen=True)
class TrackerParameters:
    """What trackers assume of people, sensors and evidence."""

    motion: NearlyConstantVelocity  # over one scan
    detection_probability: float = 0.99  # of a person in plain view
    clutter_density: float = 1e-6  # false alarms per m²
    gate_probability: float = 0.9999
    confirm: tuple[int, int] = (2, 3)  # m of n scans
    delete: tuple[int, int] = (5, 5)  # m of n scans in which the person should have been seen
    expected: float = 0.9  # probability of being in plain view from which on a UAV should see the person
    seen: float = 0.1  # probability that a measurement is the person's from which on the person counts as seen
    double: int = 15  # scans of only shared measurements after which a track that equals another one ends
    absence_weight: float = 1.0  # exponent of the likelihood of seeing nobody; 0: an empty place is no evidence
    recovery_after: float = 1.0  # s unseen, after which somebody who turns up may be this person; inf: never
    max_variance: float = 400.0  # m², trace of the position's covariance beyond which a track says nothing and ends
    max_speed: float = 3.0  # of people, m/s
    life: str = "m_of_n"  # what begins and ends tracks: `confirm` and `delete`, or their probability of "existence"
    survival: float = 0.999  # probability that somebody who is there still is a second later
    birth_density: float = 1e-5  # of people who are detected for the first time, 1/m² and scan
    sure: float = 0.99  # probability of existence that confirms a track
    doubt: float = 0.001  # probability of existence below which a track ends
    fusion: str = "kla"  # of UAVs' beliefs: "kla", their average, or "hcmci", which adds up what each has learned
    forget_after: float = 30.0  # s for which the fleet remembers that it gave up a track

    def __post_init__(self) -> None:
        for name in ("detection_probability", "gate_probability", "expected", "seen"):
            if not 0.0 < (value := getattr(self, name)) < 1.0:
                raise ValueError(f"{name} must be in (0, 1), is {value}")
        for name in ("clutter_density", "birth_density", "max_variance", "max_speed"):
            if not (value := getattr(self, name)) > 0.0:
                raise ValueError(f"{name} must be positive, is {value}")
        self._check_evidence()
        self._check_counts()
        self._check_existence()

    def _check_evidence(self) -> None:
        """ValueError if evidence cannot be weighed or beliefs cannot be fused."""
        for name in ("clutter_density", "birth_density"):
            if getattr(self, name) == math.inf:
                raise ValueError(f"{name} must be finite, is inf")
        if not 0.0 <= self.absence_weight < math.inf:
            raise ValueError(f"absence_weight must be 0 or more and finite, is {self.absence_weight}")
        if not self.recovery_after >= 0.0:
            raise ValueError(f"recovery_after must be 0 or more, is {self.recovery_after}")
        if self.fusion not in FUSIONS:
            raise ValueError(f"fusion must be one of {', '.join(FUSIONS)}, is {self.fusion!r}")
        if not self.forget_after > 0.0:
            raise ValueError(f"forget_after must be positive, is {self.forget_after}")

    def _check_counts(self) -> None:
        """ValueError if scans cannot be counted."""
        if not (isinstance(self.double, int | np.integer) and self.double >= 1):
            raise ValueError(f"double must be an integer, 1 or more, is {self.double}")
        for name in ("confirm", "delete"):
            m, n = getattr(self, name)
            whole = isinstance(m, int | np.integer) and isinstance(n, int | np.integer)
            if not (whole and 1 <= m <= n <= MOST_SCANS):
                raise ValueError(f"{name} must be integers (m, n) with 1 <= m <= n <= {MOST_SCANS}, is ({m}, {n})")

    def _check_existence(self) -> None:
        """ValueError if tracks cannot begin or end."""
        if self.life not in LIVES:
            raise ValueError(f"life must be {' or '.join(LIVES)}, is {self.life!r}")
        if not 0.0 < self.survival <= 1.0:
            raise ValueError(f"survival must be in (0, 1], is {self.survival}")
        if not 0.0 < self.doubt < self.sure < 1.0:
            raise ValueError(f"doubt and sure must be 0 < doubt < sure < 1, are {self.doubt} and {self.sure}")

    @cached_property
    def measurement_gate(self) -> float:
        """Squared distance of a measurement that `gate_probability` keeps (two degrees of freedom)."""
        return -2.0 * log(1.0 - self.gate_probability)

    @cached_property
    def match_gate(self) -> float:
        """Squared distance between two tracks of one person that `gate_probability` keeps (four)."""
        # P(distance > g) = (1 + g / 2) exp(-g / 2): a fixed point, which iterations near by factors of 1 + g / 2.
        gate, before = self.measurement_gate, 0.0
        while abs(gate - before) > 1e-15 * gate:
            before, gate = gate, self.measurement_gate + 2.0 * log(1.0 + gate / 2.0)
        return gate

    @cached_property
    def step_survival(self) -> float:
        """Probability that somebody who is there still is one step of motion later."""
        return power(self.survival, self.motion.dt) if self.life == "existence" else 1.0

    def detection(self, shown: Array, count: int) -> Array:
        """Probabilities of detection (T, count + 1), as `jpda.association_probabilities` takes them.

        shown (T,): of each track's person to be in plain view, where the last frame has shown nobody less
        (`tracking.filter.negative_information`). Where a measurement was made the view is free: only the chance of a
        miss depends on the whole belief. So whoever steps out from behind a tree earlier than foreseen is taken up at
        once.
        """
        detection = np.full((len(shown), count + 1), self.detection_probability * self.gate_probability)
        detection[:, 0] *= shown
        return detection
