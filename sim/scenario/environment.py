"""Settings of the environment: area, trees, people, appearance and wind."""

import math
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct

from sim.installation import ASSETS
from sim.scenario.quantities import Count, Length, Paths, Point, Projected, Side
from tracking.errors import spell
from tracking.plugins.registry import Registry
from tracking.settings import DAY, Expected, Speed

WALKS = Registry(
    "people.walks",
    {
        "levy": "sim.world.walks:Paths",
        "waypoints": "sim.world.walks:Waypoints",
        "stop-and-go": "sim.world.walks:StopAndGo",
        "groups": "sim.world.walks:Groups",
    },
    ("itineraries(people, half, paces, rng)",),
    bare=True,
)
TRAJECTORIES = {path.stem: path for path in sorted((ASSETS / "trajectories").glob("*.csv"))}
STANDS = {path.stem: path for path in sorted((ASSETS / "stands").glob("*.csv"))}
MOST_LEAVES = 5.0  # m²/m³; three metres of such a crown hide all but a thousandth
Height = Annotated[float, Meta(ge=2, le=40)]  # m, of a tree


class Area(Struct, frozen=True, forbid_unknown_fields=True):
    """The rectangle of the mission, centred on the origin."""

    width: Side = 150.0  # m, east-west
    height: Side = 100.0  # m, north-south


class Trees(Struct, frozen=True, forbid_unknown_fields=True):
    """A Poisson forest ([Li22] IV-A), or the trees of a stem map."""

    density: Expected = 45.0  # expected number of trees in the area, the paper's λ; the number drawn is Poisson
    per_hectare: Expected | None = None  # 1/ha, expected number of trees, in place of `density`
    canopy_radius: Length = 5.0  # m, the paper's R; canopies do not overlap, and people walk under them
    # m; if given, radii are uniform between `canopy_radius` and this
    largest_radius: Length | None = None
    canopy_base: Length = 3.0  # m, height above ground
    canopy_top: Length = 6.0  # m, height above ground; below every UAV, by more than 1 m if images are rendered
    trunk_radius: Length = 0.2  # m; people walk round trunks
    # m, within 2 to 40: range `[low, high]` of uniform random heights, in place of the sizes above; [Jucker17] and
    # [Chave14] give the radii of crowns and trunks, and crowns take half of the height
    height: tuple[Height, Height] | None = None
    overlap: bool = False  # true if crowns may overlap; trunks are then 1 m apart
    # m²/m³, leaf area in the volume of a crown, which then is random clusters of leaves; by default crowns are opaque
    leaf_area_density: Annotated[float, Meta(ge=0, le=MOST_LEAVES)] | None = None
    # CSV file of a stem map that replaces the random trees, or GeoJSON (`.geojson`) of points or crowns, relative to
    # the scenario file, or the name of a packaged one: `"park"`, `"plantation"`
    file: str = ""
    # m, easting and northing of the area's centre, if the stem map has projected coordinates
    origin: tuple[Projected, Projected] = (0.0, 0.0)
    # `"refuse"` stems of the stem map within 1 cm of each other, or `"merge"`: they are one tree, with the sum of the
    # areas of their trunks and the largest of their crowns
    same_place: Literal["refuse", "merge"] = "refuse"
    # trees of a stem map with a column status, or dead, fallen or alive: `"any"`, `"standing"`: also dead ones, but no
    # fallen ones, or `"alive"`
    status: Literal["any", "standing", "alive"] = "any"

    @property
    def tallest(self) -> float:
        """Upper bound [m] of the heights of random trees."""
        return self.canopy_top if self.height is None else self.height[1]

    @property
    def leaf_area(self) -> float:
        """Leaf area density [m²/m³], infinite if crowns are opaque."""
        return math.inf if self.leaf_area_density is None else self.leaf_area_density

    @property
    def stem_map(self) -> Path | None:
        """The CSV file of the stem map; None if trees stand at random places."""
        return STANDS.get(self.file, Path(self.file)) if self.file else None

    def __post_init__(self) -> None:
        if self.canopy_base >= self.canopy_top:
            raise ValueError(f"canopy_base {self.canopy_base:g} must be below canopy_top {self.canopy_top:g}")
        if self.trunk_radius > self.canopy_radius:
            raise ValueError(f"trunk_radius {self.trunk_radius:g} must not exceed canopy_radius {self.canopy_radius:g}")
        if self.largest_radius is not None and self.largest_radius < self.canopy_radius:
            text = f"canopy_radius {self.canopy_radius:g}, the smallest"
            raise ValueError(f"largest_radius {self.largest_radius:g} must not be below {text}")
        if self.height is not None and self.height[0] > self.height[1]:
            raise ValueError(f"height {list(self.height)} has to be [low, high], the least height first")

    def expected_count(self, area: Area) -> float:
        """Expected number of trees in an area."""
        return self.density if self.per_hectare is None else self.per_hectare * area.width * area.height / 1e4


