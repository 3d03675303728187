"""Where somebody stands of whom trees, or the image's edge, leave only a part to see."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.compiled import Array
from tracking.detector import Frame, sizes, whole_covariances
from tracking.visibility import TARGET_HEIGHT, Forest

# Steps of the grid of places over the largest extent of a person.
_STEPS = 30
# What is smaller than this share of a mean silhouette is part of one, wherever it is.
_SMALL = 0.6
# A walking person over all headings, as horizontal circles: height above ground, radius [m] and the share of headings
# at which what lies between two circles covers what is behind it, legs being thin.
_LEVELS = np.array(
    [
        (0.00, 0.36, 0.00),
        (0.30, 0.34, 0.22),
        (0.60, 0.31, 0.35),
        (0.85, 0.29, 0.50),
        (1.10, 0.29, 0.65),
        (1.42, 0.28, 0.82),
        (1.55, 0.11, 0.85),
        (1.70, 0.09, 0.90),
    ]
)
_CIRCLE = np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0.0, 2 * math.pi, 12, endpoint=False)])


@dataclass(frozen=True)
class PartError:
    """How far what shows of a person differs from what a mean silhouette would show.

    Fitted by `python -m sim.calibration` so that errors squared over variances average one.
    """

    posture: float = 0.082  # m: what the centroid of a vanishing part moves by, beyond that of a whole silhouette
    rounding: float = 0.782  # pixels: what rounding moves the centroid of a single pixel by
    build: float = 0.083  # of the visible area: headings and strides
    fringe: float = 0.905  # pixels of area, of an outline of one pixel
    # Factors of the covariance by the share that is hidden: the rest of what a mean silhouette does not know.
    hidden: tuple[float, ...] = (0.0, 0.15, 0.35, 0.55, 0.75, 0.9, 1.0)
    excess: tuple[float, ...] = (0.692, 0.53, 0.568, 0.543, 0.852, 1.38, 2.56)


PART = PartError()


@dataclass(frozen=True, eq=False)
class Places:
    """Where the person may be of whom a part was seen, and what would show of them there, in pixels."""

    ground: Array  # (K, 2) m
    surprises: Array  # (K, 2) centroid that was seen minus that which would be, along the axes of a whole one's noise
    shares: Array  # (K,) of the silhouette that would show
    noise: Array  # (2,) variances of a whole silhouette's centroid along these axes
    cell: float  # m², variance within the cell that a place stands for
    area: float  # of a whole mean silhouette
    shown: float  # area that was seen
    scale: float  # pixels per m

    def posterior(self, error: PartError = PART) -> tuple[Array, Array, float]:
        """Mean (2,) m, covariance (2, 2) m² and the share hidden, all places being equally probable beforehand."""
        expected = np.maximum(self.shares * self.area, 0.3)
        hidden = 1.0 - np.minimum(self.shares, 1.0)
        part = (error.posture * self.scale * hidden) ** 2
        part += error.rounding**2 * np.maximum(1.0 / np.maximum(expected, 0.5) - 1.0 / self.area, 0.0)
        centroid = self.noise + part[:, None]
        area = (error.build * expected) ** 2 + error.fringe**2 * expected**0.5
        surprise = (self.surprises**2 / centroid + np.log(centroid)).sum(axis=1)
        surprise += (self.shown - self.shares * self.area) ** 2 / area + np.log(area)
        weights = np.exp(-0.5 * (surprise - surprise.min()))
        weights /= weights.sum()
        mean = weights @ self.ground
        offset = self.ground - mean
        share = float(weights @ hidden)
        excess = np.interp(share, error.hidden, error.excess)
        cell = self.cell * np.eye(2)  # without which a single place would be sure
        return mean, excess * ((offset * weights[:, None]).T @ offset + cell), share


def locate(frame: Frame, blob: Array, forest: Forest) -> tuple[Array, Array] | None:
    """Mean (2,) m and covariance (2, 2) m² of the place of a person who shows as pixels (K, 2); None for a whole one.

    Bayes' rule over a grid of places: at each, camera, map of trees and a mean silhouette say which part would show;
    its centroid and area are compared with those seen.
    """
    places = places_of(frame, blob, forest)
    return None if places is None else places.posterior()[:2]


def places_of(frame: Frame, blob: Array, forest: Forest) -> Places | None:
    """Where the person may be who shows as a blob (K, 2) of pixels; None if nothing seems hidden."""
    seen = np.asarray(blob.mean(axis=0))
    size = sizes(frame, seen[None])
    if len(blob) > _SMALL * size.areas[0] and _open(frame, _dilated(blob), forest).all():
        return None
    step = float(np.linalg.norm(size.extents[0])) / _STEPS
    if not math.isfinite(step):
        return None  # at the horizon, where nobody has a size
    centres, centroids, shares = _views(frame, seen, forest, step)
    if len(shares) == 0:
        return None
    axes, variances = _centroid_noise(frame, seen)
    scale = frame.camera.focal / (float(frame.pose.position[2]) - TARGET_HEIGHT)
    return Places(
        ground=frame.camera.ground_points(frame.pose, centres + seen, TARGET_HEIGHT),
        surprises=-centroids @ axes,
        shares=shares,
        noise=variances + step**2 / 12,
        cell=(step / scale) ** 2 / 12,
        area=float(size.areas[0]),
        shown=float(len(blob)),
        scale=scale,
    )


def _dilated(blob: Array) -> Array:
    ring = np.array([(i, j) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)])
    return np.asarray((blob[:, None] + ring).reshape(-1, 2))


def _open(frame: Frame, pixels: Array, forest: Forest) -> NDArray[np.bool_]:
    """Whether people would be seen at pixels (N, 2): inside the image and no tree before them (N,)."""
    ground = frame.camera.ground_points(frame.pose, pixels, TARGET_HEIGHT)
    points = np.column_stack([ground, np.full(len(ground), TARGET_HEIGHT)])
    free = np.all((pixels >= 0.0) & (pixels <= frame.camera.pixels), axis=1)
    free &= frame.camera.rays(frame.pose, pixels)[:, 2] * (TARGET_HEIGHT - frame.pose.position[2]) > 0.0
    return np.asarray(free & forest.visible(frame.pose.position, points)[0])


def _views(frame: Frame, seen: Array, forest: Forest, step: float) -> tuple[Array, Array, Array]:
    """Pixels (K, 2) of mid-heights at which something shows, its centroids (K, 2) and shares (K,) of the silhouette.

    Both relative to the pixel (2,) that was seen; `step` pixels between the mid-heights.
    """
    half = int(0.8 * _STEPS)
    axis = np.arange(-2 * half, 2 * half + 1) * step
    u, v = np.meshgrid(axis, axis)
    window = np.column_stack([u.ravel(), v.ravel()]) + seen
    free = _open(frame, window, forest).reshape(u.shape).astype(np.float32)
    silhouette, middle = _silhouette(frame, seen, step, half)
    x = np.arange(-half, half + 1, dtype=np.float32) * np.float32(step)
    sums = [
        cv2.filter2D(free, -1, kernel, borderType=cv2.BORDER_CONSTANT)
        for kernel in (silhouette, silhouette * x, silhouette * x[:, None])
    ]
    inner = slice(half // 2, len(axis) - half // 2)
    area, east, south, u, v = (np.asarray(a[inner, inner], dtype=float).ravel() for a in (*sums, u, v))
    shows = area > 0.01 * silhouette.sum()
    area, centres = area[shows], np.column_stack([u, v])[shows]
    moments = np.column_stack([east, south])[shows]
    return centres, centres + moments / area[:, None] - middle, area / float(silhouette.sum())


def _silhouette(frame: Frame, seen: Array, step: float, half: int) -> tuple[NDArray[np.float32], Array]:
    """Share of people who cover each cell (2 half + 1, 2 half + 1) round the mid-height, and its centroid (2,)."""
    ground = frame.camera.ground_points(frame.pose, seen, TARGET_HEIGHT)[0]
    rings = [np.column_stack([ground + r * _CIRCLE, np.full(len(_CIRCLE), h)]) for h, r in _LEVELS[:, :2]]
    corners = frame.camera.project(frame.pose, np.vstack(rings))[0].reshape(len(rings), -1, 2)
    fixed = np.round(((corners - seen) / step + half) * 16).astype(np.int32)
    cells = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    for k in range(1, len(rings)):
        hull = cv2.convexHull(fixed[k - 1 : k + 1].reshape(-1, 2))
        cv2.fillConvexPoly(cells, hull, float(_LEVELS[k, 2]), cv2.LINE_8, 4)
    x = np.arange(-half, half + 1) * step
    return cells, np.array([(cells * x).sum(), (cells * x[:, None]).sum()]) / cells.sum()


def _centroid_noise(frame: Frame, seen: Array) -> tuple[Array, Array]:
    """Axes (2, 2) and variances (2,) in the image [pixel²] of a whole person's centroid at a pixel (2,)."""
    points = seen + np.array([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
    here, right, left, down, up = frame.camera.ground_points(frame.pose, points, TARGET_HEIGHT)
    inverse = np.linalg.inv(np.column_stack([right - left, down - up]))
    variances, axes = np.linalg.eigh(inverse @ whole_covariances(frame, here[None])[0] @ inverse.T)
    return axes, variances
