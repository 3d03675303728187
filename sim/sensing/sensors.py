"""From the world to scans: cameras, images, detections and measurement noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.scenario.scenario import Scenario
from sim.sensing.cameras import noise_of, view_of
from sim.sensing.clutter import Clutter
from sim.sensing.detection_check import usable_detections
from sim.sensing.detection_truth import matched_people, visible_pixels
from sim.sensing.detectors import load_detector
from sim.sensing.fault import Fault
from sim.sensing.mask_detector import MaskDetector
from sim.sensing.renderer import Rendered, Renderer
from sim.sensing.stopwatch import Stopwatch
from sim.world.world import World
from tracking.detection.detector import Detections, Frame
from tracking.detection.ground_measurement import whole_covariances
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.numerics.arrays import Array
from tracking.numerics.factorisation import cholesky
from tracking.numerics.matrices import applied
from tracking.numerics.normal import standard_normal
from tracking.plugins.containment import ForeignError, contained
from tracking.tracker import Scan


@dataclass(frozen=True, eq=False)
class Observation:
    """Observation of one UAV: its scan, and ground truth that only recordings and metrics may know."""

    scan: Scan
    pixels: Array  # (N, 2) detections in the image
    image: NDArray[np.uint8] | None  # (P, P, 3) RGB; None in ideal sensing
    visible: NDArray[np.int64]  # (M,) pixels the renderer shows of each person; in ideal sensing 1 for seen
    matched: NDArray[np.bool_]  # (M,) people detected
    taken: bool = True  # False without a frame; the scan is then empty and no negative information
    faults: tuple[Fault, ...] = ()  # of the detector


class Sensors:
    """The cameras of a fleet in one world."""

    def __init__(
        self, scenario: Scenario, world: World, forest: Forest, *, rng: np.random.Generator, clock: Stopwatch
    ) -> None:
        self._scenario = scenario
        self._forest = forest
        self._rng = rng
        self._clock = clock
        self._renderer = Renderer(world) if scenario.sensing.mode == "camera" else None
        self._clutter = Clutter(scenario.sensing, rng)
        # Note: [Li22]'s noise is added to what a camera measures without a map.
        calibrated = scenario.sensing.noise == "camera"
        self._detector = load_detector(scenario.sensing.detector, Forest(forest.trees) if calibrated else None)
        self.cameras = [view_of(uav, scenario) for uav in scenario.uavs]
        self.noises = [noise_of(uav, scenario) for uav in scenario.uavs]

    def look(self, uav: int, time: float, pose: Pose, people: Array) -> Observation:
        """Observation of one camera at `pose`; people (M, 2) m, NaN where absent, are those in the world now."""
        if self._renderer is None:
            return self._ideal(uav, time, pose, people)
        with self._clock.measure("rendering"):
            rendered = self._renderer.take(uav, time, self.cameras[uav], pose)
        with self._clock.measure("detection"):
            frame = Frame(uav, time, self.cameras[uav], pose, rendered.image)
            found, faults = self._detected(frame, rendered)
            if self._scenario.sensing.noise == "range_bearing":
                scan = self._sampled(uav, time, pose, found.ground)
            else:
                scan = Scan(uav, time, pose, found.ground, found.covariances)
            kept = self._clutter.kept(len(found.ground))
            scan, pixels = self._cluttered(scan, found.pixels, kept, frame)
        visible = visible_pixels(rendered.people, len(people))
        matched = matched_people(found.pixels[kept], rendered.people, len(people))
        return Observation(scan, pixels, rendered.image, visible, matched, faults=faults)

    def _detected(self, frame: Frame, rendered: Rendered) -> tuple[Detections, tuple[Fault, ...]]:
        """Detections, and faults of the detector; after a fault there are no detections."""
        if isinstance(self._detector, MaskDetector):
            return self._detector.detect(frame, rendered.people), ()
        try:
            with contained():
                # A copy, so that a plug-in cannot change scans, recordings and videos.
                pose = Pose(frame.pose.position.copy(), frame.pose.quaternion.copy())
                given = replace(frame, camera=replace(frame.camera), pose=pose, image=frame.image.copy())
                return usable_detections(self._detector.detect(given)), ()
        except ForeignError as error:
            nothing = Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
            return nothing, (Fault(frame.time, frame.uav, f"detector: {error}", error.trace),)

    @staticmethod
    def rest(uav: int, time: float, pose: Pose, people: Array) -> Observation:
        """Empty observation at a scan in which a slower camera takes no frame."""
        nothing = Scan(uav, time, pose, np.zeros((0, 2)), np.zeros((0, 2, 2)))
        unseen = np.zeros(len(people), dtype=np.int64)
        return Observation(nothing, np.zeros((0, 2)), None, unseen, unseen > 0, taken=False)

    def _ideal(self, uav: int, time: float, pose: Pose, people: Array) -> Observation:
        """The paper's Assumption 1: exactly the people in view and not hidden, with the sampled noise."""
        with self._clock.measure("detection"):
            points = np.column_stack([people, np.full(len(people), TARGET_HEIGHT)])
            present = ~np.isnan(people[:, 0])
            points[~present] = 0.0
            seen = present & self.cameras[uav].sees(pose, points) & self._forest.visible(pose.position, points)[0]
            scan = self._sampled(uav, time, pose, people[seen])
            kept = self._clutter.kept(len(scan.measurements))
            scan, _ = self._cluttered(scan, np.zeros((len(kept), 2)), kept, None)
        matched = seen.copy()
        matched[seen] = kept
        return Observation(scan, np.zeros((0, 2)), None, seen.astype(np.int64), matched)

    def _cluttered(self, scan: Scan, pixels: Array, kept: NDArray[np.bool_], frame: Frame | None) -> tuple[Scan, Array]:
        """The scan without missed detections and with false alarms, and its pixels (N, 2), in the same order.

        A false alarm has the covariance of a wholly visible person in the frame, or that of the noise model.
        """
        places, ground = self._clutter.false_alarms(self.cameras[scan.uav], scan.pose)
        if frame is None or self._scenario.sensing.noise == "range_bearing":
            alarms = self._covariances(scan.uav, scan.pose, ground)
        else:
            alarms = whole_covariances(frame, ground)
        order = self._clutter.order(int(kept.sum()), len(ground))
        z = np.vstack([scan.measurements[kept], ground])[order]
        R = np.concatenate([scan.covariances[kept], alarms])[order]
        return replace(scan, measurements=z, covariances=R), np.vstack([pixels[kept], places])[order]

    def _sampled(self, uav: int, time: float, pose: Pose, ground: Array) -> Scan:
        """Ground points (N, 2) m with a sample of the UAV's noise model added, and its covariances.

        The sample's covariance is that at the point itself; the scan's is that at the measurement, all that is known.
        """
        z = np.array(ground, dtype=float).reshape(-1, 2)
        if len(z):
            roots = cholesky(self._covariances(uav, pose, z))
            z = z + applied(roots, standard_normal(self._rng, z.shape))
        return Scan(uav, time, pose, z, self._covariances(uav, pose, z))

    def _covariances(self, uav: int, pose: Pose, points: Array) -> Array:
        """R (N, 2, 2) m² of the UAV's noise model at points (N, 2) m."""
        R = [self.noises[uav].covariance(pose.position[:2], point) for point in points]
        return np.array(R).reshape(-1, 2, 2)
