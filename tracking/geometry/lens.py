"""A camera at a pose, for compiled code, and the projection of single points."""

import math
from typing import NamedTuple

from tracking.geometry.distortion import Distortion, distort, distortion_slopes, undistort
from tracking.geometry.quaternions import rotation
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined

_INSIDE = 1e-9  # of the rim of a lens, as its inverse needs points within its reach


class Optics(NamedTuple):
    """Calibration of a camera, in pixels. The centre of the first pixel is (0.5, 0.5); in OpenCV it is (0, 0)."""

    fx: float  # focal length to the right; 0 for a view all round
    fy: float  # focal length down
    cx: float  # principal point
    cy: float
    width: int
    height: int
    distortion: Distortion = Distortion()
    reach: float = 0.0  # as from `find_reach`

    @property
    def numbers(self) -> tuple[float, ...]:
        """All 16 numbers, for `lens_of`."""
        return *self[:6], *self.distortion, self.reach


class Lens(NamedTuple):
    """Camera and pose for compiled code."""

    eye: tuple[float, float, float]  # m
    rotation: Array  # (3, 3) from body to world
    optics: Optics


@compiled
def lens_of(optics: Array, position: Array, quaternion: Array) -> Lens:
    """The lens of `Optics.numbers` (16,) at a position (3,) m with an attitude (4,)."""
    o = optics
    bend = Distortion(o[6], o[7], o[8], o[9], o[10], o[11], o[12], o[13], o[14])
    calibration = Optics(o[0], o[1], o[2], o[3], int(o[4]), int(o[5]), bend, o[15])
    return Lens((position[0], position[1], position[2]), rotation(quaternion), calibration)


@compiled
def plane_point(optics: Optics, u: float, v: float) -> tuple[float, float]:
    """Point (x, y) to the right and down on the image plane at distance 1 of a pixel; NaN beyond a lens's reach."""
    x, y = (u - optics.cx) / optics.fx, (v - optics.cy) / optics.fy
    return undistort(optics.distortion, optics.reach, x, y) if optics.reach > 0.0 else (x, y)


@compiled
def plane_pixel(optics: Optics, x: float, y: float) -> tuple[float, float]:
    """Pixel (u, v) of a point of the image plane at distance 1; NaN beyond a lens's reach."""
    if optics.reach > 0.0:
        x, y = distort(optics.distortion, x, y) if x * x + y * y <= optics.reach else (math.nan, math.nan)
    return optics.cx + optics.fx * x, optics.cy + optics.fy * y


@compiled
def nearest_shown(optics: Optics, u: float, v: float) -> tuple[float, float]:
    """The pixel (u, v) itself, or that in its direction on the rim of an equidistant lens which does not show it."""
    if optics.distortion.equidistant == 0.0:
        return u, v
    x, y = (u - optics.cx) / optics.fx, (v - optics.cy) / optics.fy
    rim = (1.0 - _INSIDE) * distort(optics.distortion, math.sqrt(optics.reach), 0.0)[0]
    far = math.sqrt(x * x + y * y)
    if far <= rim:
        return u, v
    return optics.cx + rim / far * (u - optics.cx), optics.cy + rim / far * (v - optics.cy)


@compiled
def plane_slopes(optics: Optics, x: float, y: float) -> tuple[float, float, float, float]:
    """Derivatives by u and v of x, then of y, at a point of the image plane at distance `focal_length`."""
    focal = focal_length(optics)
    if optics.reach == 0.0:
        return focal / optics.fx, 0.0, 0.0, focal / optics.fy
    xx, yy, xy = distortion_slopes(optics.distortion, x, y)
    right, down = focal / (xx * yy - xy * xy) / optics.fx, focal / (xx * yy - xy * xy) / optics.fy
    return yy * right, -xy * down, -xy * right, xx * down


@compiled
def focal_length(optics: Optics) -> float:
    """Geometric mean of the focal lengths of both directions [pixel], exact if they are equal; 0 for all round."""
    return math.sqrt(optics.fx * optics.fy)


