"""Settings of a tracker, and the parameters that make one."""

from functools import cache, cached_property
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta, Struct

from tracking.filter.motion import MotionModel
from tracking.navigation import NAVIGATION, Navigation
from tracking.numerics.exponential import log, power
from tracking.settings import Density, Expected, Scans, Speed, Time, read_settings

EXPECTED = 0.9  # probability of being in plain view from which on a UAV should see the person
SEEN = 0.1  # probability that a measurement is the person's from which on the person counts as detected


class Tracking(Struct, frozen=True, forbid_unknown_fields=True):
    """Settings of the trackers: the table `[tracking]` of a scenario."""

    # m/s², standard deviation of the acceleration in the motion model, [Li22] eq. (1)
    sigma_a: Annotated[float, Meta(ge=1e-3, le=100)] = 0.75
    # `"known"`: UAVs have the tracks of all people at the start; `"none"`: people have to be found
    initial_tracks: Literal["known", "none"] = "known"
    # probability of detection of a person in plain view
    detection_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.99
    clutter_density: Density = 1e-6  # 1/m², expected false detections per scan and area
    # probability that a person's own measurement falls into the gate
    gate_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.9999
    confirm: tuple[Scans, Scans] = (2, 3)  # m and n: a new track needs m detections in n scans; n is at most 62
    # m and n: a track is deleted after m misses in n scans in which the person should have been seen; n is at most 62
    delete: tuple[Scans, Scans] = (5, 5)
    # exponent of the likelihood of negative information; 0 means that it is not used
    negative_information: Annotated[float, Meta(ge=0, le=100)] = 1.0
    # s, time without a detection after which a detection within the person's reach may re-acquire the track
    reacquire_after: Time = 0.2
    # m², trace of the position covariance above which a track is deleted; the default is the square of GOSPA's cut-off
    max_variance: Annotated[float, Meta(ge=1e-3, le=1e8)] = 100.0
    # m/s, largest speed of people, also of lost and undetected ones and of new tracks
    max_speed: Speed = 3.0
    # m/s, walking speed that `motion = "mean-reverting"` expects while few people have been seen
    walking_speed: Speed = 1.75
    # how tracks are initiated and deleted: `"existence"`: by each track's probability of existence, with
    # `confirmation_threshold` and `deletion_threshold`; `"m_of_n"`: by counting scans, as in the paper, with `confirm`
    # and `delete`
    management: Literal["m_of_n", "existence"] = "existence"
    # with `"existence"`: probability that a person is still in the area a second later
    survival: Annotated[float, Meta(gt=0, le=1)] = 0.999
    # 1/m², with `"existence"`: expected first detections of people per scan and area; its ratio to `clutter_density`
    # gives the existence probability of a new track
    birth_density: Density = 1e-5
    # with `"existence"`: probability of existence that confirms a new track
    confirmation_threshold: Annotated[float, Meta(gt=0, lt=1)] = 0.99
    # with `"existence"`: probability of existence below which a track is deleted
    deletion_threshold: Annotated[float, Meta(gt=0, lt=1)] = 0.001
    # motion model: `"mean-reverting"`: speeds return to the walking speed of the people seen; `"ncv"`: nearly constant
    # velocity, as in the paper
    motion: str = "mean-reverting"
    # `"jpda"`: Bernoulli tracks with joint probabilistic data association
    tracker: str = "jpda"
    # what trackers know of errors of `uavs.navigation`: `"ignore"`: nothing; `"inflate"`: they add to covariances of
    # measurements; `"estimate"`: UAVs estimate those that last from the people that they see, and tracks tell the rest
    pose_errors: Literal["ignore", "inflate", "estimate"] = "estimate"
    # expected number of undetected people at the start, for whom UAVs search if `initial_tracks` is `"none"`
    undetected: Expected = 4.0

    def __post_init__(self) -> None:
        for name, (m, n) in (("confirm", self.confirm), ("delete", self.delete)):
            if m > n:
                raise ValueError(f"{name} {m} of {n} can never happen")
        if self.deletion_threshold >= self.confirmation_threshold:
            allowed = f"below confirmation_threshold {self.confirmation_threshold:g}"
            raise ValueError(f"deletion_threshold {self.deletion_threshold:g} must be {allowed}")


