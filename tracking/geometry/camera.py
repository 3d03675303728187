"""Pinhole camera: projection, rays, ground points and footprint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracking.numerics.compiled import Array, compiled
from tracking.numerics.elementary import tan
from tracking.numerics.matrices import applied

ALL_ROUND = math.tau  # rad, angle of view of who sees in all directions; of such a camera there is no image


class Lens(NamedTuple):
    """A camera and its pose, as compiled code takes them."""

    eye: tuple[float, float, float]  # m
    rotation: Array  # (3, 3) from body to world
    focal: float  # pixels; 0 for a view all round
    pixels: int  # along each edge


@dataclass(frozen=True, eq=False)
class Pose:
    """Position and attitude in the world frame (east, north, up).

    For a camera the body axes are: x to the image's right, y to its top, z backwards, away from the scene.
    So the identity attitude is a nadir camera whose image has north at the top.
    """

    position: Array  # (3,) m
    quaternion: Array  # (4,) xyzw, unit

    @property
    def rotation(self) -> Array:
        """Rotation matrix from body to world (3, 3)."""
        return rotation(self.quaternion)

    @staticmethod
    def level(x: float, y: float, z: float) -> Pose:
        """A level pose: a nadir camera with north at the top."""
        return Pose(np.array([x, y, z], dtype=float), np.array([0.0, 0.0, 0.0, 1.0]))


@compiled
def rotation(quaternion: Array) -> Array:
    """Rotation matrix from body to world (3, 3) of a unit quaternion xyzw (4,)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@dataclass(frozen=True)
class Camera:
    """A square pinhole image without distortion.

    Pixel coordinates (u, v) run right and down from the top left corner; the centre of the first pixel is (0.5, 0.5).
    """

    fov: float  # full angle of view, rad
    pixels: int  # along each edge

    @property
    def focal(self) -> float:
        """Focal length [pixel]; 0 for a view all round."""
        if self.fov >= ALL_ROUND:
            return 0.0
        return self.pixels / 2 / tan(self.fov / 2)

    def project(self, pose: Pose, points: Array) -> tuple[Array, Array]:
        """Pixels (N, 2) and depths along the optical axis (N,) m of world points (N, 3) m.

        A point behind the camera has a depth <= 0 and no meaningful pixel.
        """
        body = applied(pose.rotation.T, np.atleast_2d(points) - pose.position)
        depth = -body[:, 2]
        safe = np.where(depth > 0, depth, np.nan)
        uv = self.pixels / 2 + self.focal * np.column_stack([body[:, 0], -body[:, 1]]) / safe[:, None]
        return uv, depth

    def sees(self, pose: Pose, points: Array) -> NDArray[np.bool_]:
        """Whether world points (N, 3) m fall inside the image, occlusion aside (N,)."""
        return _in_image(np.atleast_2d(points), self.lens(pose))

    def lens(self, pose: Pose) -> Lens:
        """This camera at a pose."""
        x, y, z = np.asarray(pose.position, dtype=float).tolist()
        return Lens((x, y, z), pose.rotation, self.focal, self.pixels)

    def rays(self, pose: Pose, uv: Array) -> Array:
        """Directions in the world (N, 3), of unit depth along the optical axis, through pixels (N, 2)."""
        offset = (np.atleast_2d(uv) - self.pixels / 2) / self.focal
        body = np.column_stack([offset[:, 0], -offset[:, 1], -np.ones(len(offset))])
        return applied(pose.rotation, body)

    def ground_points(self, pose: Pose, uv: Array, height: float = 0.0) -> Array:
        """World points (N, 2) m where the pixels' rays meet the horizontal plane at `height` m."""
        rays = self.rays(pose, uv)
        scale = (height - pose.position[2]) / rays[:, 2]
        return np.asarray(pose.position[:2] + scale[:, None] * rays[:, :2])

    def footprint(self, pose: Pose, height: float = 0.0) -> Array:
        """Corners (4, 2) m of the image on the horizontal plane at `height` m, anticlockwise."""
        n = float(self.pixels)
        return self.ground_points(pose, np.array([[0, n], [n, n], [n, 0], [0, 0]]), height)


@compiled
def ground_point(lens: Lens, pixel: tuple[float, float], height: float) -> tuple[float, float]:
    """Where the line through a pixel (u, v) meets the horizontal plane at `height` m, be it behind the camera [m]."""
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


@compiled
def in_image(point: tuple[float, float, float], lens: Lens) -> bool:
    """Whether a world point (3,) m falls inside the image of `Camera.project`, or is seen by a view all round."""
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


@compiled
def _in_image(points: Array, lens: Lens) -> NDArray[np.bool_]:
    seen = np.empty(len(points), dtype=np.bool_)
    for k in range(len(points)):
        seen[k] = in_image((points[k, 0], points[k, 1], points[k, 2]), lens)
    return seen