@compiled
def magnification(optics: Optics, u: float, v: float) -> float:
    """Pixels, in the mean of both directions, per unit of the image plane at distance 1 at a pixel."""
    if optics.reach == 0.0:
        return focal_length(optics)
    x, y = plane_point(optics, u, v)
    xx, yy, xy = distortion_slopes(optics.distortion, x, y)
    return focal_length(optics) * math.sqrt(xx * yy - xy * xy)


@compiled
def linear_pixel(optics: Optics, u: float, v: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Pixel coordinates near a pixel as linear functions of (x, y, 1) on the image plane at distance 1.

    For a pixel that an equidistant lens does not show, they are those of `nearest_shown`.
    """
    if optics.reach == 0.0:
        return (optics.fx, 0.0, optics.cx), (0.0, optics.fy, optics.cy)
    u, v = nearest_shown(optics, u, v)
    x, y = plane_point(optics, u, v)
    xx, yy, xy = distortion_slopes(optics.distortion, x, y)
    a, b, c, d = optics.fx * xx, optics.fx * xy, optics.fy * xy, optics.fy * yy
    return (a, b, u - a * x - b * y), (c, d, v - c * x - d * y)


@compiled
def pixel_ray(lens: Lens, u: float, v: float) -> tuple[float, float, float]:
    """Direction in the world, of unit depth along the optical axis, through a pixel; NaN beyond a lens's reach."""
    r = lens.rotation
    x, y = plane_point(lens.optics, u, v)
    y = -y
    east, north = r[0, 0] * x + r[0, 1] * y - r[0, 2], r[1, 0] * x + r[1, 1] * y - r[1, 2]
    return east, north, r[2, 0] * x + r[2, 1] * y - r[2, 2]


@compiled
def ground_point(lens: Lens, pixel: tuple[float, float], height: float) -> tuple[float, float]:
    """Point [m] where the line through a pixel (u, v) meets the plane at `height` m, perhaps behind the camera."""
    east, north, up = pixel_ray(lens, pixel[0], pixel[1])
    scale = (height - lens.eye[2]) / up
    return lens.eye[0] + scale * east, lens.eye[1] + scale * north


@compiled
def image_point(lens: Lens, point: tuple[float, float, float]) -> tuple[float, float, float]:
    """Pixel (u, v) of a world point [m] and its depth along the optical axis [m].

    The pixel is NaN behind the camera and beyond the reach of a lens.
    """
    r, optics = lens.rotation, lens.optics
    east, north, up = point[0] - lens.eye[0], point[1] - lens.eye[1], point[2] - lens.eye[2]
    depth = -(east * r[0, 2] + north * r[1, 2] + up * r[2, 2])
    right, above = east * r[0, 0] + north * r[1, 0] + up * r[2, 0], east * r[0, 1] + north * r[1, 1] + up * r[2, 1]
    if not depth > 0.0:
        return math.nan, math.nan, depth
    if optics.reach > 0.0:
        u, v = plane_pixel(optics, right / depth, -above / depth)
        return u, v, depth
    return optics.cx + optics.fx / depth * right, optics.cy - optics.fy / depth * above, depth


@inlined
def pixel_size(lens: Lens, point: tuple[float, float, float]) -> float:
    """Edge [m] of a pixel at a world point (3,) m, across the optical axis, without distortion; 0 for all round."""
    r, focal = lens.rotation, focal_length(lens.optics)
    east, north, up = point[0] - lens.eye[0], point[1] - lens.eye[1], point[2] - lens.eye[2]
    return -(east * r[0, 2] + north * r[1, 2] + up * r[2, 2]) / focal if focal > 0.0 else 0.0


@inlined
def in_image(point: tuple[float, float, float], lens: Lens) -> bool:
    """Test if a world point (3,) m is inside the image of `Camera.project`, or seen by a view all round."""
    if lens.optics.fx == 0.0:
        return True
    u, v, _ = image_point(lens, point)
    return bool(0.0 <= u <= lens.optics.width and 0.0 <= v <= lens.optics.height)
