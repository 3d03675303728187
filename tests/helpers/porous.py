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


def plain_detectabilities(forest, camera, points, pixel, aside=0.2):
    """Probabilities (N,) that people at points (N, 3) m show to a camera at (3,) m, pixel by pixel of each quarter.

    The pixels of a square of the area of a silhouette are visited row by row, and a quarter stands for all of them.
    aside [m]: from the middle to those of the quarters; with 0, as for planners, the middle stands for them.
    """
    out = []
    for point in np.atleast_2d(points):
        free = forest.free_shares(camera, point)[0, 0]
        if 0.0 < free < 1.0:
            quarters = point + aside * np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
            slope = np.hypot(*(point - camera)[:2]) / abs(point[2] - camera[2])
            parts = np.minimum(forest.free_shares(camera, quarters)[0], 0.95 if aside else 1.0)
            free = 1.0 - math.prod(_hidden(part, pixel, slope) ** 0.25 for part in parts.tolist())
        out.append(free)
    return np.array(out)


def _hidden(free, pixel, slope):
    """Probability that no pixel of a person is free, if all lines of sight have one free share."""
    angle = math.atan(slope)
    edge = math.sqrt(0.2 * math.cos(angle) + 0.22 * 1.7 * math.sin(angle))
    pixel = max(pixel, 0.08)
    steps = max(edge / pixel - 1.0, 0.0)  # of a pixel along an edge
    both = free ** (2.0 - math.exp(-pixel / 0.4))  # two pixels side by side are free
    covered = (1.0 - 2.0 * free + both) / (1.0 - free)  # the next one, if this one is
    inner = 1.0 - (1.0 - covered) ** 2 / free if free > 0.0 else 1.0  # one beside two rows
    return (1.0 - free) * covered ** (2.0 * steps) * inner ** (steps * steps)
