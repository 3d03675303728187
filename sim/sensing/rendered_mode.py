"""Sensor mode with images: frames are rendered, and a detector finds people in them."""

from copy import deepcopy
from dataclasses import replace

import numpy as np

from sim.scenario.sensing import make_detectors
from sim.sensing.detection_truth import MaskDetector, count_visible_pixels, find_owners
from sim.sensing.fault import DETECTOR, Fault
from sim.sensing.renderer import Rendered, Renderer
from sim.sensing.sensor_mode import SensorOutput, SensorSetup, Shot
from sim.sensing.sensor_output_check import check_detections
from tracking.detection.detector import Detections, Frame
from tracking.geometry.visibility import Forest
from tracking.plugins.plugin_error import PluginError, plugin_call


class RenderedMode:
    """Detections from rendered frames; if a person is only partly visible, the detector locates them with the map.

    Note: with `sensing.noise` "range_bearing" a sample of [Li22] eq. (4) is added to the detections, and its covariance
    to the detector's own. The detector is more precise than that noise, except at the edge of a canopy.
    """

    def __init__(self, setup: SensorSetup) -> None:
        self._setup = setup
        self._renderer = Renderer(setup.world)
        self._cameras = [uav.true_camera for uav in setup.scenario.uavs]
        forest, uavs = Forest(setup.forest.trees), range(len(setup.cameras))
        self._detectors = make_detectors(setup.scenario.sensing.detector, forest, uavs, setup.rng)

    def sense(self, shot: Shot) -> SensorOutput:
        """As `SensorMode.sense`."""
        setup = self._setup
        camera = setup.cameras[shot.uav]
        with setup.clock.measure("rendering"):
            rendered = self._renderer.take(shot.uav, shot.time, self._cameras[shot.uav], shot.true, shot.sweep)
        with setup.clock.measure("detection"):
            frame = Frame(shot.uav, shot.time, camera, shot.pose, rendered.image)
            found, faults = self._detect(frame, rendered)
            if shot.believed_sweep:
                moved = shot.believed_sweep.corrections(camera, frame.pose, found.pixels)
                found = replace(found, ground=found.ground + moved)
            count = len(shot.people)
            return SensorOutput(
                ground=found.ground,
                owners=find_owners(found.pixels, rendered.people, count),
                visible=count_visible_pixels(rendered.people, count),
                covariances=found.covariances,
                noise="none" if setup.scenario.sensing.noise == "camera" else "added",
                frame=frame,
                pixels=found.pixels,
                faults=faults,
            )

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
            return nothing, (Fault(frame.time, frame.uav, f"{DETECTOR}{error}", error.trace),)
