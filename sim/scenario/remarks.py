"""Remarks on settings of a scenario that are allowed but have no effect, or not the effect that one expects."""

import math

import msgspec
import numpy as np

from sim.scenario.environment import FILE_KEYS, People, Trees, Wind
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from tracking.errors import list_numbers, spell

_MOST_PIXELS = 2_000_000  # of an image, which takes about a second to render
_USUAL = 640 * 480
_MOST_CLUTTER = 0.05  # false detections in the area of a person's; in missions with 0.07, few people get tracks

# Keys that are not used if another key of the same table has this value.
_UNUSED = {
    ("tracking.management", "existence"): ("confirm", "delete"),
    ("tracking.management", "m_of_n"): ("survival", "birth_density", "confirmation_threshold", "deletion_threshold"),
    ("tracking.motion", "ncv"): ("walking_speed",),
    ("tracking.initial_tracks", "known"): ("undetected",),
    ("sensing.mode", "ideal"): ("renderer", "detector"),
}


def find_remarks(scenario: Scenario) -> list[str]:
    """Remarks on settings without the effect that one expects, one line each."""
    found = []
    last = scenario.scan_times[-1]
    if not math.isclose(last, scenario.duration):
        scans = f"the last scan is at {last:g} s"
        interval = f"{1 / scenario.rates.sensing:g} s between scans"
        found.append(f"duration: {scenario.duration:g} s is not a multiple of the {interval}; {scans}")
    found += _remark_on_trees(scenario.trees)
    if scenario.wind.gust_time != Wind().gust_time and not scenario.wind.gust:
        found.append("wind.gust_time: not used, as wind.gust is 0")
    if scenario.network.hold is not None and not scenario.network.takes_time:
        found.append("network.hold: not used, as messages take no time; set network.delay, jitter or rate")
    if scenario.trees.leaf_area_density is not None and scenario.sensing.occlusion == "disc":
        opaque = 'trackers and planners take crowns to be opaque with sensing.occlusion = "disc"'
        found.append(f"trees.leaf_area_density: {opaque}")
    if scenario.believed.leaf_area != 1.0 and scenario.trees.leaf_area_density is None and not scenario.trees.file:
        found.append("believed.leaf_area: not used, as crowns are opaque; set trees.leaf_area_density")
    if (
        scenario.believed.trees_unknown
        and scenario.believed.trees_missing == 1.0
        and not scenario.believed.trees_invented
    ):
        found.append("believed.trees_unknown: not used, as it is a share beside known trees, and none is known")
    return (
        found
        + _remark_on_people(scenario.people)
        + _remark_on_unused_keys(scenario)
        + _remark_on_misses(scenario)
        + _remark_on_false_alarms(scenario)
        + _remark_on_clutter(scenario)
        + find_small_people(scenario)
        + _remark_on_large_images(scenario)
    )


def _remark_on_clutter(scenario: Scenario) -> list[str]:
    """Remark if the tracker expects so much clutter that detections of people say little."""
    density = scenario.tracking.clutter_density
    expected = density * min(_compute_effective_area(scenario, i) for i in range(len(scenario.uavs)))
    if expected < _MOST_CLUTTER:
        return []
    place = f"{spell(expected, 2)} false detections where a person's own would be"
    return [f"tracking.clutter_density: {density:g} per m2 means {place}; few tracks or none will begin"]


def _compute_effective_area(scenario: Scenario, uav: int) -> float:
    """Area [m²] over which measurements of a person halfway to the edge of a UAV's view scatter, 2 pi sqrt |R|."""
    halfway = np.array([scenario.uavs[uav].footprint / 4, 0.0])
    (xx, xy), (_, yy) = scenario.noise_model(uav).covariance(np.zeros(2), halfway)
    return 2 * math.pi * math.sqrt(xx * yy - xy * xy)


def find_small_people(scenario: Scenario) -> list[str]:
    """Remarks on UAVs whose rendered images show a person by less than a pixel."""
    told: dict[str, list[int]] = {}
    for i, uav in enumerate(scenario.uavs if scenario.sensing.renders else ()):
        told.setdefault(describe_small_people(uav), []).append(i)
    seldom = "which will seldom or never see one; a smaller footprint or more pixels show people"
    return [f"uavs: {text} of the image of {list_numbers('UAV', i)}, {seldom}" for text, i in told.items() if text]


