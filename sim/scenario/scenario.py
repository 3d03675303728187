"""Scenarios: the one tree of settings, read strictly from TOML and validated once."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct, field

from sim.scenario.bounds import (
    Count,
    Density,
    Expected,
    Length,
    Paths,
    Point,
    Probability,
    Scans,
    Side,
    Speed,
    Time,
    Variance,
    Weight,
)
from sim.scenario.fleet import DEFAULT_FLEET, Uav
from sim.scenario.network import DAY, Network
from sim.scenario.workload import check_workload

# Bounds are far beyond any mission, and short of what overflows or ends no more.
_MOST_SCANS = 62  # as of the tracker, whose module is not imported: it takes a second
_CLEARANCE = 1.0  # m, between UAVs at the start: rotors reach 0.3 m out
_STRONGEST_WIND = 12.0  # m/s, against which a quadrotor still flies at 5 m/s
_HIGHEST = 10_000.0  # m above ground


class Area(Struct, frozen=True, forbid_unknown_fields=True):
    """The rectangle of the mission, centred on the origin."""

    width: Side = 150.0  # m, east-west
    height: Side = 100.0  # m, north-south


class Trees(Struct, frozen=True, forbid_unknown_fields=True):
    """A Poisson forest ([Li22] IV-A)."""

    density: Expected = 45.0  # expected number of trees in the area, the paper's lambda
    canopy_radius: Length = 5.0  # m, the paper's R
    canopy_base: Length = 3.0  # m above ground
    canopy_top: Length = 6.0  # m above ground
    trunk_radius: Length = 0.2  # m

    def __post_init__(self) -> None:
        if self.canopy_base >= self.canopy_top:
            raise ValueError(f"canopy_base {self.canopy_base:g} must be below canopy_top {self.canopy_top:g}")
        if self.trunk_radius > self.canopy_radius:
            raise ValueError(f"trunk_radius {self.trunk_radius:g} must not exceed canopy_radius {self.canopy_radius:g}")


# Waypoints [m] of the default four: they come in from the west, cross near the centre, bend, and part.
DEFAULT_PATHS: Paths = (
    ((-30.0, -18.0), (-8.0, -4.0), (10.0, 9.0), (38.0, 12.0), (65.0, 14.0)),
    ((-30.0, -6.0), (-8.0, -9.0), (12.0, -6.0), (36.0, 2.0), (65.0, 4.0)),
    ((-30.0, 6.0), (-10.0, 6.0), (10.0, -2.0), (32.0, -12.0), (60.0, -20.0)),
    ((-28.0, 18.0), (-6.0, 13.0), (14.0, 10.0), (30.0, 20.0), (55.0, 28.0)),
)


class People(Struct, frozen=True, forbid_unknown_fields=True):
    """Walking people: Levy walkers along waypoints (or wandering), or recorded trajectories."""

    count: Count = 4
    paths: Paths = DEFAULT_PATHS  # waypoints of the first people; others wander
    min_speed: Speed = 1.0  # m/s
    max_speed: Speed = 3.0  # m/s
    levy_exponent: Annotated[float, Meta(gt=1, le=3)] = 2.0  # density of step lengths ~ length^-exponent
    trajectories: str = ""  # CSV file `t,id,x,y` that replaces the walkers

    def __post_init__(self) -> None:
        if self.min_speed >= self.max_speed:
            raise ValueError(f"min_speed {self.min_speed:g} must be below max_speed {self.max_speed:g}")


class Rates(Struct, frozen=True, forbid_unknown_fields=True):
    """How often things happen [Hz]; each divides the one before."""

    physics: Annotated[int, Meta(ge=1, le=10_000)] = 240
    sensing: Annotated[int, Meta(ge=1, le=1000)] = 5
    planning: Annotated[int, Meta(ge=1, le=1000)] = 1

    def __post_init__(self) -> None:
        if self.physics % self.sensing:
            raise ValueError(f"physics {self.physics} Hz is no multiple of sensing {self.sensing} Hz")
        if self.sensing % self.planning:
            raise ValueError(f"sensing {self.sensing} Hz is no multiple of planning {self.planning} Hz")


class Sensing(Struct, frozen=True, forbid_unknown_fields=True):
    """From world to measurements."""

    mode: Literal["camera", "ideal"] = "camera"
    noise: Literal["range_bearing", "camera"] = "range_bearing"
    # What tracker and planner assume, and what hides in ideal sensing.
    occlusion: Literal["line_of_sight", "disc"] = "line_of_sight"
    renderer: Literal["tiny", "egl"] = "tiny"  # PyBullet's own on the CPU, or OpenGL without a display
    detector: str = "blob"  # "blob", "segmentation" or "package.module:Class"
    false_alarms: Annotated[float, Meta(ge=0, le=1000)] = 0.0  # expected number per frame, Poisson
    miss_probability: Probability = 0.0  # that somebody who would be detected is not
    field_of_view: Literal["camera", "unlimited"] = "camera"  # what limits it, trees aside; only in ideal sensing

    def __post_init__(self) -> None:
        if self.field_of_view == "unlimited":
            if self.mode == "camera":
                raise ValueError('field_of_view "unlimited" has no image; allowed with mode "ideal"')
            if self.false_alarms:
                raise ValueError('false_alarms are spread over an image; allowed with field_of_view "camera"')


class Tracking(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the trackers."""

    sigma_a: Annotated[float, Meta(ge=1e-3, le=100)] = 0.5  # m/s², of the NCV model
    initial_tracks: Literal["known", "none"] = "known"
    detection_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.99  # of a person in plain view
    clutter_density: Density = 1e-6  # false alarms per m²
    gate_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.9999
    confirm: tuple[Scans, Scans] = (2, 3)  # m of n scans
    delete: tuple[Scans, Scans] = (5, 5)  # m of n scans in which the person should have been seen
    absence_weight: Weight = 1.0  # exponent of the likelihood of seeing nobody; 0: an empty place is no evidence
    recovery_after: Time = 1.0  # s unseen, after which somebody who turns up may be this person
    max_variance: Variance = 400.0  # m², trace of the position's covariance beyond which a track ends
    max_speed: Speed = 3.0  # m/s, of people
    life: Literal["m_of_n", "existence"] = "m_of_n"  # what begins and ends tracks
    survival: Annotated[float, Meta(gt=0, le=1)] = 0.999  # probability of a person to be there still after a second
    birth_density: Density = 1e-5  # people detected for the first time per m² and scan
    sure: Annotated[float, Meta(gt=0, lt=1)] = 0.99  # probability of existence that confirms a track
    doubt: Annotated[float, Meta(gt=0, lt=1)] = 0.001  # probability of existence below which a track ends
    motion: Literal["ncv", "bounded"] = "ncv"  # of people, to trackers
    unseen: Expected = 4.0  # people expected, anywhere in the area, where initial_tracks is "none"

    def __post_init__(self) -> None:
        for name, (m, n) in (("confirm", self.confirm), ("delete", self.delete)):
            if m > n:
                raise ValueError(f"{name} {m} of {n} can never happen")
            if n > _MOST_SCANS:
                raise ValueError(f"{name} {m} of {n} counts too many scans; at most {_MOST_SCANS} are allowed")
        if self.doubt >= self.sure:
            raise ValueError(f"doubt {self.doubt:g} must be below sure {self.sure:g}")


