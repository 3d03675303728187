"""The default detector: blobs of a colour, one for each person, located with the map of trees."""

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tracking.detection.components import find_components
from tracking.detection.detector import Detections, Frame
from tracking.detection.ground_measurement import detections_of, split_covariances
from tracking.detection.leaf_cover import are_behind_leaves, leaf_covariances
from tracking.detection.partial_visibility import find_places
from tracking.detection.person_size import sizes_at
from tracking.geometry.lens import Lens, ground_point, image_point
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.factorisation import eigensystems
from tracking.numerics.matrices import apply, product

# A component with the area of more than this many mean silhouettes shows more than one person.
_CROWD = 1.5


# If the horizon is in view, rays that meet no ground give sizes of NaN, which fit no person.
@np.errstate(divide="ignore", invalid="ignore")
def find_blobs(frame: Frame) -> tuple[list[Array], Indices]:
    """Pixels (K, 2) of each of N persons in a frame, and the component (N,) that each is from.

    Fragments that one person can span are joined. A component that is too large for one person is split.
    """
    lens = frame.camera.lens(frame.pose)
    blobs = find_components(frame.image)
    whole, _ = _join(lens, blobs, range(len(blobs)))
    parts = [(part, k) for k, blob in enumerate(whole) for part in _split(lens, blob)]
    if len(parts) > len(whole):  # a foot that does not fit two people together may fit one of them
        parts = list(zip(*_join(lens, [blob for blob, _ in parts], [k for _, k in parts]), strict=True))
    found = [(blob, k) for blob, k in parts if _meets_ground(lens, blob)]
    return [blob for blob, _ in found], np.array([k for _, k in found], dtype=np.int64)


@compiled
def _is_one_person(lens: Lens, blob: Array) -> bool:
    """Test if one person in the middle of a blob can span all its pixels (K, 2)."""
    middle = np.array([[blob[:, 0].min() + blob[:, 0].max(), blob[:, 1].min() + blob[:, 1].max()]]) / 2
    axes, extents, areas = sizes_at(lens, middle)
    if not len(blob) <= _CROWD * areas[0] + 1.0:
        return False
    for k in range(2):
        along = axes[0, 0, k] * blob[:, 0] + axes[0, 1, k] * blob[:, 1]
        if not along.max() - along.min() <= extents[0, k]:
            return False
    return True


def _join(lens: Lens, blobs: list[Array], origins: Sequence[int]) -> tuple[list[Array], list[int]]:
    """Join the nearest two blobs that one person can span, until there are none; the larger one gives the origin."""
    if len(blobs) < 2:
        return blobs, list(origins)
    blobs, origins = list(blobs), list(origins)
    centres = np.array([blob.mean(axis=0) for blob in blobs])
    reach = length(sizes_at(lens, centres).extents)
    joins = [0] * len(blobs)  # number of joins of each blob; pairs found before its last join are out of date
    pairs = [
        (distance, i, j, 0, 0) for k in range(len(blobs)) for distance, i, j in _find_near_pairs(centres, reach, k, k)
    ]
    heapq.heapify(pairs)
    while pairs:
        _, i, j, *then = heapq.heappop(pairs)
        if then != [joins[i], joins[j]]:
            continue
        both = np.vstack([blobs[i], blobs[j]])
        if not _is_one_person(lens, both):
            continue
        origins[i] = origins[max(i, j, key=lambda k: len(blobs[k]))]
        blobs[i], centres[i], centres[j] = both, both.mean(axis=0), math.nan
        reach[i] = length(sizes_at(lens, centres[i : i + 1]).extents)[0]
        joins[i], joins[j] = joins[i] + 1, -1
        for distance, low, high in _find_near_pairs(centres, reach, i, len(blobs)):
            heapq.heappush(pairs, (distance, low, high, joins[low], joins[high]))
    left = [k for k in range(len(blobs)) if joins[k] >= 0]
    return [blobs[k] for k in left], [origins[k] for k in left]


@compiled
def _find_near_pairs(centres: Array, reach: Array, k: int, stop: int) -> list[tuple[float, int, int]]:
    """Pairs of blob k and one before `stop`, within the reach of the later: distance, earlier and later index."""
    pairs = []
    for n in range(stop):
        right, down = centres[n, 0] - centres[k, 0], centres[n, 1] - centres[k, 1]
        distance = math.sqrt(right * right + down * down)
        if n != k and distance < reach[max(n, k)]:
            pairs.append((distance, min(n, k), max(n, k)))
    return pairs


def _split(lens: Lens, blob: Array) -> list[Array]:
    """Split a blob into people. It stays whole if one person can span it; otherwise its area gives their number.

    The parts are found by k-means from evenly spread starts.
    """
    if _is_one_person(lens, blob):
        return [blob]
    middle = (blob.min(axis=0) + blob.max(axis=0))[None] / 2
    area = float(sizes_at(lens, middle).areas[0])
    if math.isnan(area):
        return [blob]
    people = min(max(2, round(len(blob) / area)), len(blob))
    offset = blob - blob.mean(axis=0)
    principal = eigensystems(product(offset.T, offset)[None])[1][0, :, -1]
    order = np.argsort(apply(principal[None], offset)[:, 0], kind="stable")
    means = np.array([blob[part].mean(axis=0) for part in np.array_split(order, people)])
    for _ in range(10):
        nearest = np.argmin(length(blob[:, None] - means), axis=1)
        parts = [blob[nearest == i] for i in range(len(means)) if np.any(nearest == i)]
        means = np.array([part.mean(axis=0) for part in parts])
    return parts


@compiled
def _meets_ground(lens: Lens, blob: Array) -> bool:
    """Test if the ray through a blob's centroid meets the plane at people's mid-height in front of the camera."""
    x, y = ground_point(lens, (blob[:, 0].mean(), blob[:, 1].mean()), TARGET_HEIGHT)
    return image_point(lens, (x, y, TARGET_HEIGHT))[2] > 0.0


@dataclass(frozen=True, eq=False)
class BlobDetector:
    """Detector by colour and connected components, with one detection per person who is visible at all.

    With a map, a person hidden in part by trees or the image's edge is located where just this part would show. Of
    people seen through a porous crown, the covariance grows with the share that does not show.
    """

    def detect(self, frame: Frame) -> Detections:
        """Detect the people in one frame, from the image's top to its bottom."""
        blobs, components = find_blobs(frame)
        return locate_people(frame, blobs, components)


def locate_people(frame: Frame, blobs: list[Array], components: Indices | None = None) -> Detections:
    """Detections of people from blobs, each the pixels (K, 2) of one person; a map locates people hidden in part.

    components (N,): the component that each blob is from, as from `find_blobs`.
    """
    found = detections_of(frame, blobs)
    if frame.forest is not None:
        forest = frame.forest.as_mapped
        leaves = are_behind_leaves(frame, found.ground, forest)
        if leaves.any():
            found.covariances[leaves] += leaf_covariances(frame, found, blobs)[leaves]
        for k in np.flatnonzero(~leaves).tolist():
            if (places := find_places(frame, blobs[k], forest)) is not None:
                found.ground[k], found.covariances[k], _ = places.posterior()
    return replace(found, covariances=found.covariances + split_covariances(frame, found.pixels, components))
