"""Porous trees, and the free share of lines of sight among them by sampling."""

import math
from dataclasses import replace

import numpy as np

from tracking.geometry.visibility import Forest


def make_porous(forest, rng, *, opaque=0.3, most=3.0):
    """The forest with random leaf area densities up to `most`; of its trees a share stays opaque."""
    densities = np.where(rng.random(len(forest.trees)) < opaque, math.inf, rng.uniform(0.0, most, len(forest.trees)))
    trees = zip(forest.trees, densities.tolist(), strict=True)
    return Forest(tuple(replace(tree, leaf_area_density=density) for tree, density in trees), forest.occlusion)


def sampled_share(origin, point, cylinders, samples=4000):
    """Free share of a segment among porous cylinders, from the extinction at evenly spread points of it."""
    at = origin + (np.arange(samples) + 0.5)[:, None] / samples * (point - origin)
    inside = np.hypot(at[:, None, 0] - cylinders[:, 0], at[:, None, 1] - cylinders[:, 1]) <= cylinders[:, 2]
    inside &= (at[:, None, 2] >= cylinders[:, 3]) & (at[:, None, 2] <= cylinders[:, 4])
    return math.exp(-(inside @ cylinders[:, 5]).mean() * np.linalg.norm(point - origin))
