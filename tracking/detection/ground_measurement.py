"""Ground measurements of people from their blobs, with covariances."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.detection.detection_errors import SPLIT, covariances_along, sight_axes, whole_covariances
from tracking.detection.detector import Detections, Frame
from tracking.detection.person_size import sizes_at
from tracking.geometry.lens import Lens
from tracking.geometry.person import OUTLINE, TARGET_HEIGHT
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.distances import length
from tracking.numerics.matrices import product
from tracking.numerics.trigonometry import cos, sin

_ANGLES = (np.arange(12) * (math.pi / 6)).tolist()
_OUTLINE = np.array([(r * cos(angle), r * sin(angle), height) for height, r in OUTLINE for angle in _ANGLES])


@np.errstate(divide="ignore", invalid="ignore")
def detections_of(frame: Frame, blobs: list[Array]) -> Detections:
    """Detections of people from blobs, each the pixels (K, 2) of one person who is seen whole.

    The centroid of a silhouette is used as the person's mid-height, corrected for the part outside the image.
    """
    if not blobs:
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    pixels = np.array([_find_centre(frame, blob) for blob in blobs])
    ground = frame.camera.ground_points(frame.pose, pixels, TARGET_HEIGHT)
    return Detections(pixels, ground, whole_covariances(frame.camera.lens(frame.pose), ground))


@np.errstate(divide="ignore", invalid="ignore")
def split_covariances(frame: Frame, pixels: Array, components: Indices | None) -> Array:
    """Additional covariances (N, 2, 2) m² of detections at pixels (N, 2); zero unless their component was split."""
    if components is None or len(np.unique(components)) == len(components):
        return np.zeros((len(pixels), 2, 2))
    lens = frame.camera.lens(frame.pose)
    axes, tangents = sight_axes(lens, frame.camera.ground_points(frame.pose, pixels, TARGET_HEIGHT))
    return covariances_along(axes, SPLIT.variances(tangents, split_gaps(lens, pixels, components)))


@np.errstate(divide="ignore", invalid="ignore")
def split_gaps(lens: Lens, pixels: Array, components: Indices) -> Array:
    """Distances (N,), in extents of a person, to the nearest detection of the same component; infinite if none."""
    size = sizes_at(lens, pixels)
    offsets = product(pixels[None] - pixels[:, None], size.axes) / size.extents[:, None]
    siblings = (components[:, None] == components) & ~np.eye(len(components), dtype=np.bool_)
    gaps = np.where(siblings, length(offsets), np.inf).min(axis=1)
    return np.asarray(np.nan_to_num(gaps, posinf=np.inf))


def _find_centre(frame: Frame, blob: Array) -> Array:
    """Pixel (2,) of the mid-height of a blob's person, in the image or outside it."""
    seen = np.asarray(blob.mean(axis=0))
    if blob.min() > 0.5 and np.all(blob.max(axis=0) < np.array(frame.camera.size) - 0.5):
        return seen
    image = frame.camera.corners[::-1].astype(np.float32)
    centre = seen
    # Find the place where the silhouette, cut by the image's edge, has the centroid of the blob.
    for _ in range(8):
        ground = frame.camera.ground_points(frame.pose, centre, TARGET_HEIGHT)[0]
        points = frame.camera.project(frame.pose, _OUTLINE + np.append(ground, 0.0))[0]
        if not np.isfinite(points).all():
            return seen
        outline = cv2.convexHull(points.astype(np.float32))[:, 0]
        area, inside = cv2.intersectConvexConvex(outline, image)
        if area < 1e-3:
            break
        centre = seen + (_compute_centroid(outline) - _compute_centroid(np.asarray(inside[:, 0])))
    return centre if np.isfinite(frame.camera.ground_points(frame.pose, centre, TARGET_HEIGHT)).all() else seen


def _compute_centroid(polygon: NDArray[Any]) -> Array:
    moments = cv2.moments(polygon)
    return np.array([moments["m10"], moments["m01"]]) / moments["m00"]
