"""Sensor mode with images: a detector finds people in the frames of shots."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.scenario.sensing import make_detectors
from sim.sensing.detection_truth import MaskDetector, count_visible_pixels, find_owners
from sim.sensing.sensor_mode import SensorOutput, SensorSetup, Shot
from sim.sensing.sensor_output_check import check_detections
from tracking.detection.detector import Detections, Frame
from tracking.geometry.camera import Pose
from tracking.plugins.plugin_error import PluginError, plugin_call


class RenderedMode:
    """Detections from rendered frames; if a person is only partly visible, the detector locates them with the map.

    Note: with `sensing.noise` "range_bearing" a sample of [Li22] eq. (4) is added to the detections, and its covariance
    to the detector's own. The detector is more precise than that noise, except at the edge of a canopy.
    """

    def __init__(self, setup: SensorSetup) -> None:
        self._setup = setup
        self._detectors = make_detectors(setup.scenario.sensing.detector, range(len(setup.cameras)), setup.rng)

    def sense(self, shot: Shot) -> SensorOutput:
        """As `SensorMode.sense`."""
        assert shot.rendered
        camera, mask, count = self._setup.cameras[shot.uav], shot.rendered.people, len(shot.people)
        frame = shot.frame(camera)
        found, errors = self._detect(frame, mask)
        if shot.believed_sweep:
            moved = shot.believed_sweep.corrections(camera, frame.pose, found.pixels)
            found = replace(found, ground=found.ground + moved)
        return SensorOutput(
            ground=found.ground,
            owners=find_owners(found.pixels, mask, count),
            visible=count_visible_pixels(mask, count),
            covariances=found.covariances,
            noise="none" if self._setup.scenario.sensing.noise == "camera" else "added",
            frame=frame,
            pixels=found.pixels,
            errors=errors,
        )

    def _detect(self, frame: Frame, mask: NDArray[np.int32]) -> tuple[Detections, tuple[PluginError, ...]]:
        """Detections and the errors of the detector; a frame with an error has no detections."""
        detector = self._detectors[frame.uav]
        if isinstance(detector, MaskDetector):
            return detector.detect(frame, mask), ()
        try:
            with plugin_call(detector, "detect"):
                return check_detections(detector.detect(_copy(frame))), ()
        except PluginError as error:
            return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2))), (error,)


def _copy(frame: Frame) -> Frame:
    """A copy for a plug-in, which then cannot change scans, recordings and videos; in a tenth of `deepcopy`'s time."""
    pose = Pose(frame.pose.position.copy(), frame.pose.quaternion.copy())
    return replace(frame, pose=pose, image=frame.image.copy())
