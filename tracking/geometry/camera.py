"""Camera: projection, rays, ground points and footprint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tracking.geometry.distortion import WIDEST, Distortion, explain_fold, find_reach
from tracking.geometry.lens import Lens, Optics, focal_length, in_image, nearest_shown, plane_pixel, plane_point
from tracking.geometry.quaternions import rotation
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.matrices import apply
from tracking.numerics.trigonometry import arctan2, tan

ALL_ROUND = math.tau  # rad, angle of view of a camera that sees in all directions; it has no image
EDGE_POINTS = 16  # on each bent edge of an image
_NOT_GIVEN = Optics(0.0, 0.0, 0.0, 0.0, 0, 0)


@dataclass(frozen=True, eq=False)
class Pose:
    """Position and attitude in the world frame (east, north, up).

    The body axes of a camera are x to the image's right, y to its top, and z backwards, away from the scene. So the
    identity attitude is that of a nadir camera with north at the top of its image.

    Attributes:
        position: (3,) m: east, north and up.
        quaternion: (4,) xyzw, of unit length.
    """

    position: Array
    quaternion: Array

    @property
    def rotation(self) -> Array:
        """Rotation matrix from body to world (3, 3)."""
        return rotation(self.quaternion)

    @staticmethod
    def level(x: float, y: float, z: float) -> Pose:
        """A level pose, which for a camera is nadir with north at the top."""
        return Pose(np.array([x, y, z], dtype=float), np.array([0.0, 0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Camera:
    """A camera: by default a square pinhole image; `calibrated` makes any other.

    Pixel coordinates (u, v) run right and down from the top left corner; the centre of the first pixel is (0.5, 0.5).

    Attributes:
        fov: full angle of view [rad]; if calibrated, of the least square about the optical axis that has the image.
        pixels: number of pixels along each edge; if calibrated, along the rows.
        optics: focal lengths, principal point [pixels] and distortion; by default those of the square image.
    """

    fov: float
    pixels: int
    optics: Optics = _NOT_GIVEN

    def __post_init__(self) -> None:
        if math.isclose(self.fov, ALL_ROUND, rel_tol=1e-6):  # as 6.2831853
            object.__setattr__(self, "fov", ALL_ROUND)
        if not 0 < self.fov < math.pi and self.fov != ALL_ROUND:
            allowed = "expected more than 0 and less than pi rad, or 2 pi: all round"
            raise ValueError(f"fov: {self.fov:g} is not allowed; {allowed}")
        if not self.pixels >= 1:
            raise ValueError(f"pixels: {self.pixels} is not allowed; expected 1 or more")
        if self.optics is _NOT_GIVEN:
            focal = 0.0 if self.fov >= ALL_ROUND else self.pixels / 2 / tan(self.fov / 2)
            middle = self.pixels / 2
            optics = Optics(focal, focal, middle, middle, self.pixels, self.pixels)
            object.__setattr__(self, "optics", optics)

    def __deepcopy__(self, memo: object) -> Camera:
        """The camera itself, as nothing in it can be changed; each frame that a plug-in gets has one."""
        return self

    @staticmethod
    def calibrated(
        width: int,
        height: int,
        focal: tuple[float, float],
        centre: tuple[float, float],
        distortion: tuple[float, ...] = (),
    ) -> Camera:
        """A camera of which a calibration is known.

        Note: the principal point of a calibration by OpenCV lies at cx + 0.5, cy + 0.5 here.

        Args:
            width: Of the image [pixel].
            height: Of the image [pixel].
            focal: Focal lengths (fx, fy) [pixel].
            centre: Principal point (cx, cy) [pixel].
            distortion: Coefficients k1, k2, p1, p2, k3, k4, k5, k6, or a lens: `Distortion.of("equidistant", k)`.
        """
        bend = distortion if isinstance(distortion, Distortion) else Distortion.of("rational_polynomial", distortion)
        (fx, fy), (cx, cy) = focal, centre
        optics = Optics(float(fx), float(fy), float(cx), float(cy), int(width), int(height), bend)
        for name, value in optics._asdict().items():
            if name not in ("distortion", "reach") and not (
                math.isfinite(value) and (value > 0 or name in ("cx", "cy"))
            ):
                allowed = "a number" if name in ("cx", "cy") else "more than 0"
                raise ValueError(f"{name}: {value:g} is not allowed; expected {allowed}")
        if not all(math.isfinite(k) for k in bend):
            raise ValueError(f"distortion: {list(bend.coefficients)} is not allowed; expected finite numbers")
        optics = optics._replace(reach=find_reach(bend))
        slope = _find_widest_slope(optics)
        if not math.isfinite(slope):
            raise ValueError(explain_fold(bend))
        return Camera(2 * arctan2(slope, 1.0), optics.width, optics)

    @property
    def focal(self) -> float:
        """Focal length [pixel], the geometric mean of both directions; 0 for a view all round."""
        return focal_length(self.optics)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [pixel]."""
        return self.optics.width, self.optics.height

    @property
    def is_bent(self) -> bool:
        """True if the lens bends straight lines."""
        return self.optics.reach > 0.0

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper edge, on the image plane at distance 1, of a rectangle that the image contains.

        Without distortion it is the image. A lens leaves out the strips between its edges and the bent ones.
        """
        if self.optics == Camera(self.fov, self.pixels).optics:
            slope = tan(self.fov / 2)
            return -slope, slope, -slope, slope
        bottom, right, top, left = np.split(self.slopes(self.shown(_outline(self.optics, closed=True))), 4)
        edges = left[:, 0].max(), right[:, 0].min(), -bottom[:, 1].min(), -top[:, 1].max()
        west, east, south, north = map(float, edges)
        return west, east, south, north

    @property
    def corners(self) -> Array:
        """Corners (4, 2) of the image, anticlockwise from the lower left one."""
        width, height = map(float, self.size)
        return np.array([[0.0, height], [width, height], [width, 0.0], [0.0, 0.0]])

    def project(self, pose: Pose, points: Array) -> tuple[Array, Array]:
        """Pixels (N, 2) and depths along the optical axis (N,) m of world points (N, 3) m.

        A point behind the camera has a depth <= 0 and no meaningful pixel, a point beyond the reach of a lens NaN.
        """
        body = apply(pose.rotation.T, np.atleast_2d(points) - pose.position)
        depth = -body[:, 2]
        safe = np.where(depth > 0, depth, np.nan)
        o, right, down = self.optics, body[:, 0], -body[:, 1]
        if self.is_bent:
            return _find_plane_pixels(o, np.column_stack([right / safe, down / safe])), depth
        return np.column_stack([o.cx + o.fx * right / safe, o.cy + o.fy * down / safe]), depth

    def sees(self, pose: Pose, points: Array) -> Flags:
        """Flags (N,) of world points (N, 3) m that are inside the image, whether hidden or not."""
        return _are_in_image(np.atleast_2d(points), self.lens(pose))

    def lens(self, pose: Pose) -> Lens:
        """This camera at a pose."""
        x, y, z = np.asarray(pose.position, dtype=float).tolist()
        return Lens((x, y, z), pose.rotation, self.optics)

    def rays(self, pose: Pose, uv: Array) -> Array:
        """Directions in the world (N, 3), of unit depth along the optical axis, through pixels (N, 2).

        They are NaN for pixels that a lens cannot show.
        """
        offset = self.slopes(uv)
        body = np.column_stack([offset[:, 0], -offset[:, 1], -np.ones(len(offset))])
        return apply(pose.rotation, body)

    def slopes(self, uv: Array) -> Array:
        """Points (N, 2), to the right and down, of pixels (N, 2) on the image plane at distance 1."""
        return _find_plane_points(self.optics, np.atleast_2d(np.asarray(uv, dtype=float)))

    def ground_points(self, pose: Pose, uv: Array, height: float = 0.0) -> Array:
        """World points (N, 2) m where rays through pixels meet the horizontal plane at `height` m; else NaN."""
        return meet_plane(pose, self.rays(pose, uv), height)

    def footprint(self, pose: Pose, height: float = 0.0) -> Array:
        """Outline (N, 2) m of the image on the plane at `height` m, anticlockwise; NaN if above the horizon.

        Straight edges have their four corners alone, bent edges `EDGE_POINTS` points each.
        """
        return self.ground_points(pose, self.outline, height)

    @property
    def outline(self) -> Array:
        """The image's outline (N, 2) as of `footprint`, beginning at the lower left corner."""
        return self.shown(_outline(self.optics)) if self.is_bent else self.corners

    def shown(self, uv: Array) -> Array:
        """Pixels (N, 2), of which those that an equidistant lens does not show are moved to its rim."""
        return _find_shown(self.optics, np.asarray(uv, dtype=float))


