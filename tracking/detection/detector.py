"""People in camera images: colour segmentation, one detection per visible person."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.detection.components import components as components_of
from tracking.detection.noise import SPLIT, WHOLE, covariances_along, footprints, sight
from tracking.geometry.camera import Camera, Lens, Pose, ground_point, image_point
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.compiled import Array, compiled
from tracking.numerics.elementary import cos, sin
from tracking.numerics.matrices import applied, eigen, length, product

# A walking person's mean outline over all headings, as three horizontal circles: height above ground, radius [m].
_CIRCLES = ((0.0, 0.25), (1.4, 0.23), (1.7, 0.08))
_OUTLINE = np.array(
    [
        (radius * cos(angle), radius * sin(angle), height)
        for height, radius in _CIRCLES
        for angle in (np.arange(12) * (math.pi / 6)).tolist()
    ]
)
# A component of more than this many mean silhouettes is more than one person.
_CROWD = 1.5


@dataclass(frozen=True, eq=False)
class Frame:
    """What one camera saw at one instant."""

    uav: int
    time: float  # s
    camera: Camera
    pose: Pose  # of the camera
    image: NDArray[np.uint8]  # (P, P, 3) RGB


@dataclass(frozen=True, eq=False)
class Detections:
    """People found in one frame, from the image's top to its bottom.

    What only the drawing of frames wants, areas and boxes, a detector may leave out.
    """

    pixels: Array  # (N, 2) where each person's mid-height seems to be in the image, hidden parts aside
    ground: Array  # (N, 2) m
    covariances: Array  # (N, 2, 2) m², of `ground`
    areas: Array = field(default_factory=lambda: np.zeros(0))  # (N,) visible, pixels
    boxes: Array = field(default_factory=lambda: np.zeros((0, 4)))  # (N, 4) left, top, right, bottom edge, pixels


class Detector(Protocol):
    """Finds people in frames; "package.module:Class" in a scenario names one, made without arguments."""

    def detect(self, frame: Frame) -> Detections:
        """The people in one frame, from the image's top to its bottom."""


def detect(frame: Frame) -> Detections:
    """Detect the people in a frame, as if each were seen whole, the image's edge aside."""
    return measured(frame, *blobs_of(frame))


# Where the horizon is in view, rays that meet no ground give NaN; such sizes fit nobody, such pixels are no person's.
@np.errstate(divide="ignore", invalid="ignore")
def blobs_of(frame: Frame) -> tuple[list[Array], NDArray[np.int64]]:
    """Pixels (K, 2) of each person in a frame, and which component each is of (N,).

    Fragments that one person spans are joined; a component too large for one person is split.
    """
    lens = frame.camera.lens(frame.pose)
    blobs = components_of(frame.image)
    whole, _ = _joined(frame, blobs, range(len(blobs)))
    parts = [
        (part, k)
        for k, blob in enumerate(whole)
        for part in ([blob] if _one_person(lens, blob) else _split(frame, blob))
    ]
    if len(parts) > len(whole):  # a foot that fits neither of two people together may fit one of them
        parts = list(zip(*_joined(frame, [blob for blob, _ in parts], [k for _, k in parts]), strict=True))
    found = [(blob, k) for blob, k in parts if _meets_ground(lens, blob)]
    return [blob for blob, _ in found], np.array([k for _, k in found], dtype=np.int64)


@np.errstate(divide="ignore", invalid="ignore")
def measured(frame: Frame, blobs: list[Array], components: NDArray[np.int64] | None = None) -> Detections:
    """Detections of people who show as blobs, each the pixels (K, 2) of one; components (N,) as from `blobs_of`.

    A silhouette's centroid stands for the person's mid-height, corrected for what the image's edge cuts off; the
    covariance is that of a person who is seen whole, and wider where one component was split.
    """
    if not blobs:
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    pixels = np.array([_centre(frame, blob) for blob in blobs])
    ground = frame.camera.ground_points(frame.pose, pixels, TARGET_HEIGHT)
    return Detections(
        pixels,
        ground,
        whole_covariances(frame, ground) + split_covariances(frame, pixels, components),
        np.array([float(len(blob)) for blob in blobs]),
        np.array([[*(blob.min(axis=0) - 0.5), *(blob.max(axis=0) + 0.5)] for blob in blobs]),
    )


def whole_covariances(frame: Frame, ground: Array) -> Array:
    """Covariances (N, 2, 2) m² of people at ground points (N, 2) m who are seen whole."""
    axes, tangents = sight(frame.pose, ground)
    variances = WHOLE.detected(tangents, footprints(frame.camera, frame.pose, ground))
    # Towards the horizon a pixel's ground grows without bounds, but nobody is less certain than by their distance.
    distances = np.sum(np.square(ground - frame.pose.position[:2]), axis=1) + np.square(frame.pose.position[2])
    return covariances_along(axes, np.minimum(variances, distances[:, None]))


