"""Covariance of a detection: error models of people seen whole and of blobs that were split."""

import math
from typing import NamedTuple

import numpy as np

from tracking.geometry.lens import Lens, focal_length, plane_slopes
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp_each, power


@compiled
def _interpolate(x: float, places: tuple[float, ...], values: tuple[float, ...]) -> float:
    """As `np.interp` at one x, which takes a second to compile."""
    if x <= places[0]:
        return values[0]
    if x >= places[-1]:
        return values[-1]
    j = 0
    while x >= places[j + 1]:
        j += 1
    return (values[j + 1] - values[j]) / (places[j + 1] - places[j]) * (x - places[j]) + values[j]


class WholeError(NamedTuple):
    """Error model of people seen whole: constants of the variance at nadir, and their growth off nadir.

    The growths are coefficients of t and t², where t is the tangent of the angle off nadir.
    `tests/helpers/covariance_fit.py` fits them so that squared errors over variances average one.
    """

    posture: float = 0.021  # m, standard deviation: limbs and stride
    rounding: float = 1.633  # in standard deviations of one pixel's rounding, if pixels are large
    limb: float = 0.4  # m: errors of pixels smaller than this average over a silhouette
    radial_posture: tuple[float, float] = (-2.961, 6.517)
    radial_rounding: tuple[float, float] = (-0.206, 0.973)
    tangential_posture: tuple[float, float] = (0.282, 0.0)
    tangential_rounding: tuple[float, float] = (-1.46, 0.561)
    # Factors of a detection's covariance by t, which correct the polynomials of second degree that planners use.
    tangents: tuple[float, ...] = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
    excess: tuple[float, ...] = (0.893, 0.987, 1.045, 1.057, 0.909, 0.906)
    # t near the corners of level images of 60 degrees. Beyond, where only tilted cameras see, growths continue as
    # powers of t: radial posture and rounding, then tangential.
    corner: float = 0.8
    powers: tuple[float, float, float, float] = (2.74, -0.027, -3.592, -0.115)
    stretch: float = 2.257  # power of a pixel's length over its width on the ground that coarsens a silhouette's sides

    def variances(self, gsd: Array) -> tuple[Array, Array]:
        """Radial and tangential variance as polynomials in t, (..., 3) m² each, for pixels of edge gsd (...) m."""
        pixels = np.square(gsd)
        posture = np.full(np.shape(gsd), self.posture * self.posture)
        rounding = self.rounding * self.rounding * pixels / 12 * pixels / (self.limb * self.limb + pixels)

        def polynomial(p: tuple[float, float], q: tuple[float, float]) -> Array:
            return np.asarray(np.multiply.outer(posture, [1.0, *p]) + np.multiply.outer(rounding, [1.0, *q]))

        radial = polynomial(self.radial_posture, self.radial_rounding)
        return radial, polynomial(self.tangential_posture, self.tangential_rounding)

    @compiled
    def detection_variances(self, tangents: Array, footprints: Array) -> Array:
        """Radial and tangential variances (N, 2) m² of detections by a camera at any attitude.

        footprints (N, 2) m as from `pixel_footprints`. For a level camera both are gsd, and variances up to `corner`
        are the polynomials of `variances` times `excess`. Beyond `corner`, growths are powers.
        """
        posture, limb = self.posture * self.posture, self.limb * self.limb
        rounding = self.rounding * self.rounding / 12
        growths = self.radial_posture, self.radial_rounding, self.tangential_posture, self.tangential_rounding
        growth = np.empty(4)
        out = np.empty((len(tangents), 2))
        for k in range(len(tangents)):
            excess = _interpolate(tangents[k], self.tangents, self.excess)
            within, beyond = min(tangents[k], self.corner), max(tangents[k] / self.corner, 1.0)
            for j in range(4):
                growth[j] = 1.0 + within * (growths[j][0] + growths[j][1] * within)
                growth[j] *= power(beyond, self.powers[j])
            # Rounding averages over a silhouette's pixels. On the long sides it averages over the pixels along its
            # length, which are fewer if pixels are long.
            area, longer = footprints[k, 0] * footprints[k, 1], footprints[k, 0] / footprints[k, 1]
            for j in range(2):
                grain = area * power(longer, j * self.stretch)
                pixel = rounding * footprints[k, j] * footprints[k, j] * grain / (limb + grain)
                out[k, j] = excess * (posture * growth[2 * j] + pixel * growth[2 * j + 1])
        return out


WHOLE = WholeError()


class SplitError(NamedTuple):
    """Additional error of detections from one blob that was split; fitted like `WholeError`, to pairs that touch."""

    base: float = 0.196  # m, standard deviation where the parts coincide
    radial: float = 1.487  # m, standard deviation per unit of the tangent of the angle off nadir
    tangential: float = 0.608  # m, likewise
    decay: float = 8.016  # exponent by which the variance falls per extent of a person between the parts

    def variances(self, tangents: Array, gaps: Array) -> Array:
        """Radial and tangential variances (N, 2) m² at gaps (N,), in extents of a person, between the parts."""
        growth = np.square(np.multiply.outer(tangents, [self.radial, self.tangential]))
        return exp_each(-self.decay * gaps)[:, None] * (self.base * self.base + growth)


