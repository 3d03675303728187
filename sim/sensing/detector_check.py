"""Conformance of a detector to `tracking.detection.detector.Detector`, checked on rendered frames."""

import timeit
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.scenario.scenario import Scenario
from sim.scenario.sensing import DETECTORS
from sim.scenario.uavs import Uav
from sim.sensing.detection_truth import MaskDetector, match_detections
from sim.sensing.renderer import Renderer
from sim.sensing.sensor_output_check import check_detections
from sim.world.world import World
from tracking.detection.detector import Detections, Frame
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.distances import squared_distance
from tracking.plugins.findings import Finding, check_nees, describe_time, find_change, require, try_checks
from tracking.plugins.plugin_error import PluginError, plugin_call
from tracking.testing.stage import EMPTY, FOREST, HEADINGS, ORDINARY, PEOPLE, TILTED, VIEWS

_UAV = Uav(start=(74.0, 49.0))
_RGB, _BGR = slice(None), slice(None, None, -1)
_SEED = 5  # with which stateful detectors are reset
_BEFORE = tuple(k / 5 for k in range(-25, 0))  # s, times of the frames that a stateful detector gets first


@dataclass(frozen=True, eq=False)
class StagedFrame:
    """A frame with the renderer's mask of people, as in `Rendered`, and their positions (M, 2) m."""

    frame: Frame
    mask: NDArray[np.int32]
    people: Array

    def match(self, found: Detections) -> Indices:
        """Index (M,) of each person's detection, -1 for none."""
        return match_detections(found.pixels, self.mask, len(self.people))


@cache
def stage_frames(times: Sequence[float] = (0.0,)) -> dict[str, list[StagedFrame]]:
    """Staged frames by name, one for each of the times [s], rendered once.

    At time 0 all people are in plain view, or none; they arrive there at a walk.
    """
    with World(Scenario(uavs=(_UAV,)), FOREST, len(PEOPLE)) as world:
        renderer, staged = Renderer(world), dict[str, list[StagedFrame]]()
        for name, view in VIEWS.items():
            staged[name] = []
            for time in times:
                people = view.place_people(time)
                world.place_people(people, HEADINGS)
                rendered = renderer.render(view.camera, view.pose)
                frame = Frame(0, time, view.camera, view.pose, rendered.image, FOREST)
                staged[name].append(StagedFrame(frame, rendered.people, people))
        return staged


def check_detector(detector: str) -> list[Finding]:
    """Findings of all checks of a detector, which conforms if none has `passed` False.

    detector: a name or an import string. InputError if there is no such detector, or it cannot be made.
    """
    subject = _Subject(detector)
    subject.make()
    return try_checks(subject, _CHECKS)


@dataclass
class _Subject:
    """A detector under test, by name or import string, and what new instances found in each staged frame."""

    name: str
    found: dict[str, Detections] = field(default_factory=dict)
    writes: bool = False  # into the images of frames

    def make(self) -> Any:  # noqa: ANN401 - a plug-in
        """A new instance, reset if it is stateful."""
        made = DETECTORS.make(self.name)
        DETECTORS.reset(self.name, made, _SEED)
        return made

    def count_hits(self, frame: str) -> int:
        """Number of people that are found in a staged frame."""
        return int(np.sum(stage_frames()[frame][0].match(self.found[frame]) >= 0))

    def look(self, made: Any, name: str, colours: slice = _RGB) -> Detections:  # noqa: ANN401 - a plug-in
        """What an instance finds in the staged frame of that name, if it is stateful after the frames before."""
        if DETECTORS.is_stateful(self.name, made):
            for staged in stage_frames(_BEFORE)[name]:
                self._detect(made, staged, colours)
        return self._detect(made, stage_frames()[name][0], colours)

    def _detect(self, made: Any, staged: StagedFrame, colours: slice) -> Detections:  # noqa: ANN401 - a plug-in
        """What a detector finds in a staged frame; PluginError if that cannot be used."""
        image = staged.frame.image[..., colours]
        frame = replace(staged.frame, image=image.copy())
        with plugin_call(made, "detect"):
            if isinstance(made, MaskDetector):
                return made.detect(frame, staged.mask)
            found = check_detections(made.detect(frame))
        self.writes |= not np.array_equal(frame.image, image)
        return found


def _check_detections(subject: _Subject) -> str:
    for name in stage_frames():
        try:
            subject.found[name] = subject.look(subject.make(), name)
        except PluginError as error:
            raise PluginError(f"{name}: {error}", error.trace) from error
    writes = "; it writes into frame.image: give it a copy of an image that you keep" if subject.writes else ""
    return f"usable in {len(subject.found)} frames{writes}"


def _check_people(subject: _Subject) -> str:
    hits = subject.count_hits(ORDINARY)
    wrong = len(subject.found[ORDINARY].ground) - hits
    seen = f"{hits} of {len(PEOPLE)} in plain view, {wrong} false detection{'s' * (wrong != 1)}"
    if 2 * hits < len(PEOPLE):
        exchanged = stage_frames()[ORDINARY][0].match(subject.look(subject.make(), ORDINARY, _BGR))
        count = np.sum(exchanged >= 0)
        seen += f"; {count} with red and blue exchanged: images are RGB, not BGR as OpenCV's" if count > hits else ""
    require(2 * hits >= len(PEOPLE) >= wrong, seen)
    return seen


def _check_other_views(subject: _Subject) -> str:
    views = [name for name in stage_frames() if name not in (ORDINARY, EMPTY)]
    return ", ".join(f"{name} {subject.count_hits(name)} of {len(PEOPLE)}" for name in views)


def _check_empty(subject: _Subject) -> str:
    wrong = len(subject.found[EMPTY].ground)
    require(wrong <= len(PEOPLE), f"{wrong} detections where no person is")
    return f"{wrong} detections"


def _check_covariances(subject: _Subject) -> str:
    """Judge the mean NEES over all frames, as that of six people says little."""
    squares: list[float] = []
    for name, (staged,) in stage_frames().items():
        found, of_people = subject.found[name], staged.match(subject.found[name])
        hit = of_people >= 0
        errors = found.ground[of_people[hit]] - staged.people[hit]
        squares += squared_distance(errors, found.covariances[of_people[hit]]).tolist()
    return check_nees(squares)


def _check_repeatable(subject: _Subject) -> str:
    first, again = subject.found[ORDINARY], subject.make()
    differs = find_change(first, subject.look(again, ORDINARY), "")
    require(not differs, "another instance finds otherwise in the same frame")
    subject.look(again, TILTED)
    if DETECTORS.is_stateful(subject.name, again):
        DETECTORS.reset(subject.name, again, _SEED)
        differs = find_change(first, subject.look(again, ORDINARY), "")
        require(not differs, "after reset(seed) with the same seed it finds otherwise in the same frames")
        return "stateful: equal bit for bit on another instance, and after reset(seed)"
    differs = find_change(first, subject.look(again, ORDINARY), "")
    require(not differs, "without stateful = True, but after another frame it finds otherwise in the first")
    return "equal bit for bit, on another instance and after another frame"


def _check_time(subject: _Subject) -> str:
    seconds = timeit.repeat(partial(subject.look, subject.make(), ORDINARY), repeat=6, number=1)
    return describe_time(seconds[1:], "a frame of 128 x 128 pixels")  # the first may prepare something


_CHECKS = {
    "detections": _check_detections,
    "people": _check_people,
    "other views": _check_other_views,
    EMPTY: _check_empty,
    "covariances": _check_covariances,
    "same frame, same result": _check_repeatable,
    "time": _check_time,
}