def meet_plane(pose: Pose, rays: Array, height: float = 0.0) -> Array:
    """World points (N, 2) m where rays (N, 3) from a camera meet the horizontal plane at `height` m; else NaN."""
    down = height - pose.position[2]
    scale = down / np.where(rays[:, 2] * down > 0.0, rays[:, 2], np.nan)
    return np.asarray(pose.position[:2] + scale[:, None] * rays[:, :2])


class Look(NamedTuple):
    """What a frame may show: the camera that took it, and its pose then."""

    camera: Camera
    pose: Pose


def _outline(optics: Optics, *, closed: bool = False) -> Array:
    """Points along the edges of an image, anticlockwise from the lower left corner, `EDGE_POINTS` on each edge.

    closed: whether each edge has both its corners, so that it has one point more.
    """
    along = np.arange(EDGE_POINTS + closed) / EDGE_POINTS
    zero, one = np.zeros(len(along)), np.ones(len(along))
    sides = [(along, one), (one, 1.0 - along), (1.0 - along, zero), (zero, along)]
    return np.concatenate([np.column_stack(side) for side in sides]) * [optics.width, optics.height]


def _find_widest_slope(optics: Optics) -> float:
    """The largest coordinate on the image plane at distance 1; NaN if the lens folds the image over.

    An equidistant lens shows a circle, which has at least the middle of an edge unless it ends at `WIDEST`.
    """
    slopes = np.abs(_find_plane_points(optics, _outline(optics)))
    shows = optics.distortion.equidistant and (
        optics.reach >= WIDEST * WIDEST or np.isfinite(slopes[EDGE_POINTS // 2 :: EDGE_POINTS]).any()
    )
    return math.sqrt(optics.reach) if shows and np.isnan(slopes).any() else float(np.max(slopes))


@compiled
def _find_shown(optics: Optics, uv: Array) -> Array:
    out = np.empty((len(uv), 2))
    for k in range(len(uv)):
        out[k, 0], out[k, 1] = nearest_shown(optics, uv[k, 0], uv[k, 1])
    return out


@compiled
def _find_plane_points(optics: Optics, uv: Array) -> Array:
    out = np.empty((len(uv), 2))
    for k in range(len(uv)):
        out[k, 0], out[k, 1] = plane_point(optics, uv[k, 0], uv[k, 1])
    return out


@compiled
def _find_plane_pixels(optics: Optics, points: Array) -> Array:
    out = np.empty((len(points), 2))
    for k in range(len(points)):
        out[k, 0], out[k, 1] = plane_pixel(optics, points[k, 0], points[k, 1])
    return out


@compiled
def _are_in_image(points: Array, lens: Lens) -> Flags:
    seen = np.empty(len(points), dtype=np.bool_)
    for k in range(len(points)):
        seen[k] = in_image((points[k, 0], points[k, 1], points[k, 2]), lens)
    return seen
