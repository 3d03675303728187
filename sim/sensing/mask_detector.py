"""Ground-truth mask detector: it reads the renderer's mask, which no other part may see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracking.detection.blob_detector import located_detections
from tracking.detection.detector import Detections, Frame
from tracking.geometry.visibility import Forest
from tracking.numerics.distances import length


class MaskDetector:
    """Assumption 1 of [Li22] on rendered frames: one detection of each person with a visible pixel, and no other.

    Locations and covariances are computed from these pixels as by the blob detector.
    """

    def __init__(self, forest: Forest | None = None) -> None:
        self._forest = forest

    def detect(self, frame: Frame, people: NDArray[np.int32]) -> Detections:
        """Detections of the people of a mask (P, P), -1 elsewhere, from the image's top to its bottom."""
        rows, columns = np.nonzero(people >= 0)
        owners = people[rows, columns]
        pixels = np.column_stack([columns + 0.5, rows + 0.5])
        # In the order of their topmost pixels, so that it does not reveal identities.
        first = np.unique(owners, return_index=True)[1]
        blobs = [pixels[owners == owners[k]] for k in np.sort(first)]
        found = located_detections(frame, blobs, self._forest)
        # Each is placed on a pixel of the person, so that a score takes no person at the edge for a false alarm.
        own = [blob[np.argmin(length(blob - blob.mean(axis=0)))] for blob in blobs]
        return replace(found, pixels=np.array(own).reshape(-1, 2))
