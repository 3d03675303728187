"""The testbed's own detector: people by their colour, placed with the help of the map of trees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracking.detection.detector import Detections, Frame, blobs_of, measured, split_covariances
from tracking.detection.partial_visibility import locate
from tracking.geometry.visibility import Forest
from tracking.numerics.compiled import Array


class BlobDetector:
    """Colour segmentation and connected components; one detection per person of whom anything shows.

    With a forest, people whom its trees, or the image's edge, hide in part are placed where such a part would show.
    """

    def __init__(self, forest: Forest | None = None) -> None:
        self._forest = forest

    def detect(self, frame: Frame) -> Detections:
        """The people in one frame, from the image's top to its bottom."""
        blobs, components = blobs_of(frame)
        return located(frame, blobs, self._forest, components)


def located(
    frame: Frame, blobs: list[Array], forest: Forest | None, components: NDArray[np.int64] | None = None
) -> Detections:
    """Detections of people who show as blobs, each the pixels (K, 2) of one; parts are placed if there is a forest.

    components (N,) tell which blobs are of one that was split, as from `blobs_of`.
    """
    found = measured(frame, blobs, components)
    if forest is None:
        return found
    places = {k: place for k, blob in enumerate(blobs) if (place := locate(frame, blob, forest)) is not None}
    if not places:
        return found
    ground, covariances = found.ground.copy(), found.covariances.copy()
    split = split_covariances(frame, found.pixels, components)
    for k, (mean, covariance) in places.items():
        ground[k], covariances[k] = mean, covariance + split[k]
    return replace(found, ground=ground, covariances=covariances)
