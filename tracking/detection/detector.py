"""The interface of detectors: a camera's frame in, detections of people on the ground out."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class Frame:
    """Image of one camera at one instant.

    Attributes:
        uav: number of the UAV whose camera took it.
        time: time [s] since the start.
        camera: the camera, as its UAV believes it to be.
        pose: pose of the camera, as its UAV believes it.
        image: (H, W, 3) RGB, 0 to 255, rows from the top.
        forest: the trees, as its UAV believes at this time; None if it has no map.
    """

    uav: int
    time: float
    camera: Camera
    pose: Pose
    image: NDArray[np.uint8]
    forest: Forest | None = None


@dataclass(frozen=True, eq=False)
class Detections:
    """People found in one frame, from the image's top to its bottom.

    Attributes:
        pixels: (N, 2) u, v of each person's mid-height in the image, as if the whole person were seen.
        ground: (N, 2) m: east and north.
        covariances: (N, 2, 2) m², of the errors of `ground`.
    """

    pixels: Array
    ground: Array
    covariances: Array


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
