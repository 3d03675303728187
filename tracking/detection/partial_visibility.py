"""Location of people hidden in part by trees or the image's edge: Bayes' rule over a grid of places."""

import math
from typing import NamedTuple

import numpy as np

from tracking.detection.clearing import Clearing, Pair, make_clearing, to_clearing_axes
from tracking.detection.detection_errors import whole_covariances
from tracking.detection.detector import Frame
from tracking.detection.person_size import sizes_at
from tracking.detection.shadows import add_shadows, is_open
from tracking.detection.silhouette import TALLEST, Silhouette, compute_visible_moments, make_silhouette
from tracking.geometry.lens import Lens, ground_point
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp, log

# A blob smaller than this share of a mean silhouette shows only part of a person, wherever it is.
_SMALL = 0.6
# Numbers of places: first in the whole possible region, then in the region that remains.
_COARSE, _FINE = 100, 200
# A person is taken to be invisible if less than this share of the silhouette would show.
_LEAST = 0.01
# Places with a deviance that exceeds the least by more than this, a probability ratio of e^-10, are left out.
_IMPROBABLE = 20.0


class PartError(NamedTuple):
    """Error model of the visible part of a person, compared with the visible part of a mean silhouette.

    `tests/helpers/covariance_fit.py` fits it so that squared errors over variances average one.
    """

    posture: float = 0.182  # m: additional standard deviation of the centroid of a vanishing part
    rounding: float = 0.572  # pixels: standard deviation that rounding gives the centroid of a single pixel
    fringe: float = 0.876  # pixels: standard deviation of the area of a part of one pixel
    limb: float = 0.07  # relative standard deviation of a whole silhouette's area, by headings and strides
    # Factors that correct the covariance of the model above, by a pixel's edge on the ground [m] and the hidden share.
    pixel: tuple[float, ...] = (0.083, 0.111, 0.167, 0.222)
    hidden: tuple[float, ...] = (0.0, 0.15, 0.35, 0.55, 0.75, 0.9)
    excess: tuple[tuple[float, ...], ...] = (
        (0.331, 0.655, 0.731, 0.703, 0.885, 1.678),
        (0.416, 0.633, 0.771, 0.614, 0.795, 1.298),
        (0.537, 0.562, 0.63, 0.642, 0.775, 0.987),
        (1.04, 0.455, 0.728, 0.722, 0.788, 0.972),
    )

    def factor(self, pixel: float, hidden: float) -> float:
        """Factor of the covariance for a pixel's edge [m] on the ground and the hidden share."""
        return float(np.interp(pixel, self.pixel, [np.interp(hidden, self.hidden, row) for row in self.excess]))


PART_ERROR = PartError()


class Seen(NamedTuple):
    """Observed area of a blob, and the covariance that the centroid of a whole silhouette would have."""

    whole: Array  # (2, 2) m², along the axes of the clearing
    pixel: Array  # (2, 2) m²: F Fᵀ of the clearing's footprint F
    area: float  # pixels, of a whole mean silhouette
    shown: float  # pixels, of the blob


class Places(NamedTuple):
    """Grid of possible places of a person seen in part, and the part of the silhouette that each would show.

    Coordinates (u, v) [m] are relative to a clearing around the blob.
    """

    clearing: Clearing
    seen: Seen
    u: Array  # (N,)
    v: Array  # (M,)
    centroids: Array  # (M, N, 2) of the part that would show
    shares: Array  # (M, N) of the silhouette that would show
    cell: tuple[float, float]  # m: edges of a place

    @property
    def pixel(self) -> float:
        """Edge of a pixel on the ground, m."""
        (a, b), (c, d) = self.clearing.footprint.tolist()
        return math.sqrt(abs(a * d - b * c))

    def posterior(self, error: PartError = PART_ERROR) -> tuple[Array, Array, float]:
        """Mean (2,) m, covariance (2, 2) m² and the hidden share of a person, with a uniform prior over places."""
        mean, covariance, hidden = _compute_moments(self, _compute_deviances(self, error))
        return mean, error.factor(self.pixel, hidden) * covariance, hidden


