"""Conformance of a detector to `tracking.detection.detector.Detector`, checked on rendered frames."""

import math
import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import cache, partial
from statistics import median

import numpy as np
from numpy.typing import NDArray

from sim.scenario.fleet import Uav
from sim.scenario.perception import DETECTORS
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import camera_pose
from sim.sensing.detection_check import usable_detections
from sim.sensing.detection_truth import MaskDetector, matched_detections
from sim.sensing.renderer import Rendered, Renderer
from sim.world.world import World
from tracking.detection.detector import Detections, Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array
from tracking.numerics.distances import squared_distance
from tracking.plugins.findings import Finding, Unfit, Untried, finding
from tracking.plugins.plugin_error import PluginError, plugin_call

FOREST = Forest((Tree(-9.0, 8.0), Tree(9.0, 9.0), Tree(10.0, -2.0)))
PEOPLE = np.array([(0.0, 0.0), (5.0, 4.0), (-7.0, 2.0), (4.0, -8.0), (-5.0, -7.0), (0.5, 9.0)])
_ELSEWHERE = np.array([60.0, 40.0])  # m, a place that no camera here sees
_UAV = Uav(start=(74.0, 49.0))
_ALTITUDE = 25.0  # m


@dataclass(frozen=True, eq=False)
class StagedFrame:
    """A frame, the renderer's output for it, and the positions of the people (M, 2) m."""

    frame: Frame
    rendered: Rendered
    people: Array


@cache
def views() -> dict[str, StagedFrame]:
    """Staged frames by name; the first is the ordinary one."""
    tilted = Uav(start=(0.0, 0.0), tilt_deg=30.0)
    low, level = Pose.level(0.0, 0.0, 15.0), Pose.level(0.0, 0.0, _ALTITUDE)
    wanted = {
        "ordinary": (128, level, PEOPLE),
        "turned and moved": (128, Pose.level(2.0, -1.0, _ALTITUDE), PEOPLE),
        "low UAV": (128, low, PEOPLE),
        "tilted camera": (128, camera_pose(tilted, Pose.level(-12.0, 0.0, _ALTITUDE)), PEOPLE),
        "finer image": (256, level, PEOPLE),
        "no person in view": (128, level, PEOPLE + _ELSEWHERE),
    }
    with World(Scenario(uavs=(_UAV,)), FOREST, len(PEOPLE)) as world:
        renderer = Renderer(world)
        found = {}
        for name, (pixels, pose, people) in wanted.items():
            world.place_people(people, np.linspace(0.0, 5.0, len(people)))
            camera = Camera(math.radians(60), pixels)
            rendered = renderer.render(camera, pose)
            found[name] = StagedFrame(Frame(0, 0.0, camera, pose, rendered.image), rendered, people)
        return found


_FRAMES = 5  # number of timed frames
_SCAN = 0.2  # s, between scans of the default scenario
_MOST_NEES = 20.0  # largest mean NEES with two degrees of freedom: standard deviations of a third of the error
_SPECIAL = ("turned and moved", "low UAV", "tilted camera", "finer image")


def check(detector: str) -> list[Finding]:
    """Findings of all checks of a detector, which conforms if none has `passed` False.

    detector: a name or an import string. InputError if there is no such detector, or it cannot be made.
    """
    subject = _Subject(detector)
    return [finding(name, partial(ask, subject)) for name, ask in _CHECKS.items()]


