"""Size of a person in the image as a function of the place."""

import math
from typing import NamedTuple

import numpy as np

from tracking.geometry.lens import Lens, focal_length, ground_point, image_point, magnification, plane_point
from tracking.geometry.person import AREA_BY_HEIGHT, AREA_ON_TOP, TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled


class Sizes(NamedTuple):
    """Size of one person in the image at each of N places."""

    axes: Array  # (N, 2, 2) unit vectors in columns: from foot to head, across
    extents: Array  # (N, 2) pixels, largest extents along the axes
    areas: Array  # (N,) pixels, mean areas


@compiled
def sizes_at(lens: Lens, pixels: Array) -> Sizes:
    """Sizes of people whose mid-height is seen at pixels (N, 2).

    The sizes are fitted to renderings of a walking person at all headings, from nadir to 40 degrees off nadir.
    """
    axes, extents, areas = np.empty((len(pixels), 2, 2)), np.empty((len(pixels), 2)), np.empty(len(pixels))
    optics = lens.optics
    for k in range(len(pixels)):
        x, y = ground_point(lens, (pixels[k, 0], pixels[k, 1]), TARGET_HEIGHT)
        scale = magnification(optics, pixels[k, 0], pixels[k, 1]) / image_point(lens, (x, y, TARGET_HEIGHT))[2]
        foot, head = image_point(lens, (x, y, 0.0)), image_point(lens, (x, y, 2 * TARGET_HEIGHT))
        right, down = head[0] - foot[0], head[1] - foot[1]
        height = math.sqrt(right * right + down * down)
        cos, sin = (right / height, down / height) if height > 0.0 else (1.0, 0.0)
        axes[k, 0, 0], axes[k, 0, 1], axes[k, 1, 0], axes[k, 1, 1] = cos, -sin, sin, cos
        extents[k, 0], extents[k, 1] = np.maximum(0.75 * scale + 0.95 * height, 0.95 * scale), 0.95 * scale
        # The image plane stretches silhouettes away from its centre, across people only if the camera is tilted.
        right, down = pixels[k, 0] - optics.cx, pixels[k, 1] - optics.cy
        if optics.reach > 0.0:
            x, y = plane_point(optics, pixels[k, 0], pixels[k, 1])
            right, down = optics.fx * x, optics.fy * y
        off = (down * cos - right * sin) / focal_length(optics)
        extents[k, 1] *= math.sqrt(1.0 + off * off)
        areas[k] = scale * (AREA_ON_TOP * scale + AREA_BY_HEIGHT * height)
    return Sizes(axes, extents, areas)
