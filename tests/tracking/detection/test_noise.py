"""The measurement covariance against the paper's equation, written out."""

import math

import numpy as np
import pytest
from helpers.scenes import CAMERA

from tracking.detection.detection_errors import WHOLE
from tracking.detection.noise import NoiseModel, measurement_covariances
from tracking.geometry.person import TARGET_HEIGHT


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


def projected(model, camera, target):
    """The covariance by projectors: variances times u uᵀ along the line of sight, and the rest of the plane across."""
    distance = np.linalg.norm(target - camera)
    u = (target - camera) / distance if distance else np.array([1.0, 0.0])
    along, across = (np.polyval(c[::-1], max(distance, model.minimum_range)) for c in (model.radial, model.tangential))
    return along * np.outer(u, u) + across * (np.eye(2) - np.outer(u, u))


def test_many_covariances_are_those_of_single_ones_also_under_the_camera_and_within_the_least_range():
    rng = np.random.default_rng(1)
    models = [NoiseModel.range_bearing(0.1), NoiseModel((0.1, 0.2, 0.03), (0.4, 0.5, 0.06), 1.0)]
    rows, cameras, targets = rng.integers(2, size=50), rng.uniform(-9, 9, (50, 2)), rng.uniform(-9, 9, (50, 2))
    targets[0] = cameras[0]
    targets[1:9] = cameras[1:9] + rng.uniform(-0.6, 0.6, (8, 2))
    found = measurement_covariances(np.array([models[k].coefficients for k in rows]), cameras, targets)
    for R, k, camera, target in zip(found, rows, cameras, targets, strict=True):
        np.testing.assert_array_equal(R, models[k].covariance(camera, target))
        np.testing.assert_allclose(R, projected(models[k], camera, target), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("altitude", [12.0, 20.0, 40.0])
def test_a_nadir_cameras_model_is_the_variance_of_people_at_its_tangents(altitude):
    """By the law of detections, which is fitted to rendered people, without its correction `excess`."""
    height, distances = altitude - TARGET_HEIGHT, np.array([0.5, 3.0, 0.5 * altitude])
    pixels = np.full((3, 2), height / CAMERA.focal)
    tangents = distances / height
    law = WHOLE.detection_variances(tangents, pixels) / np.interp(tangents, WHOLE.tangents, WHOLE.excess)[:, None]
    model = NoiseModel.camera(CAMERA, altitude)
    for distance, variances in zip(distances, law, strict=True):
        R = model.covariance(np.array([1.0, 2.0]), np.array([1.0, 2.0 - distance]))  # to the south
        np.testing.assert_allclose(R, np.diag(variances[::-1]), rtol=1e-9, atol=1e-15)
