"""The detector that cannot err about who is in view: it reads the renderer's mask, which no other part may see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracking.detection.blob_detector import located
from tracking.detection.detector import Detections, Frame
from tracking.geometry.visibility import Forest
from tracking.numerics.matrices import length


class MaskDetector:
    """Assumption 1 of [Li22] on rendered frames: a detection of everyone of whom a pixel shows, and of nobody else.

    Places and covariances come from these pixels as the blob detector's do from its own.
    """

    def __init__(self, forest: Forest | None = None) -> None:
        self._forest = forest

    def detect(self, frame: Frame, people: NDArray[np.int32]) -> Detections:
        """The people of a mask (P, P), -1 where nobody is, from the image's top to its bottom."""
        rows, columns = np.nonzero(people >= 0)
        owners = people[rows, columns]
        pixels = np.column_stack([columns + 0.5, rows + 0.5])
        # In the order of their topmost pixels, so that it tells nothing of who they are.
        first = np.unique(owners, return_index=True)[1]
        blobs = [pixels[owners == owners[k]] for k in np.sort(first)]
        found = located(frame, blobs, self._forest)
        # A pixel of their own stands for each, so that a score never takes somebody at the edge for a false alarm.
        own = [blob[np.argmin(length(blob - blob.mean(axis=0)))] for blob in blobs]
        return replace(found, pixels=np.array(own).reshape(-1, 2))
