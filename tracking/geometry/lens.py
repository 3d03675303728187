"""A camera at a pose, for compiled code, and the projection of single points."""

import math
from typing import NamedTuple

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined


class Lens(NamedTuple):
    """Camera and pose for compiled code."""

    eye: tuple[float, float, float]  # m
    rotation: Array  # (3, 3) from body to world
    focal: float  # pixels; 0 for a view all round
    pixels: int  # along each edge


@compiled
def ground_point(lens: Lens, pixel: tuple[float, float], height: float) -> tuple[float, float]:
    """Point [m] where the line through a pixel (u, v) meets the plane at `height` m, perhaps behind the camera."""
    r = lens.rotation
    x, y = (pixel[0] - lens.pixels / 2) / lens.focal, (lens.pixels / 2 - pixel[1]) / lens.focal
    scale = (height - lens.eye[2]) / (r[2, 0] * x + r[2, 1] * y - r[2, 2])
    east, north = r[0, 0] * x + r[0, 1] * y - r[0, 2], r[1, 0] * x + r[1, 1] * y - r[1, 2]
    return lens.eye[0] + scale * east, lens.eye[1] + scale * north


@compiled
def image_point(lens: Lens, point: tuple[float, float, float]) -> tuple[float, float, float]:
    """Pixel (u, v) of a world point [m] and its depth along the optical axis [m]; NaN for a pixel behind the camera."""
    r = lens.rotation
    east, north, up = point[0] - lens.eye[0], point[1] - lens.eye[1], point[2] - lens.eye[2]
    depth = -(east * r[0, 2] + north * r[1, 2] + up * r[2, 2])
    scale = lens.focal / depth if depth > 0.0 else math.nan
    u = lens.pixels / 2 + scale * (east * r[0, 0] + north * r[1, 0] + up * r[2, 0])
    v = lens.pixels / 2 - scale * (east * r[0, 1] + north * r[1, 1] + up * r[2, 1])
    return u, v, depth


@inlined
def in_image(point: tuple[float, float, float], lens: Lens) -> bool:
    """Test if a world point (3,) m is inside the image of `Camera.project`, or seen by a view all round."""
    if lens.focal == 0.0:
        return True
    position, rotation, focal, pixels = lens.eye, lens.rotation, lens.focal, lens.pixels
    dx, dy, dz = point[0] - position[0], point[1] - position[1], point[2] - position[2]
    depth = -(dx * rotation[0, 2] + dy * rotation[1, 2] + dz * rotation[2, 2])
    if not depth > 0.0:
        return False
    u = pixels / 2 + focal * (dx * rotation[0, 0] + dy * rotation[1, 0] + dz * rotation[2, 0]) / depth
    v = pixels / 2 - focal * (dx * rotation[0, 1] + dy * rotation[1, 1] + dz * rotation[2, 1]) / depth
    return bool(0.0 <= u <= pixels and 0.0 <= v <= pixels)
