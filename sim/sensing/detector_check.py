"""Conformance of a detector to `tracking.detection.detector.Detector`, checked on rendered frames."""

import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cache, partial
from statistics import mean
from typing import Any

import numpy as np

from sim.scenario.scenario import Scenario
from sim.scenario.sensing import DETECTORS
from sim.scenario.uavs import Uav
from sim.sensing.cameras import camera_pose
from sim.sensing.detection_truth import MaskDetector, match_detections
from sim.sensing.renderer import Rendered, Renderer
from sim.sensing.sensor_output_check import check_detections
from sim.world.world import World
from tracking.detection.detector import Detections, Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.distances import squared_distance
from tracking.plugins.findings import (
    Finding,
    Unfit,
    Untried,
    check_nees,
    describe_time,
    find_change,
    judge_plugin,
    require,
    time_calls,
    try_checks,
)

FOREST = Forest((Tree(-9.0, 8.0), Tree(9.0, 9.0), Tree(10.0, -2.0)))
PEOPLE = np.array([(0.0, 0.0), (5.0, 4.0), (-7.0, 2.0), (4.0, -8.0), (-5.0, -7.0), (0.5, 9.0)])
_ELSEWHERE = np.array([60.0, 40.0])  # m, a place that no camera here sees
_UAV = Uav(start=(74.0, 49.0))
_ALTITUDE = 25.0  # m
_ORDINARY, _EMPTY = "ordinary", "no person in view"


@dataclass(frozen=True, eq=False)
class StagedFrame:
    """A frame, the renderer's output for it, the positions of the people (M, 2) m, and how many the frame shows."""

    frame: Frame
    rendered: Rendered
    people: Array
    shown: int

    def match(self, found: Detections) -> Indices:
        """Index (M,) of each person's detection, -1 for none."""
        return match_detections(found.pixels, self.rendered.people, len(self.people))


@cache
def stage_frames() -> dict[str, StagedFrame]:
    """Staged frames by name, rendered once."""
    tilted = Uav(start=(0.0, 0.0), tilt_deg=30.0)
    low, level = Pose.level(0.0, 0.0, 15.0), Pose.level(0.0, 0.0, _ALTITUDE)
    wanted = {
        _ORDINARY: (128, level, PEOPLE),
        "turned and moved": (128, Pose.level(2.0, -1.0, _ALTITUDE), PEOPLE),
        "low UAV": (128, low, PEOPLE),
        "tilted camera": (128, camera_pose(tilted, Pose.level(-12.0, 0.0, _ALTITUDE)), PEOPLE),
        "finer image": (256, level, PEOPLE),
        _EMPTY: (128, level, PEOPLE + _ELSEWHERE),
    }
    with World(Scenario(uavs=(_UAV,)), FOREST, len(PEOPLE)) as world:
        renderer = Renderer(world)
        found = {}
        for name, (pixels, pose, people) in wanted.items():
            world.place_people(people, np.linspace(0.0, 5.0, len(people)))
            camera = Camera(math.radians(60), pixels)
            rendered = renderer.render(camera, pose)
            shown = len(np.unique(rendered.people[rendered.people >= 0]))
            found[name] = StagedFrame(Frame(0, 0.0, camera, pose, rendered.image), rendered, people, shown)
        return found


def check_detector(detector: str) -> list[Finding]:
    """Findings of all checks of a detector, which conforms if none has `passed` False.

    detector: a name or an import string. InputError if there is no such detector, or it cannot be made.
    """
    return try_checks(_Subject(partial(DETECTORS.make, detector, FOREST)), _CHECKS)


@dataclass
class _Subject:
    """A detector under test: how it is made, and what a new instance found in each staged frame."""

    make: Callable[[], Any]
    found: dict[str, Detections] = field(default_factory=dict)


def _detect(made: Any, name: str) -> Detections:  # noqa: ANN401 - a plug-in
    """What a detector finds in the staged frame of that name; `Unfit` if that cannot be used."""
    staged = stage_frames()[name]
    with judge_plugin(made, "detect"):
        frame = deepcopy(staged.frame)
        if isinstance(made, MaskDetector):
            return made.detect(frame, staged.rendered.people)
        return check_detections(made.detect(frame))


def _check_detections(subject: _Subject) -> str:
    for name in stage_frames():
        try:
            subject.found[name] = _detect(subject.make(), name)
        except Unfit as error:
            raise error if name == _ORDINARY else Unfit(f"{name}: {error}") from error
    return f"usable in {len(subject.found)} frames"


def _check_people(subject: _Subject) -> str:
    staged, found = stage_frames()[_ORDINARY], subject.found[_ORDINARY]
    hits = int(np.sum(staged.match(found) >= 0))
    wrong = len(found.ground) - hits
    seen = f"{hits} of {staged.shown} in plain view, {wrong} false detection{'s' * (wrong != 1)}"
    require(2 * hits >= staged.shown >= wrong, seen)
    return seen


def _check_other_views(subject: _Subject) -> str:
    views = [view for view in stage_frames().items() if view[0] not in (_ORDINARY, _EMPTY)]
    hits = [(name, np.sum(view.match(subject.found[name]) >= 0), view.shown) for name, view in views]
    return ", ".join(f"{name} {count} of {shown}" for name, count, shown in hits)


def _check_empty(subject: _Subject) -> str:
    wrong = len(subject.found[_EMPTY].ground)
    require(wrong <= len(PEOPLE), f"{wrong} detections where no person is")
    return f"{wrong} detections"


def _check_covariances(subject: _Subject) -> str:
    """Judge the mean NEES over all frames, as that of six people says little."""
    squares: list[float] = []
    for name, staged in stage_frames().items():
        found, of_people = subject.found[name], staged.match(subject.found[name])
        hit = of_people >= 0
        errors = found.ground[of_people[hit]] - staged.people[hit]
        squares += squared_distance(errors, found.covariances[of_people[hit]]).tolist()
    if not squares:
        raise Untried("it finds no person")
    return check_nees(mean(squares))


def _check_repeatable(subject: _Subject) -> str:
    first, again = subject.found[_ORDINARY], subject.make()
    changed = find_change(first, _detect(again, _ORDINARY), "detections")
    require(not changed, "another instance finds otherwise in the same frame")
    _detect(again, "tilted camera")
    changed = find_change(first, _detect(again, _ORDINARY), "detections")
    require(not changed, "after another frame it finds otherwise in the first")
    return "equal bit for bit, on another instance and after another frame"


def _check_time(subject: _Subject) -> str:
    made = subject.make()
    took = time_calls(partial(_detect, made, _ORDINARY) for _ in range(6))
    return describe_time(took, "a frame of 128 x 128 pixels")


_CHECKS: dict[str, Callable[[_Subject], str]] = {
    "detections": _check_detections,
    "people": _check_people,
    "other views": _check_other_views,
    _EMPTY: _check_empty,
    "covariances": _check_covariances,
    "same frame, same result": _check_repeatable,
    "time": _check_time,
}