def find_places(frame: Frame, blob: Array, forest: Forest) -> Places | None:
    """Possible places of the person that a blob (K, 2) of pixels is from; None if nothing seems hidden.

    Camera, map of trees and a mean silhouette predict the visible part at each place; its centroid and area are
    compared with the blob's.
    """
    lens = frame.camera.lens(frame.pose)
    if lens.eye[2] <= TALLEST:
        return None  # the camera is not above people's heads
    hidden, clearing, area = _find_surroundings(lens, blob, forest.blockers)
    if not hidden:
        return None
    x, y = clearing.away
    whole = whole_covariances(lens, np.array([clearing.origin]))[0]
    along = _transform_covariance(np.array([[x, y], [-y, x]]), whole)
    pixel = _transform_covariance(clearing.footprint, np.eye(2))
    places = _cover_places(clearing, Seen(along, pixel, area, len(blob)), lens.eye[2], PART_ERROR)
    return places if places.shares.max() >= _LEAST else None


@compiled
def _find_surroundings(lens: Lens, blob: Array, cylinders: Array) -> tuple[bool, Clearing, float]:
    """Flag for possible occlusion of a blob's (K, 2) person, clearing around its centroid, and a whole person's area.

    The clearing has the shadows that may matter; the area is in pixels.
    """
    centre = blob[:, 0].mean(), blob[:, 1].mean()
    clearing, area = make_clearing(lens, centre), sizes_at(lens, np.array([centre])).areas[0]
    growth = (lens.eye[2] - TARGET_HEIGHT) / (lens.eye[2] - TALLEST)
    clearing = add_shadows(clearing, lens.eye, cylinders, 2.5 + 2 * clearing.distance * (growth - 1.0))
    # At the horizon sizes are not finite.
    placed = bool(np.isfinite(clearing.footprint).all() and np.isfinite(area))
    return placed and (len(blob) <= _SMALL * area or not _is_all_open(lens, clearing, blob)), clearing, area


@compiled
def _transform_covariance(outer: Array, inner: Array) -> Array:
    """A B Aᵀ of two matrices (2, 2)."""
    out = np.zeros((2, 2))
    for i in range(2):
        for j in range(2):
            for k in range(2):
                for m in range(2):
                    out[i, j] += outer[i, k] * inner[k, m] * outer[j, m]
    return out


@compiled
def _is_all_open(lens: Lens, clearing: Clearing, blob: Array) -> bool:
    """Test if nothing hides any place that the pixels (K, 2) of a blob, or those next to them, show."""
    left, top = int(blob[:, 0].min()) - 1, int(blob[:, 1].min()) - 1
    near = np.zeros((int(blob[:, 1].max()) + 2 - top, int(blob[:, 0].max()) + 2 - left), dtype=np.bool_)
    for k in range(len(blob)):
        row, column = int(blob[k, 1]) - top, int(blob[k, 0]) - left
        near[row - 1 : row + 2, column - 1 : column + 2] = True
    for row in range(near.shape[0]):
        for column in range(near.shape[1]):
            if near[row, column]:
                x, y = ground_point(lens, (left + column + 0.5, top + row + 0.5), TARGET_HEIGHT)
                u, v = to_clearing_axes(clearing, x, y)
                if not is_open(clearing, u, v):
                    return False
    return True


@compiled
def _cover_places(clearing: Clearing, seen: Seen, altitude: float, error: PartError) -> Places:
    """Grid that covers all possible places of the person and no more."""
    silhouette = make_silhouette(clearing.distance, altitude)
    rounding = error.rounding * error.rounding * max(seen.pixel[0, 0], seen.pixel[1, 1])
    slack = 4 * math.sqrt(max(seen.whole[0, 0], seen.whole[1, 1]) + error.posture * error.posture + rounding)
    half = silhouette.half + slack
    low, high = (-silhouette.high - slack, -half), (slack - silhouette.low, half)
    # `int`, because Numba compiles a function anew for each constant argument.
    coarse = _make_grid(clearing, seen, silhouette, low, high, int(_COARSE))
    deviances = _compute_deviances(coarse, error)
    least = deviances.min()
    if least == math.inf:
        return coarse
    low, high = (math.inf, math.inf), (-math.inf, -math.inf)
    for i in range(len(coarse.v)):
        for j in range(len(coarse.u)):
            if deviances[i, j] <= least + _IMPROBABLE:
                low = min(low[0], coarse.u[j] - coarse.cell[0]), min(low[1], coarse.v[i] - coarse.cell[1])
                high = max(high[0], coarse.u[j] + coarse.cell[0]), max(high[1], coarse.v[i] + coarse.cell[1])
    return _make_grid(clearing, seen, silhouette, low, high, int(_FINE))


