"""Ground truth of detections, from the renderer's mask of people, which no other module may use."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracking.detection.blob_detector import locate_people
from tracking.detection.detector import Detections, Frame
from tracking.numerics.arrays import Array
from tracking.numerics.assignment import most_pairs
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length

GATE = 3.0  # pixels, largest distance from a detection to the nearest pixel of the detected person


def count_visible_pixels(people: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Number of pixels (M,) of each of `count` people in a mask (H, W)."""
    return np.bincount(people[people >= 0], minlength=count).astype(np.int64)


def match_detections(pixels: Array, people: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Index (M,) of the detection of each of `count` people among detections (N, 2) at pixels (u, v); -1 for none.

    people (H, W): index of the person at each pixel, -1 for none. A detection outside the image, as of a person
    that the edge cuts, is moved to the nearest place inside.
    """
    found = np.full(count, -1)
    gaps = _measure_gaps(np.ascontiguousarray(pixels, dtype=float), people, count)
    for detection, person in most_pairs(gaps <= GATE, gaps):
        found[person] = detection
    return found


def find_owners(pixels: Array, people: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Index (N,) of the person of each detection, given as in `match_detections`; -1 for a false alarm.

    As many detections as possible show people of their own. Any other within the gate shows the nearest person again.
    """
    owners = np.full(len(pixels), -1)
    gaps = _measure_gaps(np.ascontiguousarray(pixels, dtype=float), people, count)
    for detection in np.flatnonzero((gaps <= GATE).any(axis=1)).tolist():
        owners[detection] = int(gaps[detection].argmin())
    for detection, person in most_pairs(gaps <= GATE, gaps):
        owners[detection] = person
    return owners


@compiled
def _measure_gaps(pixels: Array, people: NDArray[np.int32], count: int) -> Array:
    """Distances (N, M) in pixels from detections to the nearest pixel of each person; infinite if none shows."""
    nearest = np.full((len(pixels), count), np.inf)
    height, width = people.shape
    for row in range(height if len(pixels) else 0):
        for column in range(width):
            person = people[row, column]
            if person >= 0:
                for n in range(len(pixels)):
                    x = min(max(pixels[n, 0], 0.0), width) - (column + 0.5)
                    y = min(max(pixels[n, 1], 0.0), height) - (row + 0.5)
                    nearest[n, person] = min(nearest[n, person], math.sqrt(x * x + y * y))
    return nearest


@dataclass(frozen=True, eq=False)
class MaskDetector:
    """Assumption 1 of [Li22] on rendered frames: one detection per person with a visible pixel, and no others.

    Positions and covariances are computed from these pixels in the same way as by the blob detector.
    """

    def detect(self, frame: Frame, people: NDArray[np.int32]) -> Detections:
        """Detections of the people in a mask (H, W) with -1 elsewhere, ordered from the image's top to its bottom."""
        rows, columns = np.nonzero(people >= 0)
        owners = people[rows, columns]
        pixels = np.column_stack([columns + 0.5, rows + 0.5])
        # The order is that of the topmost pixels, so that it does not reveal identities.
        first = np.unique(owners, return_index=True)[1]
        blobs = [pixels[owners == owners[k]] for k in np.sort(first)]
        found = locate_people(frame, blobs)
        # Detections lie on a pixel of their person, so that metrics do not count people at the edge as false alarms.
        own = [blob[np.argmin(length(blob - blob.mean(axis=0)))] for blob in blobs]
        return replace(found, pixels=np.array(own).reshape(-1, 2))
