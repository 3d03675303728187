"""Pinhole camera: projection, rays, ground points and footprint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tracking.geometry.lens import Lens, in_image
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.matrices import apply
from tracking.numerics.trigonometry import tan

ALL_ROUND = math.tau  # rad, angle of view of a camera that sees in all directions; it has no image


@dataclass(frozen=True, eq=False)
class Pose:
    """Position and attitude in the world frame (east, north, up).

    The body axes of a camera are x to the image's right, y to its top, and z backwards, away from the scene. So the
    identity attitude is that of a nadir camera with north at the top of its image.
    """

    position: Array  # (3,) m
    quaternion: Array  # (4,) xyzw, unit

    @property
    def rotation(self) -> Array:
        """Rotation matrix from body to world (3, 3)."""
        return rotation(self.quaternion)

    @staticmethod
    def level(x: float, y: float, z: float) -> Pose:
        """A level pose, which for a camera is nadir with north at the top."""
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

    def __post_init__(self) -> None:
        if math.isclose(self.fov, ALL_ROUND, rel_tol=1e-6):  # as 6.2831853
            object.__setattr__(self, "fov", ALL_ROUND)
        if not 0 < self.fov < math.pi and self.fov != ALL_ROUND:
            allowed = "expected more than 0 and less than pi rad, or 2 pi: all round"
            raise ValueError(f"fov: {self.fov:g} is not allowed; {allowed}")
        if not self.pixels >= 1:
            raise ValueError(f"pixels: {self.pixels} is not allowed; expected 1 or more")

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
        body = apply(pose.rotation.T, np.atleast_2d(points) - pose.position)
        depth = -body[:, 2]
        safe = np.where(depth > 0, depth, np.nan)
        uv = self.pixels / 2 + self.focal * np.column_stack([body[:, 0], -body[:, 1]]) / safe[:, None]
        return uv, depth

    def sees(self, pose: Pose, points: Array) -> Flags:
        """Flags (N,) of world points (N, 3) m that are inside the image, whether hidden or not."""
        return _are_in_image(np.atleast_2d(points), self.lens(pose))

    def lens(self, pose: Pose) -> Lens:
        """This camera at a pose."""
        x, y, z = np.asarray(pose.position, dtype=float).tolist()
        return Lens((x, y, z), pose.rotation, self.focal, self.pixels)

    def rays(self, pose: Pose, uv: Array) -> Array:
        """Directions in the world (N, 3), of unit depth along the optical axis, through pixels (N, 2)."""
        offset = (np.atleast_2d(uv) - self.pixels / 2) / self.focal
        body = np.column_stack([offset[:, 0], -offset[:, 1], -np.ones(len(offset))])
        return apply(pose.rotation, body)

    def ground_points(self, pose: Pose, uv: Array, height: float = 0.0) -> Array:
        """World points (N, 2) m where rays through pixels meet the horizontal plane at `height` m; else NaN."""
        rays, down = self.rays(pose, uv), height - pose.position[2]
        scale = down / np.where(rays[:, 2] * down > 0.0, rays[:, 2], np.nan)
        return np.asarray(pose.position[:2] + scale[:, None] * rays[:, :2])

    def footprint(self, pose: Pose, height: float = 0.0) -> Array:
        """Corners (4, 2) m of the image on the plane at `height` m, anticlockwise; NaN if above the horizon."""
        n = float(self.pixels)
        return self.ground_points(pose, np.array([[0, n], [n, n], [n, 0], [0, 0]]), height)


@compiled
def _are_in_image(points: Array, lens: Lens) -> Flags:
    seen = np.empty(len(points), dtype=np.bool_)
    for k in range(len(points)):
        seen[k] = in_image((points[k, 0], points[k, 1], points[k, 2]), lens)
    return seen
