"""Covariance of a ground measurement as a function of where the target stands relative to the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tracking.camera import Camera
from tracking.compiled import Array, compiled
from tracking.visibility import TARGET_HEIGHT

# Fitted to rendered people in plain view, at least half of them inside the image, at all headings, from 17 to 22 m, in
# images of 64, 128 and 256 pixels that see 60 degrees, so that errors squared over variances average one.
_WIDTH = 0.5  # m, of a person seen from above
_POSTURE = 0.017  # m: what limbs and stride move a silhouette's centroid by
_UPRIGHT = 0.04  # m at 45 degrees off nadir: what they and the image's edge move it by along an upright body
# Silhouettes of this share of the mean one are still whole ones, seen from their slim side.
_WHOLE = 0.8


@dataclass(frozen=True)
class NoiseModel:
    """Variances along and across the planar line from camera to target, each c0 + c1 r + c2 r².

    r is the planar distance, at least `minimum_range`. Both of the testbed's models are of this form, so the compiled
    code of tracker and planner needs to know only one.
    """

    radial: tuple[float, float, float]  # m², m, 1
    tangential: tuple[float, float, float]  # m², m, 1
    minimum_range: float = 0.0  # m

    @staticmethod
    def range_bearing(alpha: float) -> NoiseModel:
        """[Li22] eq. (4): R = α G(ρ) diag(0.1 r, 0.1 π r) G(ρ)ᵀ with r0 = 2 m."""
        return NoiseModel((0.0, 0.1 * alpha, 0.0), (0.0, 0.1 * math.pi * alpha, 0.0), 2.0)

    @staticmethod
    def camera(camera: Camera, altitude: float, visible: float = 1.0) -> NoiseModel:
        """The error of a detection itself, for a nadir camera `altitude` m above ground.

        Pixels: a centroid averages the rounding, of variance gsd² / 12, over the width / gsd rows of a silhouette, gsd
        being a pixel's edge at the target's height. Posture: limbs and stride. Along the line of sight both grow as an
        upright body's projection does, with r² / height². Occlusion: where the share `visible` of the mean silhouette
        shows, the centroid is off by up to half the hidden part's extent.
        """
        height = altitude - TARGET_HEIGHT
        hidden = max(0.0, 1.0 - visible / _WHOLE)
        pixel = (height / camera.focal) ** 3 / (12 * _WIDTH)
        across = _POSTURE**2 + pixel + (hidden * _WIDTH / 2) ** 2
        slope = hidden**2 * _WIDTH * TARGET_HEIGHT / height
        curve = (_UPRIGHT**2 + pixel + (hidden * TARGET_HEIGHT) ** 2) / height**2
        return NoiseModel((across, slope, curve), (across, 0.0, 0.0))

    @property
    def coefficients(self) -> Array:
        """(7,): radial, tangential, minimum range; what `ground_covariance` takes."""
        return np.array([*self.radial, *self.tangential, self.minimum_range])

    def covariance(self, camera: Array, target: Array) -> Array:
        """R (2, 2) m² for a camera above `camera` (2,) m and a target at `target` (2,) m."""
        xx, xy, yy = ground_covariance(target[0] - camera[0], target[1] - camera[1], self.coefficients)
        return np.array([[xx, xy], [xy, yy]])


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
