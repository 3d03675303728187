"""The measurement covariance against the paper's equation, written out."""

import math

import numpy as np
import pytest

from tracking.detection.noise import NoiseModel


def li22_equation_4(alpha: float, camera: np.ndarray, target: np.ndarray) -> np.ndarray:
    """R = α G(ρ) diag(0.1 r, 0.1 π r) G(ρ)ᵀ, r = max(‖target - camera‖, 2 m), ρ the bearing of the line of sight."""
    line = target - camera
    r, rho = max(np.linalg.norm(line), 2.0), math.atan2(line[1], line[0])
    G = np.array([[math.cos(rho), -math.sin(rho)], [math.sin(rho), math.cos(rho)]])
    return alpha * G @ np.diag([0.1 * r, 0.1 * math.pi * r]) @ G.T


def test_range_bearing_covariance_is_equation_4_of_the_paper():
    rng = np.random.default_rng(0)
    for _ in range(300):
        alpha, camera = rng.uniform(0.05, 0.5), rng.uniform(-50, 50, 2)
        target = camera + rng.normal(size=2) * 10 ** rng.uniform(-2, 2)
        R = NoiseModel.range_bearing(alpha).covariance(camera, target)
        np.testing.assert_allclose(R, li22_equation_4(alpha, camera, target), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("bearing", np.linspace(0, 2 * np.pi, 9))
def test_variances_lie_along_and_across_the_line_of_sight(bearing):
    model = NoiseModel((0.1, 0.2, 0.03), (0.4, 0.5, 0.06), 1.0)
    along = np.array([math.cos(bearing), math.sin(bearing)])
    across = np.array([-along[1], along[0]])
    R = model.covariance(np.array([3.0, -2.0]), np.array([3.0, -2.0]) + 4.0 * along)
    np.testing.assert_allclose(R @ along, (0.1 + 0.2 * 4 + 0.03 * 16) * along, atol=1e-12)
    np.testing.assert_allclose(R @ across, (0.4 + 0.5 * 4 + 0.06 * 16) * across, atol=1e-12)
