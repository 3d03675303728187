"""Covariance of a ground measurement as a function of where the target stands relative to the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.compiled import Array, compiled
from tracking.numerics.elementary import exp_each, power

Quadratic = tuple[float, float, float]


@dataclass(frozen=True)
class WholeError:
    """What moves the centroid of a whole silhouette: constants of the camera's covariance at nadir, and their growth.

    The growths are factors of t and t², t being the tangent of the angle off nadir.
    Fitted by `python -m sim.calibration.fit` to rendered people in plain view at all headings, from 12 to 34 m above,
    in images of 96 to 256 pixels that see 60 degrees, so that errors squared over variances average one.
    """

    posture: float = 0.021  # m, standard deviation: limbs and stride
    rounding: float = 1.633  # standard deviations of one pixel's rounding, where pixels are large
    limb: float = 0.4  # m: pixels smaller than that average over a silhouette
    radial_posture: tuple[float, float] = (-2.961, 6.517)
    radial_rounding: tuple[float, float] = (-0.206, 0.973)
    tangential_posture: tuple[float, float] = (0.282, 0.0)
    tangential_rounding: tuple[float, float] = (-1.46, 0.561)
    # Factors of a detection's covariance by t: what polynomials of second degree, which planners use, leave.
    tangents: tuple[float, ...] = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
    excess: tuple[float, ...] = (0.893, 0.987, 1.045, 1.057, 0.909, 0.906)
    # Level images of 60 degrees end about here. Beyond, where tilted ones see, growths go on as powers of t: radial
    # posture and rounding, then tangential.
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

    def detected(self, tangents: Array, footprints: Array) -> Array:
        """Radial and tangential variances (N, 2) m² of detections from any attitude, by the ground that a pixel covers.

        footprints (N, 2) m: along and across the line of sight, both gsd for a level camera; up to
        `corner` this then is the polynomials of `variances`, times `excess`; beyond, their growths are powers.
        """
        return _detected(tangents, footprints, self._constants)

    @cached_property
    def _constants(self) -> tuple[Array, Array, Array]:
        growths = (self.radial_posture, self.radial_rounding, self.tangential_posture, self.tangential_rounding)
        numbers = np.array(
            [self.posture, self.rounding, self.limb, self.corner, *np.ravel(growths), *self.powers, self.stretch]
        )
        return numbers, np.array(self.tangents), np.array(self.excess)


WHOLE = WholeError()


@dataclass(frozen=True)
class SplitError:
    """What moves detections more that come of one blob told apart: who hides whom, and where the cut should have been.

    Fitted by `python -m sim.calibration.fit` to rendered pairs who touch in the image, so that errors squared over
    variances average one.
    """

    base: float = 0.196  # m, standard deviation where the parts coincide
    radial: float = 1.487  # m, the same for each unit of the tangent of the angle off nadir
    tangential: float = 0.608  # m
    decay: float = 8.016  # of the variance, for each person's extent that the parts are apart

    def variances(self, tangents: Array, gaps: Array) -> Array:
        """Radial and tangential variances (N, 2) m² at gaps (N,), in extents of a person, between the parts."""
        growth = np.square(np.multiply.outer(tangents, [self.radial, self.tangential]))
        return exp_each(-self.decay * gaps)[:, None] * (self.base * self.base + growth)


SPLIT = SplitError()


@dataclass(frozen=True)
class NoiseModel:
    """Variances along and across the planar line from camera to target, each c0 + c1 r + c2 r².

    r is the planar distance, at least `minimum_range`. Both of the testbed's models are of this form, so the compiled
    code of tracker and planner needs to know only one.
    """

    radial: Quadratic  # m², m, 1
    tangential: Quadratic  # m², m, 1
    minimum_range: float = 0.0  # m

    @staticmethod
    def range_bearing(alpha: float) -> NoiseModel:
        """[Li22] eq. (4): R = α G(ρ) diag(0.1 r, 0.1 π r) G(ρ)ᵀ with r0 = 2 m."""
        return NoiseModel((0.0, 0.1 * alpha, 0.0), (0.0, 0.1 * math.pi * alpha, 0.0), 2.0)

    @staticmethod
    def camera(camera: Camera, altitude: float) -> NoiseModel:
        """The error of a detection itself, for a person in plain view of a nadir camera `altitude` m above ground.

        Posture: limbs and stride. Rounding: of variance gsd² / 12 for one pixel of edge gsd at the target's height, and
        smaller by gsd² / limb² for a centroid of many. Of second degree: without the `excess` of `WholeError.detected`.
        What only a part shows of has the covariance of
        `tracking.detection.partial_visibility`.
        """
        height = altitude - TARGET_HEIGHT
        radial, tangential = WHOLE.variances(np.array(height / camera.focal))
        return NoiseModel(_in_range(radial, height), _in_range(tangential, height))

    @property
    def coefficients(self) -> Array:
        """(7,): radial, tangential, minimum range; what `ground_covariance` takes."""
        return np.array([*self.radial, *self.tangential, self.minimum_range])

    def covariance(self, camera: Array, target: Array) -> Array:
        """R (2, 2) m² for a camera above `camera` (2,) m and a target at `target` (2,) m."""
        xx, xy, yy = ground_covariance(target[0] - camera[0], target[1] - camera[1], self.coefficients)
        return np.array([[xx, xy], [xy, yy]])


def _in_range(polynomial: Array, height: float) -> Quadratic:
    """A polynomial in the tangent of the angle off nadir as one in the planar distance."""
    constant, slope, curve = (polynomial / [1.0, height, height * height]).tolist()
    return constant, slope, curve


def sight(pose: Pose, ground: Array) -> tuple[Array, Array]:
    """At ground points (N, 2) m, unit vectors in columns along and across the line of sight (N, 2, 2), and tangents.

    The tangents (N,) are of the angle off nadir.
    """
    return _sight(pose.position, ground)


@compiled
def _sight(eye: Array, ground: Array) -> tuple[Array, Array]:
    axes, tangents = np.empty((len(ground), 2, 2)), np.empty(len(ground))
    for k in range(len(ground)):
        x, y = ground[k, 0] - eye[0], ground[k, 1] - eye[1]
        distance = math.sqrt(x * x + y * y)
        cos, sin = (x / distance, y / distance) if distance > 0.0 else (1.0, 0.0)
        axes[k, 0], axes[k, 1] = (cos, -sin), (sin, cos)
        tangents[k] = distance / abs(eye[2] - TARGET_HEIGHT)
    return axes, tangents


@compiled
def covariances_along(axes: Array, variances: Array) -> Array:
    """Covariances (N, 2, 2) with variances (N, 2) along axes in columns (N, 2, 2)."""
    out = np.empty((len(axes), 2, 2))
    for n in range(len(axes)):
        for i in range(2):
            for k in range(2):
                x = axes[n, i, 0] * axes[n, k, 0] * variances[n, 0]
                out[n, i, k] = x + axes[n, i, 1] * axes[n, k, 1] * variances[n, 1]
    return out


def footprints(camera: Camera, pose: Pose, ground: Array) -> Array:
    """What a pixel covers along and across the line of sight (N, 2) m where people stand at ground points (N, 2) m.

    That is the standard deviation there of what has one of a pixel in each direction of the image.
    """
    return _footprints(pose.position, pose.rotation, camera.focal, ground)


@compiled
def _footprints(eye: Array, rotation: Array, focal: float, ground: Array) -> Array:
    out = np.empty((len(ground), 2))
    for k in range(len(ground)):
        x, y, z = ground[k, 0] - eye[0], ground[k, 1] - eye[1], TARGET_HEIGHT - eye[2]
        depth = -(x * rotation[0, 2] + y * rotation[1, 2] + z * rotation[2, 2])
        distance = math.sqrt(x * x + y * y)
        cos, sin = (x / distance, y / distance) if distance > 0.0 else (1.0, 0.0)
        radial = tangential = 0.0
        # The ray r through a pixel, of unit depth, meets the plane at p = eye + s r, with s = depth. As s r_z is
        # constant, dp = s (dr - r dr_z / r_z); and dr are the image's axes in the world, over the focal length.
        for j in range(2):
            east = rotation[0, j] - rotation[2, j] * x / z
            north = rotation[1, j] - rotation[2, j] * y / z
            along, across = cos * east + sin * north, cos * north - sin * east
            radial, tangential = radial + along * along, tangential + across * across
        out[k] = depth / focal * math.sqrt(radial), depth / focal * math.sqrt(tangential)
    return out


@compiled
def _detected(tangents: Array, footprints: Array, constants: tuple[Array, Array, Array]) -> Array:
    numbers, knots, factors = constants
    posture, rounding = numbers[0] * numbers[0], numbers[1] * numbers[1] / 12
    limb, corner = numbers[2] * numbers[2], numbers[3]
    growth = np.empty(4)
    excess = np.interp(tangents, knots, factors)
    out = np.empty((len(tangents), 2))
    for k in range(len(tangents)):
        within, beyond = min(tangents[k], corner), max(tangents[k] / corner, 1.0)
        for j in range(4):
            growth[j] = 1.0 + within * (numbers[4 + 2 * j] + numbers[5 + 2 * j] * within)
            growth[j] *= power(beyond, numbers[12 + j])
        # Rounding averages over a silhouette's pixels; that of its long sides over those in its length, the fewer if
        # they are long themselves.
        area, longer = footprints[k, 0] * footprints[k, 1], footprints[k, 0] / footprints[k, 1]
        for j in range(2):
            grain = area * power(longer, j * numbers[16])
            pixel = rounding * footprints[k, j] * footprints[k, j] * grain / (limb + grain)
            out[k, j] = excess[k] * (posture * growth[2 * j] + pixel * growth[2 * j + 1])
    return out


@compiled
def ground_covariance(dx: float, dy: float, coefficients: Array) -> tuple[float, float, float]:
    """R_xx, R_xy, R_yy [m²] for a target at (dx, dy) m from the point below the camera."""
    c = coefficients
    d = math.sqrt(dx * dx + dy * dy)
    cos, sin = (dx / d, dy / d) if d > 0.0 else (1.0, 0.0)
    r = max(d, c[6])
    along = c[0] + r * (c[1] + r * c[2])
    across = c[3] + r * (c[4] + r * c[5])
    return (
        along * cos * cos + across * sin * sin,
        (along - across) * cos * sin,
        along * sin * sin + across * cos * cos,
    )
