"""Scenarios: the one tree of settings, read from TOML. Keys, types and ranges are checked on loading."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from itertools import combinations, pairwise
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
from msgspec import Meta, Struct, field

from sim.scenario.believed import MAPPERS, Believed, Mapping
from sim.scenario.environment import APPEARANCES, WALKS, Appearance, Area, People, Trees, Wind
from sim.scenario.fleet import MOST_UAVS, Fleet, resize
from sim.scenario.geo import Geo, Ground
from sim.scenario.quantities import Path, count_scans, simplify_number
from sim.scenario.sensing import DETECTORS, SENSOR_MODES, Sensing
from sim.scenario.uavs import DEFAULT_FLEET, Network, Uav, UavSettings
from tracking.detection.noise import NoiseModel
from tracking.errors import InputError, check_known, spell
from tracking.filter.motion import MOTION_MODELS
from tracking.fusion.member import TRACKERS
from tracking.fusion.rule import FUSION_RULES
from tracking.geometry.camera import ALL_ROUND, Camera
from tracking.navigation import Navigation
from tracking.parameters import Tracking
from tracking.plugins.registry import Registry
from tracking.settings import DAY, Time

START_GAP = 1.0  # m, least distance between UAVs at the start; rotors reach 0.3 m out
_ABOVE_CANOPIES = 1.0  # m, least height of rendering cameras above canopies; images leave out the nearest 0.5 m
_ROUNDING = 1e-6  # s, of times that are multiples of the time between scans
_STEADY = 25  # Hz: below 22.5 Hz the attitude loop of quadrotors is unstable
_HIGHEST = 10_000.0  # m above ground
MOST_WALKED = 3.6e5  # s, sum over all people, which takes about a gigabyte
_MOST_PATHS = 2e7  # m, sum of the lengths of all paths; each metre is a point to walk to


class Rates(Struct, frozen=True, forbid_unknown_fields=True):
    """Rates [Hz] of physics, sensing and planning; each divides the previous one."""

    # Hz, steps of the engine; a multiple of `rates.sensing`; 25 or more for quadrotors
    physics: Annotated[int, Meta(ge=1, le=10_000)] = 240
    sensing: Annotated[int, Meta(ge=1, le=1000)] = 5  # Hz, scans; a multiple of `rates.planning`
    # Hz, decisions, such as 0.5; its inverse, a multiple of the time between scans, is the time step of a plan
    planning: Annotated[float, Meta(ge=0.01, le=1000)] = 1

    def __post_init__(self) -> None:
        rate = self.physics
        step = self.sensing
        if rate % step:
            near = " or ".join(str(k) for k in (rate - rate % step, rate - rate % step + step) if k)
            raise ValueError(f"physics {rate} Hz is not a multiple of sensing {step} Hz, as {near} would be")
        count_scans("planning", self.planning, self.sensing)

    @property
    def plan_scans(self) -> int:
        """Number of scans in a time step of a plan."""
        return count_scans("planning", self.planning, self.sensing)

    @property
    def plan_step(self) -> float:
        """Time step of a plan [s], from one decision to the next."""
        return self.plan_scans / self.sensing


class Scenario(Struct, frozen=True, forbid_unknown_fields=True):
    """Everything that defines a mission except planner, seed and repeat."""

    version: Literal[1] = 1  # version of this format; results are comparable only within one version
    # s, simulated time, from the first scan to the last that fits into it
    duration: Annotated[float, Meta(gt=0, le=DAY)] = 40.0
    # s, time of the first decision, a multiple of the time between decisions; UAVs hover until then
    first_decision: Time = 0.0
    # `"quadrotor"`: thrust and attitude control in the engine; `"kinematic"`: UAVs have the commanded velocity at once
    # ([Li22] eq. (5))
    dynamics: Literal["quadrotor", "kinematic"] = "quadrotor"
    # m, distance of a person from a track beyond which the track does not hold them, in metrics, events and pictures
    loss_distance: Annotated[float, Meta(gt=0, le=10)] = 1.0
    area: Area = field(default_factory=Area)
    geo: Geo = Geo()
    ground: Ground = Ground()
    trees: Trees = field(default_factory=Trees)
    people: People = field(default_factory=People)
    uavs: Annotated[tuple[Uav, ...], Meta(min_length=1, max_length=MOST_UAVS)] = DEFAULT_FLEET  # the fleet, one or more
    rates: Rates = field(default_factory=Rates)
    sensing: Sensing = field(default_factory=Sensing)
    tracking: Tracking = field(default_factory=Tracking)
    network: Network = field(default_factory=Network)
    appearance: Appearance = field(default_factory=Appearance)
    wind: Wind = field(default_factory=Wind)
    mapping: Mapping = Mapping()
    believed: Believed = Believed()  # errors of what UAVs believe of the world

    def __post_init__(self) -> None:
        for registry, name in self.plugins:
            registry.check(name)
        for table, own in (("trees", self.trees), ("people", self.people)):
            if self.geo.epsg and own.origin != (0.0, 0.0):
                raise ValueError(f"{table}.origin: not allowed with geo.epsg; geo.origin gives the area's centre")
        if self.dynamics == "kinematic" and not self.wind.is_calm:
            raise ValueError('wind: has no effect on UAVs of dynamics "kinematic"; allowed with "quadrotor"')
        for i, uav in enumerate(self.uavs):
            self._check_uav(i, uav)
        if not any(self.works(i, 0.0) for i in range(len(self.uavs))):
            raise ValueError("uavs: all have fails_at 0; at least one has to work at the start")
        self.network.check(len(self.uavs))
        self.believed.mislead(self.tracking)
        self._check_mapping()
        check_workload(self)
        self._check_times()
        for (i, one), (j, other) in combinations(enumerate(self.uavs), 2):
            if not (one.start_radius or other.start_radius or is_clear(one, other)):
                raise ValueError(f"uavs.{j}.start: {list(other.start)} is less than {START_GAP:g} m from uavs.{i}")

    def _check_mapping(self) -> None:
        if self.mapping.forest != "known" and not self.believed.maps_truly:
            raise ValueError('believed: errors of the map of trees are allowed with mapping.forest "known" only')
        if self.mapping.forest != "mapped" and not self.mapping.share:
            raise ValueError(
                'mapping.share: false is allowed with mapping.forest "mapped" only; no other maps are sent'
            )
        if self.mapping.forest == "mapped" and not self.sensing.renders:
            raise ValueError(
                f'mapping.forest: "mapped" needs images, which sensing.mode {self.sensing.mode!r} has not; '
                'allowed are "known" and "none"'
            )

    def _check_times(self) -> None:
        if self.first_decision > self.duration:
            raise ValueError(f"first_decision: {self.first_decision:g} s is after the duration of {self.duration:g} s")
        if self.dynamics == "quadrotor" and self.rates.physics < _STEADY:
            steady = f'allowed with dynamics "quadrotor" are {_STEADY} Hz or more'
            raise ValueError(f"rates.physics: at {self.rates.physics} Hz quadrotors cannot be controlled; {steady}")
        latest = self.network.delay + self.network.jitter
        if latest >= self.duration:
            raise ValueError(
                f"network.delay: {latest:g} s with network.jitter is not below the duration of {self.duration:g} s"
            )
        if self.network.takes_time:
            for least, what in ((latest, "that messages may take"), (1 / self.rates.sensing, "between scans")):
                if self.network.longest_wait < least:
                    raise ValueError(
                        f"network.hold: {self.network.longest_wait:g} s must not be less than the {least:g} s {what}"
                    )
        _check_multiple("network.plan_delay", self.network.plan_delay, self.rates.sensing, "scans")
        _check_multiple("first_decision", self.first_decision, self.rates.planning, "decisions")

    def _check_uav(self, i: int, uav: Uav) -> None:
        gap = self.least_height_above_canopies
        above = f"{gap:g} m above" if gap else "above"
        planted = not self.trees.file and self.trees.expected_count(self.area) > 0
        if planted and uav.altitude <= self.trees.tallest + gap:
            key = "canopy_top" if self.trees.height is None else "height"
            text = f"means an altitude of {uav.altitude:.1f} m, not {above} trees.{key} {self.trees.tallest:g} m"
            raise ValueError(f"uavs.{i}: footprint {uav.footprint:g} m {text}")
        if uav.altitude > _HIGHEST:
            text = (
                f"with fov_deg {uav.fov_deg:g} means an altitude of {spell(uav.altitude, 3)} m; at most {_HIGHEST:g} m"
            )
            raise ValueError(f"uavs.{i}: footprint {uav.footprint:g} m {text}")
        if abs(uav.start[0]) > self.area.width / 2 or abs(uav.start[1]) > self.area.height / 2:
            inside = f"allowed are |x| <= {self.area.width / 2:g} and |y| <= {self.area.height / 2:g} m"
            raise ValueError(f"uavs.{i}.start: {list(uav.start)} lies outside the area; {inside}")
        self.frame_scans(i)
        if uav.readout * self.rates.sensing >= 1:
            limit = f"allowed is less than the {1 / self.rates.sensing:g} s between scans"
            raise ValueError(f"uavs.{i}.camera.readout: {uav.readout:g} s is too long; {limit}")

    @property
    def least_height_above_canopies(self) -> float:
        """Height [m] above each canopy that the altitude of every UAV has to exceed."""
        return _ABOVE_CANOPIES if self.sensing.renders else 0.0

    @property
    def navigation_errs(self) -> bool:
        """True if some UAV does not know its pose exactly."""
        return any(uav.navigation_errors != Navigation() for uav in self.uavs)

    @property
    def plugins(self) -> tuple[tuple[Registry, str], ...]:
        """Pairs of a registry and the name or import string that the scenario takes from it."""
        sensing = (
            (SENSOR_MODES, self.sensing.mode),
            (DETECTORS, self.sensing.detector),
            (MAPPERS, self.mapping.mapper),
        )
        tracking = ((TRACKERS, self.tracking.tracker), (MOTION_MODELS, self.tracking.motion))
        walks = ((WALKS, name) for name in self.people.walks)
        return (*sensing, *tracking, (FUSION_RULES, self.network.fusion), *walks)

    @property
    def scan_times(self) -> list[float]:
        """Times of the scans [s]; the first is at zero."""
        return [k / self.rates.sensing for k in range(int(self.duration * self.rates.sensing + 1e-9) + 1)]

    @property
    def decision_times(self) -> list[float]:
        """Times of the decisions [s]."""
        return [time for k, time in enumerate(self.scan_times) if self.decides(k)]

    def has_frame(self, uav: int, k: int) -> bool:
        """True if a UAV's camera takes a frame at scan k; every camera takes one at the first scan."""
        return k % self.frame_scans(uav) == 0

    def frame_scans(self, uav: int) -> int:
        """Number of scans from one frame of a UAV's camera to the next; ValueError unless it is a whole number."""
        return count_scans(f"uavs.{uav}.rate:", self.uavs[uav].rate or self.rates.sensing, self.rates.sensing)

    def decides(self, k: int) -> bool:
        """True if UAVs decide at scan k."""
        rates = self.rates
        return k >= round(self.first_decision * rates.sensing) and k % rates.plan_scans == 0

    def plan_start(self, decided: float) -> float:
        """Time [s] from which the plans of a decision are flown, given the time of the decision [s]."""
        return decided + self.network.plan_delay

    def find_flown(self, decided: Iterable[float], now: Iterable[float]) -> list[int]:
        """The decision whose plans are flown at each of the times `now` [s]; -1 before the plans of the first are due.

        This is the home of the rule; mission, recording and pictures ask here. decided: times [s] of the decisions, in
        order.
        """
        starts = [self.plan_start(time) for time in decided]
        return [bisect_right(starts, time + _ROUNDING) - 1 for time in now]

    def true_camera(self, uav: int) -> Camera:
        """The camera through which a UAV sees: its own, or one with an unlimited field of view."""
        return self._all_round(uav) or self.uavs[uav].true_camera

    def believed_camera(self, uav: int) -> Camera:
        """The camera of a UAV's measurements, as the fleet believes it to be."""
        return self._all_round(uav) or self.uavs[uav].believed_camera

    def _all_round(self, uav: int) -> Camera | None:
        return Camera(ALL_ROUND, self.uavs[uav].pixels) if self.sensing.field_of_view == "unlimited" else None

    def noise_model(self, uav: int) -> NoiseModel:
        """The measurement noise of a UAV's camera."""
        own = self.uavs[uav]
        if self.sensing.noise == "range_bearing":
            return NoiseModel.range_bearing(own.alpha)
        return NoiseModel.camera(own.believed_camera, own.altitude)

    @property
    def believed_tracking(self) -> Tracking:
        """Settings of trackers and planners, with the errors of what they believe of people and detectors."""
        return self.believed.mislead(self.tracking)

    def works(self, uav: int, time: float) -> bool:
        """True if a UAV has not broken down at a time [s]."""
        fails_at = self.uavs[uav].fails_at
        return fails_at is None or time < fails_at