@compiled
def _make_grid(clearing: Clearing, seen: Seen, silhouette: Silhouette, low: Pair, high: Pair, count: int) -> Places:
    """Grid of about `count` places in the box from the corner `low` to the corner `high`, (u, v) m."""
    width, height = high[0] - low[0], high[1] - low[1]
    columns = min(max(round(math.sqrt(count * width / height)), 6), count // 6)
    rows = count // columns
    cell = width / columns, height / rows
    u = low[0] + cell[0] * (np.arange(columns, dtype=np.float64) + 0.5)
    v = low[1] + cell[1] * (np.arange(rows, dtype=np.float64) + 0.5)
    shows = compute_visible_moments(clearing, silhouette, u, v)
    centroids, shares = np.empty((rows, columns, 2)), shows[:, :, 0] / silhouette.area
    for i in range(rows):
        for j in range(columns):
            area = shows[i, j, 0]
            centroids[i, j, 0] = u[j] + shows[i, j, 1] / area - silhouette.middle
            centroids[i, j, 1] = v[i] + shows[i, j, 2] / area
    return Places(clearing, seen, u, v, centroids, shares, cell)


@compiled
def _compute_deviances(places: Places, error: PartError) -> Array:
    """Deviances (M, N) of places, twice the negative log-likelihood up to a constant; inf where too little shows."""
    posture, rounding, fringe, limb = error.posture, error.rounding, error.fringe, error.limb
    seen, cell = places.seen, places.cell
    out = np.full(places.shares.shape, math.inf)
    for i in range(len(places.v)):
        for j in range(len(places.u)):
            share = places.shares[i, j]
            if share < _LEAST:
                continue
            # A mean silhouette predicts half a person well, and a tenth badly.
            lack = max(1.0 - share, 0.0)
            hidden = posture * lack * lack * lack
            hidden *= hidden
            expected = max(share * seen.area, 0.3)
            few = rounding * rounding * max(1.0 / max(expected, 0.5) - 1.0 / seen.area, 0.0)
            a = seen.whole[0, 0] + hidden + few * seen.pixel[0, 0] + cell[0] * cell[0] / 12
            b = seen.whole[0, 1] + few * seen.pixel[0, 1]
            c = seen.whole[1, 1] + hidden + few * seen.pixel[1, 1] + cell[1] * cell[1] / 12
            x, y = places.centroids[i, j, 0], places.centroids[i, j, 1]
            volume = a * c - b * b
            area = fringe * fringe * math.sqrt(expected) + limb * limb * expected * seen.area
            out[i, j] = (c * x * x - 2 * b * x * y + a * y * y) / volume + log(volume * area)
            surplus = seen.shown - share * seen.area
            out[i, j] += surplus * surplus / area
    return out


@compiled
def _compute_moments(places: Places, deviances: Array) -> tuple[Array, Array, float]:
    """Mean (2,) m, covariance (2, 2) m² and expected hidden share, from deviances (M, N)."""
    least = deviances.min()
    total = along = across = uu = uv = vv = hidden = 0.0
    for i in range(len(places.v)):
        for j in range(len(places.u)):
            weight = exp(0.5 * (least - deviances[i, j]))
            u, v = weight * places.u[j], weight * places.v[i]
            total, along, across = total + weight, along + u, across + v
            uu, uv, vv = uu + u * places.u[j], uv + u * places.v[i], vv + v * places.v[i]
            hidden += weight * (1.0 - min(places.shares[i, j], 1.0))
    u, v = along / total, across / total
    # Add the variance within cells, so that a single place has a variance, too.
    cell = places.cell
    uu, uv, vv = uu / total - u * u + cell[0] * cell[0] / 12, uv / total - u * v, vv / total - v * v
    vv += cell[1] * cell[1] / 12
    (x, y), (cos, sin) = places.clearing.origin, places.clearing.away
    xx, yy = cos * cos * uu - 2 * cos * sin * uv + sin * sin * vv, sin * sin * uu + 2 * cos * sin * uv + cos * cos * vv
    xy = cos * sin * (uu - vv) + (cos * cos - sin * sin) * uv
    mean = np.array([x + cos * u - sin * v, y + sin * u + cos * v])
    return mean, np.array([[xx, xy], [xy, yy]]), hidden / total
