"""Sensor mode on pixels: frames are rendered, and a detector finds people in them."""

import math
from copy import deepcopy

import numpy as np

from sim.scenario.perception import DETECTORS
from sim.sensing.detection_truth import MaskDetector, matched_people, visible_pixels
from sim.sensing.fault import Fault
from sim.sensing.renderer import Rendered, Renderer
from sim.sensing.sensor_mode import SensorOutput, SensorSetup
from tracking.detection.detector import Detections, Frame
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.plugins.containment import ForeignError, Unusable, contained, numbers
from tracking.plugins.results import check_positive_definite, checked_array

_SHAPES = {"pixels": (2,), "ground": (2,), "covariances": (2, 2)}  # of one detection
_FARTHEST = 1e6  # m or pixels: farther ones mean nothing
_MOST = 200  # detections of a plug-in in one frame: trackers take seconds over so many


def usable_detections(found: Detections) -> Detections:
    """Detections that trackers can use, as arrays of floats; `Unusable` says what is wrong with them."""
    arrays = {name: numbers(name, getattr(found, name), _MOST * math.prod(each)) for name, each in _SHAPES.items()}
    if not any(array.size for array in arrays.values()):
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    count = len(arrays["ground"]) if arrays["ground"].ndim else 0
    usable = {name: checked_array(name, array, (count, *_SHAPES[name])) for name, array in arrays.items()}
    for name, unit in (("ground", "m"), ("pixels", "pixels")):
        if np.abs(usable[name]).max(initial=0.0) > _FARTHEST:
            raise Unusable(f"{name} more than {_FARTHEST:g} {unit} away")
    check_positive_definite("covariances", usable["covariances"], " m²")
    return Detections(**usable)


class RenderedMode:
    """Detections from rendered frames, with the detector's own covariances if `sensing.noise` is the camera's."""

    def __init__(self, setup: SensorSetup) -> None:
        self._setup = setup
        self._renderer = Renderer(setup.world)
        sensing = setup.scenario.sensing
        # Note: [Li22]'s noise is added to what a camera measures without a map.
        self._calibrated = sensing.noise == "camera"
        self._detector = DETECTORS.make(sensing.detector, Forest(setup.forest.trees) if self._calibrated else None)

    def sense(self, uav: int, time: float, pose: Pose, people: Array) -> SensorOutput:
        """As `SensorMode.sense`."""
        camera, clock = self._setup.cameras[uav], self._setup.clock
        with clock.measure("rendering"):
            rendered = self._renderer.take(uav, time, camera, pose)
        with clock.measure("detection"):
            frame = Frame(uav, time, camera, pose, rendered.image)
            found, faults = self._detected(frame, rendered)
        return SensorOutput(
            ground=found.ground,
            matched=lambda kept: matched_people(found.pixels[kept], rendered.people, len(people)),
            visible=visible_pixels(rendered.people, len(people)),
            covariances=found.covariances if self._calibrated else None,
            frame=frame,
            pixels=found.pixels,
            faults=faults,
        )

    def _detected(self, frame: Frame, rendered: Rendered) -> tuple[Detections, tuple[Fault, ...]]:
        """Detections, and faults of the detector; after a fault there are no detections."""
        if isinstance(self._detector, MaskDetector):
            return self._detector.detect(frame, rendered.people), ()
        try:
            with contained():
                # A copy, so that a plug-in cannot change scans, recordings and videos.
                return usable_detections(self._detector.detect(deepcopy(frame))), ()
        except ForeignError as error:
            nothing = Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
            return nothing, (Fault(frame.time, frame.uav, f"detector: {error}", error.trace),)