class Appearance(Struct, frozen=True, forbid_unknown_fields=True):
    """How strongly chance varies what cameras show; what is left open is off, or full with `randomise`."""

    randomise: bool = False
    light_deg: Annotated[float, Meta(ge=0, le=75)] | None = None  # the sun's largest angle from the zenith
    ambient: Annotated[float, Meta(ge=0, le=0.5)] | None = None  # of diffuse light, from the mean
    ground_tint: Annotated[float, Meta(ge=0, le=0.2)] | None = None  # of each of red, green and blue, relative
    ground_moved: bool | None = None  # whether the ground's texture is shifted and turned
    canopy_tint: Annotated[float, Meta(ge=0, le=0.2)] | None = None  # of the forest's colour and each tree's shade
    clothing_hue_deg: Annotated[float, Meta(ge=0, le=6)] | None = None  # to either side of the mean hue
    clothing_shade: Annotated[float, Meta(ge=0, le=0.5)] | None = None  # by how much darker some are
    exposure: Annotated[float, Meta(ge=0, le=1)] | None = None  # gain from 1 / (1 + x) to 1 + x
    blur: Annotated[float, Meta(ge=0, le=5)] | None = None  # pixels, standard deviation
    noise: Annotated[float, Meta(ge=0, le=100)] | None = None  # grey levels, standard deviation


class Wind(Struct, frozen=True, forbid_unknown_fields=True):
    """Air that moves quadrotors: a mean and first-order Gauss-Markov gusts, the same for the whole fleet."""

    velocity: Point = (0.0, 0.0)  # m/s, the mean, to the east and to the north
    gust: Annotated[float, Meta(ge=0, le=5)] = 0.0  # m/s, standard deviation of each component
    gust_time: Annotated[float, Meta(ge=0.01, le=DAY)] = 5.0  # s, correlation time

    def __post_init__(self) -> None:
        east, north = self.velocity
        if (speed := math.sqrt(east * east + north * north)) > _STRONGEST_WIND:
            allowed = f"at most {_STRONGEST_WIND:g} m/s is allowed"
            raise ValueError(f"velocity {list(self.velocity)} is a wind of {speed:.3g} m/s; {allowed}")

    @property
    def calm(self) -> bool:
        """Whether there is no wind at all; then air resistance is neglected too."""
        return self.velocity == (0.0, 0.0) and self.gust == 0.0