@np.errstate(invalid="ignore")
def split_covariances(frame: Frame, pixels: Array, components: NDArray[np.int64] | None) -> Array:
    """What is added (N, 2, 2) m² to the covariances of detections at pixels (N, 2); zero but for split components."""
    if components is None or len(np.unique(components)) == len(components):
        return np.zeros((len(pixels), 2, 2))
    axes, tangents = sight(frame.pose, frame.camera.ground_points(frame.pose, pixels, TARGET_HEIGHT))
    return covariances_along(axes, SPLIT.variances(tangents, split_gaps(frame, pixels, components)))


@np.errstate(divide="ignore", invalid="ignore")
def split_gaps(frame: Frame, pixels: Array, components: NDArray[np.int64]) -> Array:
    """Distances (N,), in extents of a person, to the nearest detection of the same component; else infinite."""
    size = sizes(frame, pixels)
    offsets = product(pixels[None] - pixels[:, None], size.axes) / size.extents[:, None]
    siblings = (components[:, None] == components) & ~np.eye(len(components), dtype=np.bool_)
    gaps = np.where(siblings, length(offsets), np.inf).min(axis=1)
    return np.asarray(np.nan_to_num(gaps, posinf=np.inf))


@dataclass(frozen=True, eq=False)
class Size:
    """How large one person is in the image at each of N places."""

    axes: Array  # (N, 2, 2) unit vectors in columns: from foot to head, across
    extents: Array  # (N, 2) the largest along the axes, pixels
    areas: Array  # (N,) the mean, pixels


def sizes(frame: Frame, pixels: Array) -> Size:
    """Sizes of people whose mid-height is seen at pixels (N, 2).

    Fitted to renderings of a walking person at all headings, from nadir to 40 degrees off.
    """
    return Size(*sizes_at(frame.camera.lens(frame.pose), pixels))


@compiled
def sizes_at(lens: Lens, pixels: Array) -> tuple[Array, Array, Array]:
    """Axes (N, 2, 2), extents (N, 2) and areas (N,) at pixels (N, 2)."""
    axes, extents, areas = np.empty((len(pixels), 2, 2)), np.empty((len(pixels), 2)), np.empty(len(pixels))
    for k in range(len(pixels)):
        x, y = ground_point(lens, (pixels[k, 0], pixels[k, 1]), TARGET_HEIGHT)
        scale = lens.focal / image_point(lens, (x, y, TARGET_HEIGHT))[2]
        foot, head = image_point(lens, (x, y, 0.0)), image_point(lens, (x, y, 2 * TARGET_HEIGHT))
        right, down = head[0] - foot[0], head[1] - foot[1]
        height = math.sqrt(right * right + down * down)
        cos, sin = (right / height, down / height) if height > 0.0 else (1.0, 0.0)
        axes[k, 0], axes[k, 1] = (cos, -sin), (sin, cos)
        extents[k] = np.maximum(0.75 * scale + 0.95 * height, 0.95 * scale), 0.95 * scale
        # The image plane stretches what is off its axis, away from it: across people only where a camera is tilted.
        off = ((pixels[k, 1] - lens.pixels / 2) * cos - (pixels[k, 0] - lens.pixels / 2) * sin) / lens.focal
        extents[k, 1] *= math.sqrt(1.0 + off * off)
        areas[k] = scale * (0.2 * scale + 0.22 * height)
    return axes, extents, areas


@compiled
def _one_person(lens: Lens, blob: Array) -> bool:
    """Whether one person who stands in their middle can span all pixels (K, 2) of a blob."""
    axes, extents, areas = sizes_at(lens, np.array([[_middle(blob[:, 0]), _middle(blob[:, 1])]]))
    if not len(blob) <= _CROWD * areas[0] + 1.0:
        return False
    for k in range(2):
        along = axes[0, 0, k] * blob[:, 0] + axes[0, 1, k] * blob[:, 1]
        if not along.max() - along.min() <= extents[0, k]:
            return False
    return True


@compiled
def _middle(values: Array) -> float:
    return float((values.min() + values.max()) / 2)


