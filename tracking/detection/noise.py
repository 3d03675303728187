"""Covariance of a ground measurement as a function of the target's place relative to the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tracking.detection.detection_errors import WHOLE
from tracking.geometry.camera import Camera
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled

Quadratic = tuple[float, float, float]


@dataclass(frozen=True)
class NoiseModel:
    """Variances along and across the planar line from camera to target, each c0 + c1 r + c2 r².

    r is the planar distance, at least `minimum_range`. Both of the testbed's models have this form, so compiled code
    needs only one.
    """

    radial: Quadratic  # m², m, 1
    tangential: Quadratic  # m², m, 1
    minimum_range: float = 0.0  # m

    @staticmethod
    def range_bearing(alpha: float) -> NoiseModel:
        """Noise model of [Li22] eq. (4): R = α G(ρ) diag(0.1 r, 0.1 π r) G(ρ)ᵀ with r0 = 2 m."""
        return NoiseModel((0.0, 0.1 * alpha, 0.0), (0.0, 0.1 * math.pi * alpha, 0.0), 2.0)

    @staticmethod
    def camera(camera: Camera, altitude: float) -> NoiseModel:
        """Noise model for a person in plain view of a nadir camera `altitude` m above ground.

        Variances come from posture (limbs and stride) and from rounding. Rounding adds gsd² / 12 for one pixel of edge
        gsd at the target's height, and less by a factor of about gsd² / limb² for a centroid of many pixels.
        The `excess` of `WholeError.detection_variances` is left out. `tracking.detection.partial_visibility` gives the
        covariance of a person hidden in part.
        """
        height = altitude - TARGET_HEIGHT
        radial, tangential = WHOLE.variances(np.array(height / camera.focal))
        return NoiseModel(_convert_to_range(radial, height), _convert_to_range(tangential, height))

    @property
    def coefficients(self) -> Array:
        """Coefficients (7,) for compiled code: radial, tangential, minimum range."""
        return np.array([*self.radial, *self.tangential, self.minimum_range])

    def covariance(self, camera: Array, target: Array) -> Array:
        """R (2, 2) m² for a camera above `camera` (2,) m and a target at `target` (2,) m."""
        one, other = np.array([camera], dtype=float), np.array([target], dtype=float)
        return np.asarray(measurement_covariances(self.coefficients[None], one, other)[0])


@compiled
def measurement_covariances(models: Array, cameras: Array, targets: Array) -> Array:
    """Covariances (N, 2, 2) m² of measurements, each with its `NoiseModel.coefficients`.

    models (N, 7); cameras (N, 2) and targets (N, 2) m.
    """
    R = np.empty((len(targets), 2, 2))
    for n in range(len(targets)):
        c = models[n]
        dx, dy = targets[n, 0] - cameras[n, 0], targets[n, 1] - cameras[n, 1]
        d = math.sqrt(dx * dx + dy * dy)
        cos, sin = (dx / d, dy / d) if d > 0.0 else (1.0, 0.0)
        r = max(d, c[6])
        along, across = c[0] + r * (c[1] + r * c[2]), c[3] + r * (c[4] + r * c[5])
        R[n, 0, 0] = along * cos * cos + across * sin * sin
        R[n, 1, 1] = along * sin * sin + across * cos * cos
        R[n, 0, 1] = R[n, 1, 0] = (along - across) * cos * sin
    return R


def _convert_to_range(polynomial: Array, height: float) -> Quadratic:
    """A polynomial in the tangent of the angle off nadir as one in the planar distance."""
    constant, slope, curve = (polynomial / [1.0, height, height * height]).tolist()
    return constant, slope, curve
