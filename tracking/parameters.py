"""Parameters of a tracker."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tracking.filter.motion import MotionModel
from tracking.numerics.exponential import log, power

MANAGEMENT = ("m_of_n", "existence")
MOST_SCANS = 62  # most scans for which the bits of an integer can hold misses
EXPECTED = 0.9  # probability of being in plain view from which on a UAV should see the person
SEEN = 0.1  # probability that a measurement is the person's from which on the person counts as detected
# Allowed values in words, a test of a value, which NaN fails, and the parameters to test.
_RANGES: tuple[tuple[str, Callable[[float], bool], tuple[str, ...]], ...] = (
    ("in (0, 1)", lambda x: 0.0 < x < 1.0, ("detection_probability", "gate_probability")),
    ("in (0, 1]", lambda x: 0.0 < x <= 1.0, ("survival",)),
    ("positive", lambda x: x > 0.0, ("clutter_density", "birth_density", "max_variance", "max_speed", "forget_after")),
    ("finite", lambda x: x < math.inf, ("clutter_density", "birth_density", "max_speed")),
    ("0 or more and finite", lambda x: 0.0 <= x < math.inf, ("negative_information",)),
    ("0 or more", lambda x: x >= 0.0, ("reacquire_after",)),
)


@dataclass(frozen=True)
class TrackerParameters:
    """A tracker's models of people and sensors, and its rules of track management."""

    motion: MotionModel  # over one scan
    detection_probability: float = 0.99  # of a person in plain view
    clutter_density: float = 1e-6  # false alarms per m²
    gate_probability: float = 0.9999
    confirm: tuple[int, int] = (2, 3)  # m of n scans
    delete: tuple[int, int] = (5, 5)  # m of n scans in which the person should have been seen
    # exponent of the likelihood of no detection in beliefs, not in association; 0: no negative information
    negative_information: float = 1.0
    reacquire_after: float = 0.2  # s without a sure detection, after which a new track may take the id; inf: never
    max_variance: float = 100.0  # m², trace of the position's covariance beyond which a track is deleted
    max_speed: float = 3.0  # of people, m/s
    management: str = "existence"  # by probabilities of "existence", or "m_of_n" by `confirm` and `delete`
    survival: float = 0.999  # probability that a person in the area is still there a second later
    birth_density: float = 1e-5  # of people detected for the first time, 1/m² and scan
    confirmation_threshold: float = 0.99  # probability of existence that confirms a track
    deletion_threshold: float = 0.001  # probability below which a track is deleted; no effect below 1e-9
    fusion: str = "hcmci"  # rule of fusion, see `tracking.fusion.rule`
    forget_after: float = 30.0  # s for which the fleet remembers that it deleted a track

    def __post_init__(self) -> None:
        for allowed, holds, names in _RANGES:
            for name in names:
                if not holds(value := getattr(self, name)):
                    raise ValueError(f"{name} must be {allowed}, is {value}")
        for name in ("confirm", "delete"):
            m, n = getattr(self, name)
            whole = isinstance(m, int | np.integer) and isinstance(n, int | np.integer)
            if not (whole and 1 <= m <= n <= MOST_SCANS):
                raise ValueError(f"{name} must be integers (m, n) with 1 <= m <= n <= {MOST_SCANS}, is ({m}, {n})")
        if self.management not in MANAGEMENT:
            raise ValueError(f"management must be {' or '.join(MANAGEMENT)}, is {self.management!r}")
        if not 0.0 < self.deletion_threshold < self.confirmation_threshold < 1.0:
            allowed = "0 < deletion_threshold < confirmation_threshold < 1 must hold"
            raise ValueError(f"{allowed}, they are {self.deletion_threshold} and {self.confirmation_threshold}")

    @cached_property
    def association(self) -> tuple[float, float, float]:
        """Probability of a gate, density of clutter [1/m²] and probability of detection, for compiled code."""
        return self.gate_probability, self.clutter_density, self.detection_probability

    @cached_property
    def loss(self) -> tuple[float, float]:
        """Time [s] without a sure detection after which a track is lost, and people's largest speed [m/s]."""
        return max(self.reacquire_after - self.motion.dt / 2, 0.0), self.max_speed  # half a scan less, against rounding

    @cached_property
    def measurement_gate(self) -> float:
        """Squared distance within which a person's measurement is with `gate_probability` (two degrees of freedom)."""
        return -2.0 * log(1.0 - self.gate_probability)

    @cached_property
    def match_gate(self) -> float:
        """Squared distance within which two tracks of one person are with `gate_probability` (four degrees)."""
        # P(distance > g) = (1 + g / 2) exp(-g / 2): a fixed point, which iterations approach by factors of 1 + g / 2.
        gate, before = self.measurement_gate, 0.0
        while abs(gate - before) > 1e-15 * gate:
            before, gate = gate, self.measurement_gate + 2.0 * log(1.0 + gate / 2.0)
        return gate

    @cached_property
    def step_survival(self) -> float:
        """Probability that a person in the area is still there one step of motion later."""
        return power(self.survival, self.motion.dt) if self.management == "existence" else 1.0