class Scenario(Struct, frozen=True, forbid_unknown_fields=True):
    """A whole mission, planner and seed aside."""

    version: Literal[1] = 1
    duration: Annotated[float, Meta(gt=0, le=DAY)] = 40.0  # s
    first_decision: Time = 0.0  # s; until then UAVs hover
    dynamics: Literal["quadrotor", "kinematic"] = "quadrotor"
    area: Area = field(default_factory=Area)
    trees: Trees = field(default_factory=Trees)
    people: People = field(default_factory=People)
    uavs: Annotated[tuple[Uav, ...], Meta(min_length=1, max_length=200)] = DEFAULT_FLEET
    rates: Rates = field(default_factory=Rates)
    sensing: Sensing = field(default_factory=Sensing)
    tracking: Tracking = field(default_factory=Tracking)
    network: Network = field(default_factory=Network)
    appearance: Appearance = field(default_factory=Appearance)
    wind: Wind = field(default_factory=Wind)

    def __post_init__(self) -> None:
        if self.dynamics == "kinematic" and not self.wind.calm:
            raise ValueError('wind: moves no UAV of dynamics "kinematic"; allowed with "quadrotor"')
        for i, uav in enumerate(self.uavs):
            self._check_uav(i, uav)
        if not any(self.works(i, 0.0) for i in range(len(self.uavs))):
            raise ValueError("uavs: all have fails_at 0; one or more have to work at the start")
        self.network.check(len(self.uavs))
        check_workload(self)
        self._check_times()
        for (i, one), (j, other) in combinations(enumerate(self.uavs), 2):
            gaps = (one.start[0] - other.start[0], one.start[1] - other.start[1], one.altitude - other.altitude)
            if math.sqrt(sum(gap * gap for gap in gaps)) < _CLEARANCE:
                raise ValueError(f"uavs.{j}.start: {list(other.start)} is less than {_CLEARANCE:g} m from uavs.{i}")

    def _check_times(self) -> None:
        """ValueError if a time falls between scans or decisions, or after the end."""
        if self.first_decision > self.duration:
            raise ValueError(f"first_decision: {self.first_decision:g} s is after the duration of {self.duration:g} s")
        _check_multiple("network.plan_delay", self.network.plan_delay, self.rates.sensing, "scans")
        _check_multiple("first_decision", self.first_decision, self.rates.planning, "decisions")

    def _check_uav(self, i: int, uav: Uav) -> None:
        """ValueError if a UAV does not go with the rest of the scenario."""
        if uav.altitude <= self.trees.canopy_top:
            raise ValueError(
                f"uavs.{i}: footprint {uav.footprint:g} m means an altitude of {uav.altitude:.1f} m, "
                f"not above trees.canopy_top {self.trees.canopy_top:g} m"
            )
        if uav.altitude > _HIGHEST:
            text = f"with fov_deg {uav.fov_deg:g} means an altitude of {uav.altitude:.3g} m; allowed are {_HIGHEST:g} m"
            raise ValueError(f"uavs.{i}: footprint {uav.footprint:g} m {text}")
        if abs(uav.start[0]) > self.area.width / 2 or abs(uav.start[1]) > self.area.height / 2:
            raise ValueError(f"uavs.{i}.start: {list(uav.start)} lies outside the area")
        if uav.rate and self.rates.sensing % uav.rate:
            allowed = [r for r in range(1, self.rates.sensing + 1) if self.rates.sensing % r == 0]
            raise ValueError(
                f"uavs.{i}.rate: {uav.rate} Hz does not divide rates.sensing {self.rates.sensing} Hz; "
                f"allowed are {', '.join(map(str, allowed))}"
            )

    @property
    def scan_times(self) -> list[float]:
        """Instants at which the cameras look, the first at zero [s]."""
        return [k / self.rates.sensing for k in range(int(self.duration * self.rates.sensing + 1e-9) + 1)]

    def has_frame(self, uav: int, k: int) -> bool:
        """Whether a UAV's camera takes a frame at scan k; all do at the first."""
        rate = self.uavs[uav].rate or self.rates.sensing
        return k % (self.rates.sensing // rate) == 0

    def works(self, uav: int, time: float) -> bool:
        """Whether a UAV has not broken down at a time [s]."""
        fails_at = self.uavs[uav].fails_at
        return fails_at is None or time < fails_at


def _check_multiple(key: str, value: float, rate: int, what: str) -> None:
    """ValueError if a time [s] is no multiple of that between things that happen at a rate [Hz]."""
    count = value * rate
    if not math.isclose(count, round(count), abs_tol=1e-9):
        near = " and ".join(f"{k / rate:g}" for k in (math.floor(count), math.ceil(count)))
        raise ValueError(
            f"{key}: {value:g} s is no multiple of the {1 / rate:g} s between {what}; the nearest are {near}"
        )


def resolved(scenario: Scenario) -> str:
    """The scenario as JSON with every default written out."""
    return msgspec.json.encode(scenario).decode()
