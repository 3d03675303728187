"""Scenes, moved and turned."""

import math

import numpy as np

from tracking.geometry.visibility import Forest, Tree


def moved(forest: Forest, angle: float, shift: np.ndarray, grown: float = 0.0) -> Forest:
    """The forest turned about the vertical axis through the origin, shifted, its cylinders grown."""
    trees = []
    for t in forest.trees:
        x, y = turned(np.array([t.x, t.y]), angle) + shift
        size = t.canopy_radius + grown, t.canopy_base - grown, t.canopy_top + grown, t.trunk_radius + grown
        trees.append(Tree(float(x), float(y), *size))
    return Forest(tuple(trees))


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """Points (..., 2 or 3) turned about the vertical axis."""
    out = points.copy()
    out[..., 0] = math.cos(angle) * points[..., 0] - math.sin(angle) * points[..., 1]
    out[..., 1] = math.sin(angle) * points[..., 0] + math.cos(angle) * points[..., 1]
    return out
