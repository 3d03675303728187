"""A detector of your own: one person for each connected spot of orange in the camera's image.

Prints what it finds in a mission, and draws one camera's frame with its detections into `found.png`.
"""

import cv2
import numpy as np

import understory


class Spots:
    """One person for each connected spot of orange, 0.85 m above ground as people's middles are."""

    def detect(self, frame):
        """Places (N, 2) m and covariances (N, 2, 2) m² of people in an image (P, P, 3)."""
        red, green, blue = (frame.image[..., k].astype(int) for k in range(3))
        orange = (red - green >= 30) & (2 * red > 3 * green) & (red > 2 * blue)
        _, _, _, centres = cv2.connectedComponentsWithStats(orange.astype(np.uint8))
        pixels = centres[1:] + 0.5  # the first component is all that is not orange
        ground = frame.camera.ground_points(frame.pose, pixels, 0.85)
        return understory.Detections(pixels, ground, np.tile(0.005 * np.eye(2), (len(pixels), 1, 1)))


if __name__ == "__main__":
    settings = {"duration": 4, "sensing.detector": "own_detector:Spots"}
    flight = understory.run("forest", "greedy", seed=3, settings=settings)
    sightings = flight.columns("sightings")
    shown = sightings["visible_px"] > 0
    print(f"{sightings['detected'][shown].sum()} of {shown.sum()} people in images were detected")
    print(flight)
    flight.frame_figure(3.0, uav=0).savefig("found.png")
