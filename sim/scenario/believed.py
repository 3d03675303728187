"""Settings of what UAVs believe wrongly of the world."""

from typing import Annotated, Literal

from msgspec import Meta, Struct
from msgspec.structs import replace

from tracking.parameters import Tracking
from tracking.plugins.registry import Registry
from tracking.settings import Probability

MAPPERS = Registry(
    "mapping.mapper",
    {"parallax": "tracking.mapping.mapper:ParallaxMapper"},
    ("add(frame)", "trees()", "ground()"),
    bare=True,
)
Factor = Annotated[float, Meta(ge=0.01, le=100)]


class Mapping(Struct, frozen=True, forbid_unknown_fields=True):
    """What UAVs know of the trees."""

    # `"known"`: UAVs have a map of the trees, by default the true one; `"mapped"`: they have none, and each UAV maps
    # trees in the frames of its own camera, and reckons with trees where it has not looked; `"none"`: they know of no
    # trees
    forest: Literal["known", "mapped", "none"] = "known"
    # True if UAVs send the maps that they make to each other, over the network that tracks take
    share: bool = True
    # `"parallax"`: finds trees by how they move in the image, or the import string of a mapper of your own
    mapper: str = "parallax"


class Believed(Struct, frozen=True, forbid_unknown_fields=True):
    """Errors of what detectors, trackers and planners believe of the world, which itself stays as it is."""

    # m, standard deviation of the errors of the positions of trees along each axis
    tree_shift: Annotated[float, Meta(ge=0, le=100)] = 0.0
    trees_missing: Probability = 0.0  # share of the trees that UAVs do not know
    # trees that UAVs believe to be somewhere in the area and that are not there, as a share of the true number
    trees_invented: Annotated[float, Meta(ge=0, le=10)] = 0.0
    # relative standard deviation of the radii of each tree, and of its heights
    tree_sizes: Annotated[float, Meta(ge=0, le=1)] = 0.0
    leaf_area: Factor = 1.0  # believed leaf area density of porous crowns, as a factor of the true one
    speed: Factor = 1.0  # factor of `tracking.walking_speed` and `tracking.max_speed`
    sigma_a: Factor = 1.0  # factor of `tracking.sigma_a`, by which motion models err
    misses: Factor = 1.0  # factor of the probability of a miss, 1 - `tracking.detection_probability`

    # m, standard deviation of the positions of trees along each axis that trackers and planners reckon with, whatever
    # `tree_shift` is; by default they take the map to be exact
    tree_deviation: Annotated[float, Meta(ge=0, le=100)] = 0.0
    # share of all trees that trackers and planners reckon not to know, whatever `trees_missing` is
    trees_unknown: Annotated[float, Meta(ge=0, le=0.95)] = 0.0

    @property
    def knows_trees(self) -> bool:
        """True if the map of trees is exact."""
        exact = self.tree_shift == self.trees_missing == self.trees_invented == self.tree_sizes == 0.0
        return exact and self.leaf_area == 1.0

    @property
    def maps_truly(self) -> bool:
        """True if the map of trees is exact, and UAVs take it to be."""
        return self.knows_trees and self.tree_deviation == self.trees_unknown == 0.0

    def mislead(self, tracking: Tracking) -> Tracking:
        """Settings of trackers with the errors; ValueError if no probability of detection is left."""
        if self.misses == self.speed == self.sigma_a == 1.0:
            return tracking
        missed = 1.0 - tracking.detection_probability
        if self.misses * missed >= 1.0:
            left = f"{self.misses:g} times the {missed:g} that tracking.detection_probability leaves"
            raise ValueError(f"believed.misses: {left} is no probability; allowed is less than {1.0 / missed:g}")
        return replace(
            tracking,
            sigma_a=self.sigma_a * tracking.sigma_a,
            detection_probability=tracking.detection_probability if self.misses == 1.0 else 1.0 - self.misses * missed,
            max_speed=self.speed * tracking.max_speed,
            walking_speed=self.speed * tracking.walking_speed,
        )