# Waypoints [m] of the four default people: they come in from the west, cross near the centre, bend and part.
DEFAULT_PATHS: Paths = (
    ((-30.0, -18.0), (-8.0, -4.0), (10.0, 9.0), (38.0, 12.0), (65.0, 14.0)),
    ((-30.0, -6.0), (-8.0, -9.0), (12.0, -6.0), (36.0, 2.0), (65.0, 4.0)),
    ((-30.0, 6.0), (-10.0, 6.0), (10.0, -2.0), (32.0, -12.0), (60.0, -20.0)),
    ((-28.0, 18.0), (-6.0, 13.0), (14.0, 10.0), (30.0, 20.0), (55.0, 28.0)),
)


FILE_KEYS = ("fps", "start", "origin", "outside")  # keys of people that say how to read `trajectories`


class People(Struct, frozen=True, forbid_unknown_fields=True):
    """People: simulated walkers with one or several ways of walking, or recorded trajectories."""

    count: Count = 4  # number of people, late ones included
    # ways of walking; people are divided evenly among them, in this order: `"levy"`: along `paths`, else wandering;
    # `"waypoints"`: to one place after another; `"stop-and-go"`: the same, with stops; `"groups"`: the same in threes,
    # until the group parts
    walks: Annotated[tuple[str, ...], Meta(min_length=1, max_length=100)] = ("levy",)
    # m, waypoints `[[x, y], ...]` of the first `"levy"` walkers, shifted a little at random by the seed; the others
    # wander
    paths: Paths = DEFAULT_PATHS
    # s, mean time for which a person is present (0.5 to 1.5 times as long); people appear and leave anywhere, evenly
    # over the mission; by default all are present throughout
    stay: Annotated[float, Meta(ge=1, le=DAY)] | None = None
    min_speed: Speed = 1.0  # m/s, lower bound of the walkers' speeds
    max_speed: Speed = 3.0  # m/s, upper bound of the walkers' speeds
    # CSV or GPX file that replaces the walkers, relative to the scenario file, or the name of a packaged one: `"plaza"`
    trajectories: str = ""
    # Hz, frames in a second, if the file has the column frame in place of time
    fps: Annotated[float, Meta(gt=0, le=1000)] | None = None
    # s, time in the file at which the mission starts, or such as `2024-05-01T10:00:00+02:00` if the file has a date
    start: Annotated[float, Meta(ge=-1e10, le=1e10)] = 0.0
    origin: tuple[Projected, Projected] = (0.0, 0.0)  # m, place in the file that is the centre of the area
    # `"refuse"` rows of the file outside the area, or `"clip"`: people are absent while they are there
    outside: Literal["refuse", "clip"] = "refuse"

    @property
    def trajectory_file(self) -> Path | None:
        """The CSV file of the trajectories; None if people walk."""
        return TRAJECTORIES.get(self.trajectories, Path(self.trajectories)) if self.trajectories else None

    def __post_init__(self) -> None:
        if self.min_speed >= self.max_speed:
            raise ValueError(f"min_speed {self.min_speed:g} must be below max_speed {self.max_speed:g}")


class Appearance(Struct, frozen=True, forbid_unknown_fields=True):
    """Strengths of random variations of images."""

    # share of full strength with which light, ground, leaves, clothes and cameras vary; `true` is 1
    randomise: bool | Annotated[float, Meta(ge=0, le=1)] = False
    # pixels, standard deviation of Gaussian blur, in place of that share of the full 0.5
    blur: Annotated[float, Meta(ge=0, le=5)] | None = None
    # grey levels, standard deviation of Gaussian noise, in place of that share of the full 4
    noise: Annotated[float, Meta(ge=0, le=100)] | None = None


APPEARANCES = {"none": Appearance(), "mild": Appearance(randomise=0.5), "full": Appearance(randomise=True)}


class Wind(Struct, frozen=True, forbid_unknown_fields=True):
    """Wind: a mean velocity and first-order Gauss-Markov gusts, the same for the whole fleet."""

    velocity: Point = (0.0, 0.0)  # m/s, mean velocity to the east and north, at most 12 m/s; affects quadrotors only
    # m/s, standard deviation of each component of the gusts, which seed and repeat decide and the whole fleet shares
    gust: Annotated[float, Meta(ge=0, le=5)] = 0.0
    # s, correlation time of the gusts (first-order Gauss-Markov)
    gust_time: Annotated[float, Meta(ge=0.01, le=DAY)] = 5.0

    def __post_init__(self) -> None:
        east, north = self.velocity
        if (speed := math.sqrt(east * east + north * north)) > _STRONGEST_WIND:
            allowed = f"at most {_STRONGEST_WIND:g} m/s is allowed"
            raise ValueError(f"velocity {list(self.velocity)} is a wind of {spell(speed, 3)} m/s; {allowed}")

    @property
    def is_calm(self) -> bool:
        """True without any wind; air resistance is then neglected, too."""
        return self.velocity == (0.0, 0.0) and self.gust == 0.0


_STRONGEST_WIND = 12.0  # m/s; against it a quadrotor still flies at 5 m/s
