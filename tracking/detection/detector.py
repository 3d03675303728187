"""The interface of detectors: a camera's frame in, detections of people on the ground out."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracking.geometry.camera import Camera, Pose
from tracking.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class Frame:
    """Image of one camera at one instant."""

    uav: int
    time: float  # s
    camera: Camera
    pose: Pose  # of the camera
    image: NDArray[np.uint8]  # (H, W, 3) RGB


@dataclass(frozen=True, eq=False)
class Detections:
    """People found in one frame, from the image's top to its bottom."""

    pixels: Array  # (N, 2) of each person's mid-height in the image, as if the whole person were seen
    ground: Array  # (N, 2) m
    covariances: Array  # (N, 2, 2) m², of `ground`


class Detector(Protocol):
    """Detector of people in frames; a scenario names it as "package.module:Class", which takes no arguments.

    One instance serves all cameras, and keeps no state between frames. A detector with a memory, such as a background,
    declares `stateful = True` and has a method `reset(seed)` that clears it: then each UAV's camera has an instance of
    its own, which gets that camera's frames in order of time. It is reset once, before the first frame; after a reset
    with the same seed the same frames give the same detections.

    Example:
        ```python
        import numpy as np
        from understory import Detections

        class Reddest:
            def detect(self, frame):
                red = 2.0 * frame.image[..., 0] - frame.image[..., 1] - frame.image[..., 2]
                row, column = np.unravel_index(np.argmax(red), red.shape)
                pixels = np.array([[column + 0.5, row + 0.5]])
                return Detections(pixels, frame.camera.ground_points(frame.pose, pixels, 0.85), 0.1 * np.eye(2)[None])
        ```
    """

    def detect(self, frame: Frame) -> Detections:
        """Detect the people in one frame, from the image's top to its bottom."""
