"""People seen through the leaves of porous crowns: who they are, and how much that adds to their covariances."""

import numpy as np

from tracking.detection.detection_errors import LEAF, covariances_along, pixel_footprints, sight_axes
from tracking.detection.detector import Detections, Frame
from tracking.detection.person_size import sizes_at
from tracking.geometry.visibility import Forest, at_target_height
from tracking.numerics.arrays import Array, Flags

# m: a person's middle and places around it, as far as a person extends and leaves stick out of a crown.
_AROUND = np.array([(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])


def are_behind_leaves(frame: Frame, ground: Array, forest: Forest) -> Flags:
    """Flags (N,) of ground points (N, 2) m, or of places near by, that a porous crown may hide in part."""
    if not forest.is_porous or len(ground) == 0:
        return np.zeros(len(ground), np.bool_)
    around = (ground[:, None] + _AROUND).reshape(-1, 2)
    shares = forest.free_shares(frame.pose.position, at_target_height(around)).reshape(len(ground), -1)
    behind: Flags = np.any((shares > 0.0) & (shares < 1.0), axis=1)
    return behind


def measure_parts(frame: Frame, found: Detections, blobs: list[Array]) -> tuple[Array, Array]:
    """Extents (N, 2) m of people along and across the line of sight, and shares (N,) that their blobs (K, 2) lack."""
    lens = frame.camera.lens(frame.pose)
    _, extents, areas = sizes_at(lens, found.pixels)
    shown = np.array([len(blob) for blob in blobs], dtype=float) / areas
    return extents * pixel_footprints(lens, found.ground), np.clip(1.0 - shown, 0.0, 1.0)


def leaf_covariances(frame: Frame, found: Detections, blobs: list[Array]) -> Array:
    """Additional covariances (N, 2, 2) m² of detections of people behind leaves, from blobs (K, 2).

    The map does not say where the leaves of a crown are, so unlike trunks and edges they do not move a detection.
    """
    axes, _ = sight_axes(frame.camera.lens(frame.pose), found.ground)
    return covariances_along(axes, LEAF.variances(*measure_parts(frame, found, blobs)))