def is_clear(one: Uav, other: Uav) -> bool:
    """True if the starts of two UAVs are `START_GAP` apart."""
    gaps = (one.start[0] - other.start[0], one.start[1] - other.start[1], one.altitude - other.altitude)
    return math.sqrt(math.fsum(gap * gap for gap in gaps)) >= START_GAP


def _check_multiple(key: str, value: float, rate: float, what: str) -> None:
    """ValueError if a time [s] is not a multiple of the period of a rate [Hz]."""
    count = value * rate
    if not math.isclose(count, round(count), abs_tol=1e-9):
        near = " and ".join(f"{k / rate:g}" for k in (math.floor(count), math.ceil(count)))
        raise ValueError(
            f"{key}: {value:g} s is not a multiple of the {1 / rate:g} s between {what}; the nearest are {near}"
        )


class ScenarioSettings(Scenario, frozen=True, forbid_unknown_fields=True):
    """A scenario as a file gives it: views of UAVs in part, and the appearance also by name."""

    fleet: Fleet = field(default_factory=Fleet)
    # the fleet, one or more
    uavs: Annotated[tuple[UavSettings, ...], Meta(min_length=1, max_length=MOST_UAVS)] = tuple(
        UavSettings(start=uav.start, footprint=uav.footprint, alpha=uav.alpha) for uav in DEFAULT_FLEET
    )
    # how images vary with the seed: `"none"`, `"mild"`, `"full"`, or a table of the keys below
    appearance: str | Appearance = "none"  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Check nothing: `complete` does."""

    def complete(self) -> Scenario:
        """The scenario with all that follows from the settings; ValueError if they contradict one another."""
        appearance = self.appearance
        if isinstance(appearance, str):
            check_known("appearance", appearance, APPEARANCES, " (or a table of strengths)")
            appearance = APPEARANCES[appearance]
        uavs = resize(self.uavs, self.fleet.size, self.area)
        fleet = tuple(_complete_uav(i, uav) for i, uav in enumerate(uavs))
        rates = msgspec.structs.replace(self.rates, planning=simplify_number(self.rates.planning))
        given = {name: getattr(self, name) for name in Scenario.__struct_fields__}
        return Scenario(**{**given, "uavs": fleet, "rates": rates, "appearance": appearance})


def _complete_uav(i: int, settings: UavSettings) -> Uav:
    try:
        return settings.complete()
    except ValueError as error:
        raise ValueError(f"uavs.{i}: {error}") from error


# Keys that recordings hold at any value, in their order; all other keys are left out at their defaults.
_ALWAYS_RECORDED = {
    "": "version duration first_decision dynamics area trees people uavs rates sensing tracking network appearance "
    "wind",
    "area": "width height",
    "trees": "density canopy_radius canopy_base canopy_top trunk_radius",
    "people": "count paths min_speed max_speed levy_exponent trajectories",
    "uavs": "start footprint alpha fov_deg pixels max_speed mount rate tilt_deg fails_at",
    "uavs.navigation": "horizontal_noise vertical_noise horizontal_drift vertical_drift position_time velocity_noise "
    "tilt_bias_deg tilt_drift_deg yaw_bias_deg yaw_drift_deg attitude_time clock_deviation clock_offset",
    "rates": "physics sensing planning",
    "sensing": "mode noise occlusion renderer detector false_alarms miss_probability field_of_view",
    "tracking": "sigma_a initial_tracks detection_probability clutter_density gate_probability confirm delete "
    "negative_information reacquire_after max_variance max_speed walking_speed management survival birth_density "
    "confirmation_threshold deletion_threshold motion tracker undetected",
    "network": "rounds range fusion loss links cuts plan_delay",
    "network.cuts": "links start end",
    "appearance": "randomise light_deg ambient ground_tint ground_moved canopy_tint clothing_hue_deg clothing_shade "
    "exposure blur noise",
    "wind": "velocity gust gust_time",
}
# Keys that earlier releases had, at the only value that recordings may have.
_REMOVED: dict[str, float | None] = {
    "trees.crown_ratio": 0.5,
    "people.group": 3,
    "people.levy_exponent": 2.0,
    "people.max_gap": None,
    "uavs.navigation.position_time": 300.0,
    "uavs.navigation.attitude_time": 60.0,
    "uavs.navigation.clock_offset": None,
    "appearance.light_deg": None,
    "appearance.ambient": None,
    "appearance.ground_tint": None,
    "appearance.ground_moved": None,
    "appearance.canopy_tint": None,
    "appearance.clothing_hue_deg": None,
    "appearance.clothing_shade": None,
    "appearance.exposure": None,
}


def encode_scenario(scenario: Scenario) -> str:
    """The scenario as JSON, as recordings hold it: with all keys of `_ALWAYS_RECORDED`, whatever they were set to."""
    return msgspec.json.encode(_arrange(scenario, "")).decode()


def _arrange(value: Any, table: str) -> Any:  # noqa: ANN401 - settings
    """Settings as plain data with the keys that recordings hold, in their order; `table` is their dotted name."""
    if isinstance(value, tuple):
        return [_arrange(item, table) for item in value]
    if not isinstance(value, Struct) or table not in _ALWAYS_RECORDED:
        return msgspec.to_builtins(value)
    missing = _ALWAYS_RECORDED[table].split()
    found: dict[str, Any] = {}
    for key in msgspec.structs.fields(value):
        own = getattr(value, key.name)
        if key.name in missing:
            while (before := missing.pop(0)) != key.name:
                found[before] = _REMOVED[f"{table}.{before}"]
        elif own == key.default:
            continue
        found[key.name] = _arrange(own, f"{table}.{key.name}".lstrip("."))
    return found | {key: _REMOVED[f"{table}.{key}"] for key in missing}


def leave_out_removed_keys(recorded: Any, table: str = "") -> Any:  # noqa: ANN401 - plain data
    """Settings of a recording without keys that only earlier releases had; InputError if one of them was changed."""
    if isinstance(recorded, list):
        return [leave_out_removed_keys(item, table) for item in recorded]
    if not isinstance(recorded, dict):
        return recorded
    found = {}
    for key, value in recorded.items():
        name = f"{table}.{key}".lstrip(".")
        if name not in _REMOVED:
            found[key] = leave_out_removed_keys(value, name)
        elif value != _REMOVED[name]:
            raise InputError(f"{name}: {value!r} was set in a release that had this key, which later ones have not")
    return found


def check_workload(scenario: Scenario) -> None:
    """ValueError if a product of settings is too large; the message names them."""
    for load in _list_workloads(scenario):
        if load.amount > load.most:
            come_to = f"come to {load.amount:g} {load.unit}"
            raise ValueError(f"{load.settings} {come_to}; at most {load.most:g} are allowed")


class _Workload(NamedTuple):
    """A product of settings, and the limit beyond which no machine could fly it."""

    settings: str  # names of the settings
    amount: float
    unit: str
    most: float


def _list_workloads(scenario: Scenario) -> Iterator[_Workload]:
    """All products of settings that have a limit."""
    uavs = len(scenario.uavs)
    rates = scenario.rates
    people = scenario.people
    scans = scenario.duration * rates.sensing
    yield _Workload("duration, rates.physics and uavs", scenario.duration * rates.physics * uavs, "steps of a UAV", 1e9)
    yield _Workload("duration, rates.sensing and uavs", scans * uavs, "scans", 2e6)
    messages = scans * scenario.network.rounds * uavs * uavs
    yield _Workload("duration, rates.sensing, network.rounds and uavs", messages, "messages", 1e9)
    if scenario.sensing.renders:
        pixels = scans * math.fsum(math.prod(uav.true_camera.size) for uav in scenario.uavs)
        yield _Workload("duration, rates.sensing, uavs and their pixels", pixels, "pixels", 1e12)
    area = scenario.area.width * scenario.area.height
    yield _Workload("area and uavs, each of which keeps a map of it,", area * uavs, "m² of maps", 6e8)
    if not people.trajectories:
        yield _Workload(
            "duration and people.count", scenario.duration * people.count, "seconds of walking", MOST_WALKED
        )
        lines_of_sight = scans * uavs * people.count
        yield _Workload(
            "duration, rates.sensing, uavs and people.count", lines_of_sight, "lines of sight to people", 1e7
        )
        lengths = [_measure_length(path) for path in people.paths]
        yield _Workload(
            "people.paths, each as long as the longest,", len(lengths) * max(lengths, default=0.0), "m", _MOST_PATHS
        )


def _measure_length(path: Path) -> float:
    return math.fsum(math.sqrt((x - u) * (x - u) + (y - v) * (y - v)) for (x, y), (u, v) in pairwise(path))