_DEFAULTS = Tracking()


class AssociationSettings(NamedTuple):
    """Settings of data association, for compiled code."""

    gate_probability: float
    clutter_density: float  # 1/m²
    detection_probability: float
    at_once: int = 10_000  # pairs of tracks and measurements beyond which gating batches save time


class ScanSettings(NamedTuple):
    """Settings of predictions and track management in a scan, for compiled code."""

    detection_probability: float
    negative_information: float  # exponent
    by_existence: bool  # tracks are managed by their existence, not by counting scans
    deletion_threshold: float
    delete: tuple[int, int]  # misses, and scans among which they are counted
    max_variance: float  # m²


class LossRule(NamedTuple):
    """When a track is lost, and how far its person may have moved since, for compiled code."""

    after: float  # s without a sure detection after which a track is lost
    max_speed: float  # m/s, largest speed of people


class TrackerParameters:
    """What a tracker is given besides its camera and the map of trees.

    Attributes:
        motion: Motion model, over one scan; `settings.motion` is its name.
        settings: The settings of the trackers, as `parameters.settings.max_speed`.
        fusion: Name of the fusion rule, see `tracking.fusion.rule`.
        navigation: Errors of the UAV's pose.
    """

    def __init__(
        self,
        motion: MotionModel,
        settings: Tracking = _DEFAULTS,
        *,
        fusion: str = "hcmci",
        navigation: Navigation = NAVIGATION["exact"],
        **changed: Any,  # noqa: ANN401 - as many types as settings
    ) -> None:
        """Parameters with the settings, of which some may be changed by name: `TrackerParameters(m, survival=0.9)`.

        InputError if a changed setting is unknown or out of its bounds.
        """
        self.motion = motion
        self.settings = settings
        self.fusion = fusion
        self.navigation = navigation
        if changed:
            plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in changed.items()}
            self.settings = read_settings(msgspec.structs.asdict(settings) | plain, Tracking)

    @cached_property
    def association(self) -> AssociationSettings:
        """Settings of data association."""
        s = self.settings
        return AssociationSettings(s.gate_probability, s.clutter_density, s.detection_probability)

    @cached_property
    def scan(self) -> ScanSettings:
        """Settings of predictions and track management."""
        s = self.settings
        by_existence = s.management == "existence"
        return ScanSettings(
            s.detection_probability,
            s.negative_information,
            by_existence,
            s.deletion_threshold,
            s.delete,
            s.max_variance,
        )

    @cached_property
    def loss(self) -> LossRule:
        """The rule that decides which tracks are lost."""
        after = self.settings.reacquire_after - self.motion.dt / 2  # half a scan less, against rounding
        return LossRule(max(after, 0.0), self.settings.max_speed)

    @cached_property
    def measurement_gate(self) -> float:
        """Squared distance that a person's measurement stays below with `gate_probability` (two degrees of freedom)."""
        return -2.0 * log(1.0 - self.settings.gate_probability)

    @cached_property
    def match_gate(self) -> float:
        """Squared distance of two tracks (four degrees of freedom).

        Two tracks of one person are nearer than this with probability `gate_probability`.
        """
        return _find_match_gate(self.measurement_gate)

    @cached_property
    def step_survival(self) -> float:
        """Probability that a person in the area is still there one step of motion later."""
        settings = self.settings
        return power(settings.survival, self.motion.dt) if settings.management == "existence" else 1.0


@cache  # because each UAV has its own parameters
def _find_match_gate(gate: float) -> float:
    """The squared distance that is exceeded in four dimensions as often as `gate` is in two."""
    # P(distance > g) = (1 + g / 2) exp(-g / 2): a fixed point, which iterations approach by factors of 1 + g / 2.
    wider, before = gate, 0.0
    while abs(wider - before) > 1e-15 * wider:
        before, wider = wider, gate + 2.0 * log(1.0 + wider / 2.0)
    return wider
