"""Settings of the environment: area, trees, people, appearance and wind."""

import math
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct

from sim.installation import ASSETS
from sim.scenario.quantities import DAY, Count, Expected, Length, Paths, Point, Side, Speed
from tracking.plugins.registry import Registry

WALKS = Registry(
    "people.walks",
    {
        "levy": "sim.world.walks:Levy",
        "waypoints": "sim.world.walks:Waypoints",
        "stop-and-go": "sim.world.walks:StopAndGo",
        "groups": "sim.world.walks:Groups",
    },
    ("itineraries(people, half, paces, rng)",),
    bare=True,
)
TRAJECTORIES = {path.stem: path for path in sorted((ASSETS / "trajectories").glob("*.csv"))}


class Area(Struct, frozen=True, forbid_unknown_fields=True):
    """The rectangle of the mission, centred on the origin."""

    width: Side = 150.0  # m, east-west
    height: Side = 100.0  # m, north-south


class Trees(Struct, frozen=True, forbid_unknown_fields=True):
    """A Poisson forest ([Li22] IV-A)."""

    density: Expected = 45.0  # expected number in the area, the paper's λ; the number itself is Poisson
    per_hectare: Expected | None = None  # 1/ha, expected number per hectare; if given, `density` is not used
    canopy_radius: Length = 5.0  # m, the paper's R; canopies do not overlap, people walk under them
    # m; if given, radii are uniform between `canopy_radius` and this; otherwise all are `canopy_radius`
    largest_radius: Length | None = None
    canopy_base: Length = 3.0  # m, above ground
    canopy_top: Length = 6.0  # m, above ground, below every UAV; 1 m or more below where images are rendered
    trunk_radius: Length = 0.2  # m, people walk round trunks

    def __post_init__(self) -> None:
        if self.canopy_base >= self.canopy_top:
            raise ValueError(f"canopy_base {self.canopy_base:g} must be below canopy_top {self.canopy_top:g}")
        if self.trunk_radius > self.canopy_radius:
            raise ValueError(f"trunk_radius {self.trunk_radius:g} must not exceed canopy_radius {self.canopy_radius:g}")
        if self.largest_radius is not None and self.largest_radius < self.canopy_radius:
            text = f"canopy_radius {self.canopy_radius:g}, the smallest"
            raise ValueError(f"largest_radius {self.largest_radius:g} must not be below {text}")

    def expected(self, area: Area) -> float:
        """Expected number of trees in an area."""
        return self.density if self.per_hectare is None else self.per_hectare * area.width * area.height / 1e4


# Waypoints [m] of the default four: they come in from the west, cross near the centre, bend, and part.
DEFAULT_PATHS: Paths = (
    ((-30.0, -18.0), (-8.0, -4.0), (10.0, 9.0), (38.0, 12.0), (65.0, 14.0)),
    ((-30.0, -6.0), (-8.0, -9.0), (12.0, -6.0), (36.0, 2.0), (65.0, 4.0)),
    ((-30.0, 6.0), (-10.0, 6.0), (10.0, -2.0), (32.0, -12.0), (60.0, -20.0)),
    ((-28.0, 18.0), (-6.0, 13.0), (14.0, 10.0), (30.0, 20.0), (55.0, 28.0)),
)