def _remark_on_large_images(scenario: Scenario) -> list[str]:
    """Remarks on UAVs whose images take long to render."""
    told: dict[tuple[str, str], list[int]] = {}
    for i, uav in enumerate(scenario.uavs if scenario.sensing.renders else ()):
        width, height = uav.true_camera.size
        if width * height > _MOST_PIXELS:
            share = math.sqrt(_USUAL / (width * height))
            key = f"camera.scale={uav.camera.scale * share:.2f}" if uav.camera else f"pixels={uav.pixels * share:.0f}"
            told.setdefault((f"images of {width} × {height} pixels", key), []).append(i)
    found = []
    for (images, key), some in told.items():
        slow = f"{images} of {list_numbers('UAV', some)} take a second or more each to render"
        whom = ["*"] if 1 < len(some) == len(scenario.uavs) else some
        found.append(f"uavs: {slow}; faster with {' '.join(f'--set uavs.{i}.{key}' for i in whom)}")
    return found


def describe_small_people(uav: Uav) -> str:
    """How much of a pixel a person straight below a camera covers; empty if it is a whole one or more."""
    covered = uav.person_pixels
    if covered >= 1.0:
        return ""
    return f"a person covers {spell(covered, 2) if covered >= 0.01 else 'less than 0.01'} pixels"


# For a key of trees: the keys that have no effect if it is set, and what it gives in their place.
_TREES = {
    "file": (("density", "per_hectare", "largest_radius", "height", "overlap"), "all trees"),
    "height": (("canopy_radius", "largest_radius", "canopy_base", "canopy_top", "trunk_radius"), "the sizes of trees"),
    "per_hectare": (("density",), "the number of trees"),
}


def _remark_on_trees(trees: Trees) -> list[str]:
    """Remarks on keys of trees that another key leaves without effect."""
    found: dict[str, str] = {}
    for by, (keys, what) in _TREES.items():
        if getattr(trees, by):
            changed = (key for key in keys if getattr(trees, key) != getattr(Trees(), key))
            found |= {key: f"trees.{by} gives {what}" for key in changed if key not in found}
    reasons = dict.fromkeys(found.values())
    return [f"{', '.join(f'trees.{key}' for key in found if found[key] == why)}: not used, as {why}" for why in reasons]


def _remark_on_people(people: People) -> list[str]:
    """Remarks on keys of people that trajectories, or the lack of a way of walking, leave without effect."""
    default = People()
    if people.trajectories:
        given = [name for name in People.__struct_fields__ if getattr(people, name) != getattr(default, name)]
        unused = ", ".join(f"people.{name}" for name in given if name not in ("trajectories", *FILE_KEYS))
        return [f"{unused}: not used, as people.trajectories gives all paths"] if unused else []
    if unused := ", ".join(f"people.{name}" for name in FILE_KEYS if getattr(people, name) != getattr(default, name)):
        return [f"{unused}: not used without people.trajectories"]
    if any(":" in walk for walk in people.walks):  # the user's own way of walking may use all keys
        return []
    spare = len(people.paths) - people.count
    if spare > 0 and people.paths != default.paths and people.walks == ("levy",):
        return [f"people.paths: {spare} of {len(people.paths)} not used, as people.count is {people.count}"]
    if people.paths in ((), default.paths) or "levy" in people.walks:
        return []
    return ['people.paths: not used, as people.walks lacks "levy"']


def _remark_on_unused_keys(scenario: Scenario) -> list[str]:
    """Remarks on changed keys that the value of another key leaves without effect."""
    given, default = msgspec.to_builtins(scenario), msgspec.to_builtins(Scenario())
    found = []
    for (key, value), others in _UNUSED.items():
        table, _, name = key.partition(".")
        for other in others if given[table][name] == value else ():
            if given[table][other] != default[table][other]:
                found.append(f'{table}.{other}: not used with {key} = "{value}"')
    return found


def _remark_on_misses(scenario: Scenario) -> list[str]:
    """Remark if the tracker expects less than half of the misses that the sensing has."""
    missed, expected = scenario.sensing.miss_probability, scenario.tracking.detection_probability
    if missed <= 2 * (1.0 - expected):
        return []
    probability = f"tracking.detection_probability: {expected:g} is far above the {spell(1.0 - missed, 2)}"
    return [f"{probability} that sensing.miss_probability means; misses will end tracks of people"]


def _remark_on_false_alarms(scenario: Scenario) -> list[str]:
    """Remarks on settings of the tracker under which false alarms become tracks."""
    expected = scenario.sensing.false_alarms / min(uav.view_area for uav in scenario.uavs)
    if expected == 0.0:
        return []
    found = []
    if scenario.tracking.clutter_density < expected / 10:
        density = f"tracking.clutter_density: {scenario.tracking.clutter_density:g} per m2 is far below"
        found.append(
            f"{density} the {spell(expected, 2)} that sensing.false_alarms means; tracks will follow false alarms"
        )
    if scenario.tracking.management == "m_of_n":
        m, n = scenario.tracking.confirm
        found.append(
            f'tracking.management: {m} of {n} false alarms make a track; "existence" weighs them against clutter'
        )
    return found