class _Subject:
    """A detector under test, which can be made again, and its detections in the ordinary frame."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.first: Detections | Unfit
        try:
            self.first = self.detect(views()["ordinary"])
        except Unfit as error:
            self.first = error

    def make(self) -> Callable[[StagedFrame], Detections]:
        made = DETECTORS.make(self._name, FOREST)

        def detect(view: StagedFrame) -> Detections:
            try:
                with plugin_call(made, "detect"):
                    frame = deepcopy(view.frame)
                    if isinstance(made, MaskDetector):
                        return made.detect(frame, view.rendered.people)
                    return deepcopy(usable_detections(made.detect(frame)))
            except PluginError as error:
                raise Unfit(error.with_place) from error

        return detect

    def detect(self, view: StagedFrame) -> Detections:
        return self.make()(view)

    def found(self) -> Detections:
        if isinstance(self.first, Unfit):
            raise Untried("it does not detect")
        return self.first


def _detections(subject: _Subject) -> str:
    if isinstance(subject.first, Unfit):
        raise subject.first
    return f"{len(subject.first.ground)} in a frame of {len(views()['ordinary'].people)} people"


def _matched(view: StagedFrame, found: Detections) -> tuple[NDArray[np.int64], int]:
    """Index (M,) of each person's detection, -1 for none, and the number of people that the frame shows."""
    of_people = matched_detections(found.pixels, view.rendered.people, len(view.people))
    shown = view.rendered.people
    return of_people, len(np.unique(shown[shown >= 0]))


def _people(subject: _Subject) -> str:
    of_people, shown = _matched(views()["ordinary"], subject.found())
    hits = int(np.sum(of_people >= 0))
    wrong = len(subject.found().ground) - hits
    seen = f"{hits} of {shown} in plain view, {wrong} false detection{'s' * (wrong != 1)}"
    if 2 * hits < shown or wrong > shown:
        raise Unfit(seen)
    return seen


def _covariances(subject: _Subject) -> str:
    found, view = subject.found(), views()["ordinary"]
    of_people, _ = _matched(view, found)
    hit = of_people >= 0
    if not hit.any():
        raise Untried("it finds no person")
    errors = found.ground[of_people[hit]] - view.people[hit]
    squares = squared_distance(errors, found.covariances[of_people[hit]])
    seen = f"mean NEES {np.mean(squares):.3g} (consistent: 2), errors up to {np.hypot(*errors.T).max():.2f} m"
    if np.mean(squares) > _MOST_NEES:
        raise Unfit(f"{seen}: covariances are far too small")
    return seen


def _repeatable(subject: _Subject) -> str:
    if not _equal(subject.found(), subject.detect(views()["ordinary"])):
        raise Unfit("another instance finds otherwise in the same frame")
    return "equal bit for bit, on another instance"


def _memory(subject: _Subject) -> str:
    subject.found()
    detect, ordinary = subject.make(), views()["ordinary"]
    before = detect(ordinary)
    detect(views()["tilted camera"])
    if not _equal(before, detect(ordinary)):
        raise Unfit("after another frame it finds otherwise in the first")
    return "a frame, another one, the first again: equal"


def _equal(one: Detections, other: Detections) -> bool:
    names = ("pixels", "ground", "covariances")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def _special(name: str, subject: _Subject) -> str:
    subject.found()
    of_people, shown = _matched(views()[name], subject.detect(views()[name]))
    return f"{np.sum(of_people >= 0)} of {shown} people found"


def _empty(subject: _Subject) -> str:
    subject.found()
    wrong = len(subject.detect(views()["no person in view"]).ground)
    if wrong > len(views()["ordinary"].people):
        raise Unfit(f"{wrong} detections where no person is")
    return f"{wrong} detections"


def _time(subject: _Subject) -> str:
    subject.found()
    detect, took = subject.make(), []
    detect(views()["ordinary"])
    for _ in range(_FRAMES):
        start = time.perf_counter()
        detect(views()["ordinary"])
        took.append(time.perf_counter() - start)
    late = "; longer than a scan" if median(took) > _SCAN else ""
    return f"{1e3 * median(took):.3g} ms a frame of 128 x 128 pixels, at most {1e3 * max(took):.3g} ms{late}"


_CHECKS: dict[str, Callable[[_Subject], str]] = {
    "detections": _detections,
    "people": _people,
    "covariances": _covariances,
    "same frame, same result": _repeatable,
    "no memory": _memory,
    **{name: partial(_special, name) for name in _SPECIAL},
    "no person in view": _empty,
    "time": _time,
}
