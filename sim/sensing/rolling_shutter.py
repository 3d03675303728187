"""Rolling shutter: the rows of an image are exposed one after another, while camera and people move."""

import math
from dataclasses import dataclass

import numpy as np

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.quaternions import mean_spin, rotate
from tracking.numerics.arrays import Array

_STRIP = 1.0  # pixel, motion of the image in one strip of equally old rows
_WALKED = 0.25  # pixel, motion of people on the ground meanwhile: the strips of a hovering camera
_LEAST_ROWS = 4  # of a strip


@dataclass(frozen=True, eq=False)
class Sweep:
    """Motion while an image is read out; its middle row is exposed at the time of the frame.

    Note: velocities are the means since the camera's last frame; without one there is no motion.
    """

    readout: float  # s, from the first row to the last
    velocity: Array  # (3,) m/s, of the camera
    spin: Array  # (3,) rad/s, of the camera, in the world frame
    people: Array  # (M, 2) m/s

    @staticmethod
    def between(poses: tuple[Pose, Pose], people: tuple[Array, Array], elapsed: float, readout: float) -> "Sweep":
        """The sweep of a frame, given camera and people (M, 2) m `elapsed` s before it and at its time."""
        (before, now), (there, here) = poses, people
        return Sweep(
            readout,
            (now.position - before.position) / elapsed,
            mean_spin(before.quaternion, now.quaternion, elapsed),
            np.nan_to_num((here - there) / elapsed),
        )

    def delays(self, rows: Array, height: int) -> Array:
        """Times (N,) s, relative to that of the frame, of rows at v (N,) pixels in an image of this height."""
        return np.asarray((rows / height - 0.5) * self.readout)

    def pose_at(self, pose: Pose, delay: float) -> Pose:
        """The pose of the camera `delay` s after the frame's time."""
        turned = rotate(pose.quaternion, self.spin, delay) if self.spin.any() else pose.quaternion
        return Pose(pose.position + delay * self.velocity, turned)

    def edges(self, camera: Camera, height: float) -> list[int]:
        """Rows at which strips of an image begin, and its end; `height` of the camera above ground [m]."""
        rows = camera.size[1]
        speed = math.sqrt(float(np.sum(np.square(self.velocity)))) / max(height, 1.0)
        walking = math.sqrt(float(np.sum(np.square(self.people), axis=1).max(initial=0.0))) / max(height, 1.0)
        moved = camera.focal * self.readout * (speed + math.sqrt(float(np.sum(np.square(self.spin)))))
        walked = camera.focal * self.readout * walking
        strips = min(max(math.ceil(moved / _STRIP), math.ceil(walked / _WALKED), 1), rows // _LEAST_ROWS)
        return [rows * k // strips for k in range(strips + 1)]

    def corrections(self, camera: Camera, pose: Pose, pixels: Array) -> Array:
        """What to add (N, 2) m to ground points of pixels (N, 2) that were found as if all rows were of one time."""
        delays = self.delays(pixels[:, 1], camera.size[1]).tolist()
        moved = [
            camera.ground_points(self.pose_at(pose, delay), pixel, TARGET_HEIGHT)[0]
            for delay, pixel in zip(delays, pixels, strict=True)
        ]
        apart = np.array(moved).reshape(-1, 2) - camera.ground_points(pose, pixels, TARGET_HEIGHT)
        return np.nan_to_num(apart)
