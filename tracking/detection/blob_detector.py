"""The default detector: people found by their colour, located with the map of trees."""

from __future__ import annotations

from dataclasses import replace

from tracking.detection.blobs import blobs_of
from tracking.detection.detector import Detections, Frame
from tracking.detection.ground_measurement import detections_of, split_covariances
from tracking.detection.partial_visibility import locate
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Indices


class BlobDetector:
    """Detector by colour and connected components, with one detection per person who is visible at all.

    With a forest, a person hidden in part by trees or by the image's edge is located where such a part would show.
    """

    def __init__(self, forest: Forest | None = None) -> None:
        self._forest = forest

    def detect(self, frame: Frame) -> Detections:
        """Detect the people in one frame, from the image's top to its bottom."""
        blobs, components = blobs_of(frame)
        return located_detections(frame, blobs, self._forest, components)


def located_detections(
    frame: Frame, blobs: list[Array], forest: Forest | None, components: Indices | None = None
) -> Detections:
    """Detections of people from blobs, each the pixels (K, 2) of one person; with a forest parts are located by it.

    components (N,): the component that each blob was split from, as from `blobs_of`.
    """
    found = detections_of(frame, blobs, components)
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