class People(Struct, frozen=True, forbid_unknown_fields=True):
    """Walking people, by one or several ways of walking, or recorded trajectories."""

    count: Count = 4  # number of walkers, including those who appear late or leave early
    # ways of walking; people are divided evenly among them, in this order: `"levy"`: along `paths`, the others
    # wander; `"waypoints"`: to one place after another; `"stop-and-go"`: the same, standing still at times; `"groups"`:
    # to one place after another together, until the group parts; `"module:Class"`: yours
    # ([how](../how-to/plugins.md#a-way-of-walking))
    walks: Annotated[tuple[str, ...], Meta(min_length=1, max_length=100)] = ("levy",)
    # m, waypoints `[[x, y], ...]` of the first `"levy"` walkers, which the seed shifts a little; the others wander
    paths: Paths = DEFAULT_PATHS
    group: Annotated[int, Meta(ge=1, le=20)] = 3  # number of people in each of the `"groups"`; the last may be smaller
    # s, mean time for which people are present; each stays between half and one and a half times as long. They appear
    # and leave anywhere, evenly over the mission, some before its start or after its end. If not given, all are present
    # throughout
    stay: Annotated[float, Meta(ge=1, le=DAY)] | None = None
    min_speed: Speed = 1.0  # m/s, lower bound of the walkers' speeds
    max_speed: Speed = 3.0  # m/s, upper bound of the walkers' speeds
    # step lengths have a density proportional to length^-exponent, cut off at the two speeds
    levy_exponent: Annotated[float, Meta(gt=1, le=3)] = 2.0
    # CSV file that replaces the walkers, relative to the scenario file, or the name of a packaged one: `"plaza"`
    trajectories: str = ""

    @property
    def trajectory_file(self) -> Path | None:
        """The CSV file of the trajectories; None if people walk."""
        return TRAJECTORIES.get(self.trajectories, Path(self.trajectories)) if self.trajectories else None

    def __post_init__(self) -> None:
        if self.min_speed >= self.max_speed:
            raise ValueError(f"min_speed {self.min_speed:g} must be below max_speed {self.max_speed:g}")


class Appearance(Struct, frozen=True, forbid_unknown_fields=True):
    """Strengths of random variations of images; a strength left open is zero, or full with `randomise`."""

    randomise: bool = False  # vary everything below
    light_deg: Annotated[float, Meta(ge=0, le=75)] | None = None  # deg, largest angle of the sun from the zenith
    ambient: Annotated[float, Meta(ge=0, le=0.5)] | None = None  # share of diffuse light, 0.75 plus or minus this
    ground_tint: Annotated[float, Meta(ge=0, le=0.2)] | None = None  # change of each of red, green and blue, relative
    ground_moved: bool | None = None  # whether the ground's texture is shifted and turned
    # change of the forest's colour, and again of each tree's brightness, relative
    canopy_tint: Annotated[float, Meta(ge=0, le=0.2)] | None = None
    # deg, hue of each person's clothes, 16 plus or minus this
    clothing_hue_deg: Annotated[float, Meta(ge=0, le=6)] | None = None
    clothing_shade: Annotated[float, Meta(ge=0, le=0.5)] | None = None  # share by which some clothes are darker
    exposure: Annotated[float, Meta(ge=0, le=1)] | None = None  # gain of each camera from 1 / (1 + x) to 1 + x
    blur: Annotated[float, Meta(ge=0, le=5)] | None = None  # pixels, standard deviation of a Gaussian
    noise: Annotated[float, Meta(ge=0, le=100)] | None = None  # grey levels, standard deviation of a Gaussian


class Wind(Struct, frozen=True, forbid_unknown_fields=True):
    """Air that moves quadrotors: a mean and first-order Gauss-Markov gusts, the same for the whole fleet."""

    velocity: Point = (0.0, 0.0)  # m/s, mean, to the east and to the north, at most 12 m/s; only quadrotors feel it
    # m/s, standard deviation of each component; the gusts of seed and repeat are the same for the whole fleet
    gust: Annotated[float, Meta(ge=0, le=5)] = 0.0
    # s, correlation time of the gusts (first-order Gauss-Markov)
    gust_time: Annotated[float, Meta(ge=0.01, le=DAY)] = 5.0

    def __post_init__(self) -> None:
        east, north = self.velocity
        if (speed := math.sqrt(east * east + north * north)) > _STRONGEST_WIND:
            allowed = f"at most {_STRONGEST_WIND:g} m/s is allowed"
            raise ValueError(f"velocity {list(self.velocity)} is a wind of {speed:.3g} m/s; {allowed}")

    @property
    def calm(self) -> bool:
        """True without any wind; then air resistance is neglected too."""
        return self.velocity == (0.0, 0.0) and self.gust == 0.0


_STRONGEST_WIND = 12.0  # m/s, against which a quadrotor still flies at 5 m/s