def _joined(frame: Frame, blobs: list[Array], origins: Sequence[int]) -> tuple[list[Array], list[int]]:
    """Join the nearest two blobs that one person can span until there are none; what is joined is of the larger's."""
    if len(blobs) < 2:
        return blobs, list(origins)
    blobs, origins, lens = list(blobs), list(origins), frame.camera.lens(frame.pose)
    centres = np.array([blob.mean(axis=0) for blob in blobs])
    reach = length(sizes_at(lens, centres)[1])
    joins = [0] * len(blobs)  # of each blob so far; what was found before the last one is out of date
    pairs = [(distance, i, j, 0, 0) for k in range(len(blobs)) for distance, i, j in _near(centres, reach, k, k)]
    heapq.heapify(pairs)
    while pairs:
        _, i, j, *then = heapq.heappop(pairs)
        if then != [joins[i], joins[j]]:
            continue
        both = np.vstack([blobs[i], blobs[j]])
        if not _one_person(lens, both):
            continue
        origins[i] = origins[max(i, j, key=lambda k: len(blobs[k]))]
        blobs[i], centres[i], centres[j] = both, both.mean(axis=0), math.nan
        reach[i] = length(sizes_at(lens, centres[i : i + 1])[1])[0]
        joins[i], joins[j] = joins[i] + 1, -1
        for distance, low, high in _near(centres, reach, i, len(blobs)):
            heapq.heappush(pairs, (distance, low, high, joins[low], joins[high]))
    left = [k for k in range(len(blobs)) if joins[k] >= 0]
    return [blobs[k] for k in left], [origins[k] for k in left]


@compiled
def _near(centres: Array, reach: Array, k: int, stop: int) -> list[tuple[float, int, int]]:
    """Distances of blob k to those before `stop` that are in reach of the later of both, and both, earlier first."""
    pairs = []
    for n in range(stop):
        right, down = centres[n, 0] - centres[k, 0], centres[n, 1] - centres[k, 1]
        distance = math.sqrt(right * right + down * down)
        if n != k and distance < reach[max(n, k)]:
            pairs.append((distance, min(n, k), max(n, k)))
    return pairs


def _split(frame: Frame, blob: Array) -> list[Array]:
    """Parts of a blob, as many as it has areas of one person; k-means from evenly spread starts."""
    area = float(sizes(frame, (blob.min(axis=0) + blob.max(axis=0))[None] / 2).areas[0])
    if len(blob) == 1 or math.isnan(area):
        return [blob]
    people = min(max(2, round(len(blob) / area)), len(blob))
    offset = blob - blob.mean(axis=0)
    principal = eigen(product(offset.T, offset))[1][:, -1]
    order = np.argsort(applied(principal[None], offset)[:, 0], kind="stable")
    means = np.array([blob[part].mean(axis=0) for part in np.array_split(order, people)])
    for _ in range(10):
        nearest = np.argmin(length(blob[:, None] - means), axis=1)
        parts = [blob[nearest == i] for i in range(len(means)) if np.any(nearest == i)]
        means = np.array([part.mean(axis=0) for part in parts])
    return parts


@compiled
def _meets_ground(lens: Lens, blob: Array) -> bool:
    """Whether the ray through a blob's centroid meets the plane at people's mid-height, in front of the camera."""
    x, y = ground_point(lens, (blob[:, 0].mean(), blob[:, 1].mean()), TARGET_HEIGHT)
    return image_point(lens, (x, y, TARGET_HEIGHT))[2] > 0.0


def _centre(frame: Frame, blob: Array) -> Array:
    """Where the mid-height of the person is that shows as a blob, inside or outside of the image (2,)."""
    seen = np.asarray(blob.mean(axis=0))
    edge = float(frame.camera.pixels)
    if blob.min() > 0.5 and blob.max() < edge - 0.5:
        return seen
    image = np.array([[0, 0], [edge, 0], [edge, edge], [0, edge]], dtype=np.float32)
    centre = seen
    # The place whose silhouette, cut as the image cuts it, has the centroid that was seen.
    for _ in range(8):
        points = _outline(frame, centre)
        if not np.isfinite(points).all():
            return seen
        outline = cv2.convexHull(points.astype(np.float32))[:, 0]
        area, inside = cv2.intersectConvexConvex(outline, image)
        if area < 1e-3:
            break
        centre = seen + (_centroid(outline) - _centroid(np.asarray(inside[:, 0])))
    return centre


def _outline(frame: Frame, pixel: Array) -> Array:
    """Pixels (K, 2) whose convex hull is the silhouette of a person whose mid-height is seen at a pixel (2,)."""
    ground = frame.camera.ground_points(frame.pose, pixel, TARGET_HEIGHT)[0]
    return frame.camera.project(frame.pose, _OUTLINE + np.append(ground, 0.0))[0]


def _centroid(polygon: NDArray[Any]) -> Array:
    moments = cv2.moments(polygon)
    return np.array([moments["m10"], moments["m01"]]) / moments["m00"]