SPLIT = SplitError()


class LeafError(NamedTuple):
    """Additional error of people hidden in part by leaves, by chance; fitted to such people, as `WholeError` is."""

    # Standard deviations in extents of a person, by the share of the person's area that does not show.
    lacking: tuple[float, ...] = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
    radial: tuple[float, ...] = (0.006, 0.036, 0.084, 0.129, 0.188, 0.314)
    tangential: tuple[float, ...] = (0.001, 0.024, 0.059, 0.082, 0.149, 0.271)

    def variances(self, extents: Array, lacking: Array) -> Array:
        """Radial and tangential variances (N, 2) m² of people of extents (N, 2) m; a share (N,) of each is hidden."""
        parts = np.column_stack([np.interp(lacking, self.lacking, row) for row in (self.radial, self.tangential)])
        return np.asarray(np.square(extents * parts))


LEAF = LeafError()


@compiled
def sight_axes(lens: Lens, ground: Array) -> tuple[Array, Array]:
    """Axes along and across the line of sight to ground points (N, 2) m, and tangents of the angle off nadir.

    The axes (N, 2, 2) are unit vectors in columns; the tangents are (N,).
    """
    axes, tangents = np.empty((len(ground), 2, 2)), np.empty(len(ground))
    for k in range(len(ground)):
        x, y = ground[k, 0] - lens.eye[0], ground[k, 1] - lens.eye[1]
        distance = math.sqrt(x * x + y * y)
        cos, sin = (x / distance, y / distance) if distance > 0.0 else (1.0, 0.0)
        axes[k, 0, 0], axes[k, 0, 1], axes[k, 1, 0], axes[k, 1, 1] = cos, -sin, sin, cos
        tangents[k] = distance / abs(lens.eye[2] - TARGET_HEIGHT)
    return axes, tangents


def covariances_along(axes: Array, variances: Array) -> Array:
    """Covariances (N, 2, 2) with variances (N, 2) along axes in columns (N, 2, 2)."""
    return np.asarray(np.sum(axes[:, :, None] * axes[:, None] * variances[:, None, None], axis=-1))


@compiled
def pixel_footprints(lens: Lens, ground: Array) -> Array:
    """Extents (N, 2) m on the ground, along and across the line of sight, of a pixel at ground points (N, 2) m.

    An error of one pixel in each direction of the image has these standard deviations.
    """
    (axes, _), rotation, out = sight_axes(lens, ground), lens.rotation, np.empty((len(ground), 2))
    focal = focal_length(lens.optics)
    for k in range(len(ground)):
        x, y, z = ground[k, 0] - lens.eye[0], ground[k, 1] - lens.eye[1], TARGET_HEIGHT - lens.eye[2]
        depth = -(x * rotation[0, 2] + y * rotation[1, 2] + z * rotation[2, 2])
        cos, sin = axes[k, 0, 0], axes[k, 1, 0]
        radial = tangential = 0.0
        # The ray r through a pixel, of unit depth, meets the plane at p = eye + s r, with s = depth. As s r_z is
        # constant, dp = s (dr - r dr_z / r_z); and dr are the image's axes in the world, over the focal length.
        right = (x * rotation[0, 0] + y * rotation[1, 0] + z * rotation[2, 0]) / depth
        above = (x * rotation[0, 1] + y * rotation[1, 1] + z * rotation[2, 1]) / depth
        xu, xv, yu, yv = plane_slopes(lens.optics, right, -above)
        for a, b in ((xu, yu), (xv, yv)):
            east = a * (rotation[0, 0] - rotation[2, 0] * x / z) - b * (rotation[0, 1] - rotation[2, 1] * x / z)
            north = a * (rotation[1, 0] - rotation[2, 0] * y / z) - b * (rotation[1, 1] - rotation[2, 1] * y / z)
            along, across = cos * east + sin * north, cos * north - sin * east
            radial, tangential = radial + along * along, tangential + across * across
        out[k, 0], out[k, 1] = depth / focal * math.sqrt(radial), depth / focal * math.sqrt(tangential)
    return out


def whole_covariances(lens: Lens, ground: Array) -> Array:
    """Covariances (N, 2, 2) m² of people seen whole at ground points (N, 2) m."""
    axes, tangents = sight_axes(lens, ground)
    variances = WHOLE.detection_variances(tangents, pixel_footprints(lens, ground))
    # Towards the horizon a pixel's footprint grows without bound; the distance bounds the standard deviation.
    distances = np.sum(np.square(ground - lens.eye[:2]), axis=1) + np.square(lens.eye[2])
    return covariances_along(axes, np.minimum(variances, distances[:, None]))
