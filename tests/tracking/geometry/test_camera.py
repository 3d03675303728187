"""The pinhole camera: identities between its projections."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracking.geometry.camera import ALL_ROUND, Camera, Pose

CAMERA = Camera(math.radians(60), 128)


def tilted(rng: np.random.Generator) -> Pose:
    """A camera 10 to 30 m up that looks at most 20 degrees off the nadir, with any heading."""
    turn = Rotation.from_euler("zyx", [rng.uniform(-np.pi, np.pi), *rng.uniform(-0.35, 0.35, 2)])
    return Pose(rng.uniform([-70, -50, 10], [70, 50, 30]), turn.as_quat())


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_points_along_a_ray_share_its_pixel_and_have_its_length_as_depth(seed):
    rng = np.random.default_rng(seed)
    pose, uv, depth = tilted(rng), rng.uniform(-50, 200, (20, 2)), rng.uniform(0.1, 40, 20)
    points = pose.position + depth[:, None] * CAMERA.rays(pose, uv)
    back, seen_depth = CAMERA.project(pose, points)
    np.testing.assert_allclose(back, uv, atol=1e-8)
    np.testing.assert_allclose(seen_depth, depth, rtol=1e-12)


def test_rotations_agree_with_scipy_and_altitudes_with_footprints():
    rng = np.random.default_rng(1)
    for quaternion in rng.normal(size=(50, 4)):
        quaternion /= np.linalg.norm(quaternion)
        rotation = Pose(rng.normal(size=3), quaternion).rotation
        np.testing.assert_allclose(rotation, Rotation.from_quat(quaternion).as_matrix(), atol=1e-14)
    for edge, altitude in ((20, 17.3), (25, 21.7), (22, 19.1)):
        corners = CAMERA.footprint(Pose.level(1.0, 2.0, altitude))
        half = altitude * math.tan(math.radians(30))
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        np.testing.assert_allclose(corners, [1, 2] + half * signs)
        assert 2 * half == pytest.approx(edge, abs=0.06)


def test_a_level_camera_shows_north_at_the_top_and_nothing_behind_it():
    uv, depth = CAMERA.project(Pose.level(5.0, -3.0, 20.0), np.array([[5, -3, 0], [6, -3, 0], [5, -2, 0.0]]))
    focal = 64 / math.tan(math.radians(30))
    np.testing.assert_allclose(uv, [[64, 64], [64 + focal / 20, 64], [64, 64 - focal / 20]], atol=1e-12)
    np.testing.assert_array_equal(depth, 20.0)
    pose = Pose.level(0.0, 0.0, 20.0)
    above = np.array([[0, 0, 20], [0, 0, 21], [3, -2, 35.0]])
    uv, depth = CAMERA.project(pose, above)
    assert np.all(depth <= 0) and np.all(np.isnan(uv)) and not CAMERA.sees(pose, above).any()


def test_rays_that_meet_no_ground_give_nan():
    pose = Pose(np.array([0.0, 0.0, 20.0]), Rotation.from_euler("x", 90, degrees=True).as_quat())  # looks north
    points = CAMERA.ground_points(pose, np.array([[64.0, 100.0], [0.0, 63.0], [64.0, 20.0]]))
    assert points[0, 1] == pytest.approx(20 * CAMERA.focal / 36) and np.isnan(points[1:]).all()
    assert np.isnan(CAMERA.footprint(pose)).any(axis=1).tolist() == [False, False, True, True]


def test_two_pi_may_be_rounded():
    for fov in (6.2831853, 6.283185, 6.28319, math.radians(360.0), math.tau):
        assert Camera(fov, 128).fov == ALL_ROUND
    for fov in (6.2831, 6.2833, math.pi):
        with pytest.raises(ValueError, match=r"expected more than 0 and less than pi rad, or 2 pi: all round$"):
            Camera(fov, 128)


@pytest.mark.parametrize(
    ("fov", "pixels", "wrong"),
    [(60, 128, "fov: 60 is"), (-1, 128, "fov: -1 is"), (math.nan, 128, "fov: nan is"), (1, 0, "pixels: 0 is")],
)
def test_what_is_no_camera_is_refused(fov, pixels, wrong):
    with pytest.raises(ValueError, match=f"^{wrong} not allowed; expected "):
        Camera(fov, pixels)
