"""Sensor mode with images: frames are rendered, and a detector finds people in them."""

from copy import deepcopy
from dataclasses import replace

import numpy as np

from sim.scenario.sensing import make_detectors
from sim.sensing.detection_truth import MaskDetector, count_visible_pixels, match_detections
from sim.sensing.fault import Fault
from sim.sensing.renderer import Rendered, Renderer
from sim.sensing.rolling_shutter import Glimpse, Sweep
from sim.sensing.sensor_mode import SensorOutput, SensorSetup
from sim.sensing.sensor_output_check import check_detections
from tracking.detection.detector import Detections, Frame
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.plugins.plugin_error import PluginError, plugin_call


class RenderedMode:
    """Detections from rendered frames; if a person is only partly visible, the detector locates them with the map.

    Note: with `sensing.noise` "range_bearing" a sample of [Li22] eq. (4) is added to the detections, and its covariance
    to the detector's own. The detector is more precise than that noise, except at the edge of a canopy.
    """

    def __init__(self, setup: SensorSetup) -> None:
        self._setup = setup
        self._renderer = Renderer(setup.world)
        sensing = setup.scenario.sensing
        self._cameras = [uav.true_camera for uav in setup.scenario.uavs]
        self._last: dict[tuple[int, bool], Glimpse] = {}  # of each camera, true and believed
        self._calibrated = sensing.noise == "camera"
        forest, uavs = Forest(setup.forest.trees), range(len(setup.cameras))
        self._detectors = make_detectors(sensing.detector, forest, uavs, setup.rng)

    def sense(self, uav: int, time: float, pose: Pose, people: Array) -> SensorOutput:
        """As `SensorMode.sense`."""
        camera, clock = self._setup.cameras[uav], self._setup.clock
        with clock.measure("rendering"):
            sweep = self._find_sweep(uav, Glimpse(time, pose, people), believed=False)
            rendered = self._renderer.take(uav, time, self._cameras[uav], pose, sweep)
        with clock.measure("detection"):
            frame = Frame(uav, time, camera, self._setup.believed.get(uav, pose), rendered.image)
            found, faults = self._detect(frame, rendered)
            # What the UAV believes holds its own motion, and nothing of people.
            if believed := self._find_sweep(uav, Glimpse(time, frame.pose, people[:0]), believed=True):
                found = replace(found, ground=found.ground + believed.corrections(camera, frame.pose, found.pixels))
        return SensorOutput(
            ground=found.ground,
            matched=lambda kept: match_detections(found.pixels[kept], rendered.people, len(people)) >= 0,
            visible=count_visible_pixels(rendered.people, len(people)),
            covariances=found.covariances if self._calibrated else None,
            errors=found.covariances,
            frame=frame,
            pixels=found.pixels,
            faults=faults,
            located_by_belief=True,
        )

    def _find_sweep(self, uav: int, now: Glimpse, *, believed: bool) -> Sweep | None:
        before, self._last[uav, believed] = self._last.get((uav, believed)), now
        return Sweep.between(before, now, self._setup.scenario.uavs[uav].readout)

    def _detect(self, frame: Frame, rendered: Rendered) -> tuple[Detections, tuple[Fault, ...]]:
        """Detections and the faults of the detector; a frame with a fault has no detections."""
        detector = self._detectors[frame.uav]
        if isinstance(detector, MaskDetector):
            return detector.detect(frame, rendered.people), ()
        try:
            with plugin_call(detector, "detect"):
                # A plug-in gets a copy, so that it cannot change scans, recordings and videos.
                return check_detections(detector.detect(deepcopy(frame))), ()
        except PluginError as error:
            nothing = Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
            return nothing, (Fault(frame.time, frame.uav, f"detector: {error}", error.trace),)
