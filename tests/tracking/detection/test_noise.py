"""The measurement covariance against the paper's equation, written out."""

import math

import numpy as np
import pytest

from tracking.detection.noise import NoiseModel, measurement_covariances


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


def test_many_covariances_are_those_of_single_ones():
    rng = np.random.default_rng(1)
    models = [NoiseModel.range_bearing(0.1), NoiseModel((0.1, 0.2, 0.03), (0.4, 0.5, 0.06), 1.0)]
    rows, cameras, targets = rng.integers(2, size=50), rng.uniform(-9, 9, (50, 2)), rng.uniform(-9, 9, (50, 2))
    targets[0] = cameras[0]
    found = measurement_covariances(np.array([models[k].coefficients for k in rows]), cameras, targets)
    for R, k, camera, target in zip(found, rows, cameras, targets, strict=True):
        np.testing.assert_array_equal(R, models[k].covariance(camera, target))
        np.testing.assert_array_equal(R, plain_covariance(models[k], *camera.tolist(), *target.tolist()))


def plain_covariance(model, x, y, east, north):
    dx, dy = east - x, north - y
    d = math.sqrt(dx * dx + dy * dy)
    cos, sin = (dx / d, dy / d) if d > 0.0 else (1.0, 0.0)
    r = max(d, model.minimum_range)
    along, across = (c[0] + r * (c[1] + r * c[2]) for c in (model.radial, model.tangential))
    xx, yy = along * cos * cos + across * sin * sin, along * sin * sin + across * cos * cos
    return [[xx, (along - across) * cos * sin], [(along - across) * cos * sin, yy]]
