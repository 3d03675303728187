"""Cameras with distortion against OpenCV, and the limits within which they are cameras."""

import math

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.distortion import Distortion, distortion_slopes
from tracking.geometry.lens import (
    focal_length,
    ground_point,
    image_point,
    in_image,
    linear_pixel,
    magnification,
    plane_point,
    plane_slopes,
)

# (width, height, focal lengths, principal point, coefficients), with the principal point as in OpenCV
CALIBRATIONS = {
    "barrel": (640, 512, (770.0, 768.0), (318.2, 259.1), (-0.37, 0.18, 0.0008, -0.0011, -0.03)),
    "pincushion": (640, 360, (480.5, 481.2), (322.0, 178.3), (0.14, -0.27, -0.0004, 0.0009, 0.12)),
    "tangential": (320, 240, (210.0, 215.0), (150.0, 124.0), (-0.05, 0.0, 0.01, -0.008, 0.0)),
    "rational": (640, 576, (505.1, 505.2), (322.1, 330.6), (0.52, -2.61, 0.0009, -0.0003, 1.51, 0.4, -2.43, 1.44)),
    "wide": (640, 480, (290.0, 288.0), (325.0, 236.0), (5.1, 1.9, -0.0004, 0.0006, 0.08, 5.4, 3.1, 0.42)),
    "pinhole": (800, 300, (500.0, 510.0), (390.0, 160.0), (0.0, 0.0, 0.0, 0.0, 0.0)),
}

FISHEYES = {  # the same, with k1, k2, k3, k4 of OpenCV's fisheye
    "fisheye": (848, 800, (460.2, 461.0), (424.9, 401.3), (-0.0083, 0.0421, -0.0392, 0.0064)),
    "equidistant": (640, 480, (312.0, 312.0), (319.5, 239.5), (0.0, 0.0, 0.0, 0.0)),
    "one": (320, 240, (200.0, 205.0), (158.0, 124.0), (0.11,)),
}
CALIBRATIONS |= FISHEYES
WIDE = ("wide", *FISHEYES)


def calibrated(name: str) -> Camera:
    width, height, focal, (cx, cy), distortion = CALIBRATIONS[name]
    if name in FISHEYES:
        distortion = Distortion.of("equidistant", distortion)
    return Camera.calibrated(width, height, focal, (cx + 0.5, cy + 0.5), distortion)


def posed(rng: np.random.Generator, tilt: float = 0.4) -> Pose:
    turn = Rotation.from_euler("zyx", [rng.uniform(-np.pi, np.pi), *rng.uniform(-tilt, tilt, 2)])
    return Pose(rng.uniform([-70, -50, 10], [70, 50, 30]), turn.as_quat())


def opencv(name: str, pose: Pose) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rotation vector, translation, camera matrix and coefficients for OpenCV, whose axes are right, down, forward."""
    _, _, (fx, fy), (cx, cy), distortion = CALIBRATIONS[name]
    distortion = [*distortion, *[0.0] * (4 - len(distortion))]
    turn = np.diag([1.0, -1.0, -1.0]) @ pose.rotation.T
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    return cv2.Rodrigues(turn)[0], -turn @ pose.position, matrix, np.array(distortion)


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_pixels_of_1000_points_are_those_of_opencv(name):
    camera, rng = calibrated(name), np.random.default_rng(1)
    for _ in range(5):
        pose = posed(rng)
        uv = rng.uniform(0, camera.size, (1000, 2))
        ground = camera.ground_points(pose, uv, 0.85)
        points = np.column_stack([ground, np.full(1000, 0.85)])[np.isfinite(ground[:, 0])]
        if name in FISHEYES:
            expected = cv2.fisheye.projectPoints(points[:, None], *opencv(name, pose))[0][:, 0] + 0.5
        else:
            expected = cv2.projectPoints(points, *opencv(name, pose))[0][:, 0] + 0.5
        found, depth = camera.project(pose, points)
        np.testing.assert_allclose(found, expected, atol=1e-6)
        np.testing.assert_allclose(found, uv[np.isfinite(ground[:, 0])], atol=1e-6)
        assert np.all(depth > 0) and np.all(camera.sees(pose, points))
        lens = camera.lens(pose)
        assert all(in_image(tuple(p), lens) for p in points[:50].tolist())
        singly = np.array([image_point(lens, tuple(p))[:2] for p in points[:50].tolist()])
        np.testing.assert_allclose(singly, found[:50], atol=1e-9)
        places = np.array([ground_point(lens, tuple(p), 0.85) for p in uv[:50].tolist()])
        np.testing.assert_allclose(places, ground[:50], atol=1e-9)


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_what_is_ahead_is_in_the_image_however_near(name):
    camera = calibrated(name)
    lens = camera.lens(Pose.level(1, 2, 20))
    for depth in (1e-3, 0.3, 19.0):
        expected = (camera.optics.cx, camera.optics.cy, depth)
        assert image_point(lens, (1.0, 2.0, 20.0 - depth)) == pytest.approx(expected, abs=1e-6)
    assert math.isnan(image_point(lens, (1.0, 2.0, 20.1))[0])


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_undistorted_points_are_those_of_opencv_everywhere_in_the_image(name):
    camera = calibrated(name)
    uv = np.random.default_rng(2).uniform(0, camera.size, (1000, 2))
    _, _, matrix, coefficients = opencv(name, Pose.level(0, 0, 20))
    exact = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-15)
    if name in FISHEYES:
        expected = cv2.fisheye.undistortPoints(uv[:, None] - 0.5, matrix, coefficients, criteria=exact)[:, 0]
    else:
        straight = cv2.undistortImagePoints(uv[:, None] - 0.5, matrix, coefficients, None, exact)[:, 0]
        expected = (straight - matrix[:2, 2]) / np.diag(matrix)[:2]
    np.testing.assert_allclose(camera.slopes(uv), expected, atol=1e-6 / max(camera.size))


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_slopes_of_the_image_plane_are_those_of_differences(name):
    optics, step = calibrated(name).optics, 1e-4
    for u, v in np.random.default_rng(3).uniform(0, [optics.width, optics.height], (50, 2)).tolist():
        right = np.subtract(plane_point(optics, u + step, v), plane_point(optics, u - step, v)) / (2 * step)
        down = np.subtract(plane_point(optics, u, v + step), plane_point(optics, u, v - step)) / (2 * step)
        found = plane_slopes(optics, *plane_point(optics, u, v))
        expected = np.array([right[0], down[0], right[1], down[1]])
        np.testing.assert_allclose(found, focal_length(optics) * expected, atol=1e-5)
        assert magnification(optics, u, v) == pytest.approx(
            abs(np.linalg.det(expected.reshape(2, 2))) ** -0.5, rel=1e-5
        )
        form = np.array(linear_pixel(optics, u, v))
        np.testing.assert_allclose(form @ [*plane_point(optics, u, v), 1.0], [u, v], atol=1e-9)
        np.testing.assert_allclose(form[:, :2] @ expected.reshape(2, 2), np.eye(2), atol=1e-5)


def test_the_middle_of_an_equidistant_lens_has_no_step():
    for k in ((), (0.3, -0.1, 0.02, 0.1)):
        d = Distortion.of("equidistant", k)
        for x in np.geomspace(1e-9, 1e-2, 200).tolist():
            expected = 1 + 3 * (d.k1 - 1 / 3) * x * x, 1 + (d.k1 - 1 / 3) * x * x, 0.0
            np.testing.assert_allclose(distortion_slopes(d, x, 0.0), expected, rtol=0, atol=3e-15 + 5 * x**4)


def test_nothing_beyond_the_fold_of_the_distortion_is_seen():
    # r (1 - 0.37 r^2) grows up to r = 0.949 and falls back to 0 at 1.644: points out there would be in the image.
    camera = Camera.calibrated(640, 512, (770.0, 770.0), (320.0, 256.0), (-0.37,))
    pose, radii = Pose.level(0.0, 0.0, 20.0), np.linspace(0.0, 3.0, 301)
    points = np.column_stack([20 * radii, np.zeros((301, 2))])
    pixels, _ = camera.project(pose, points)
    half = camera.slopes(np.array([[640.0, 256.0]]))[0, 0]
    np.testing.assert_array_equal(camera.sees(pose, points), radii <= half)
    fold = 1 / math.sqrt(3 * 0.37)
    np.testing.assert_array_equal(np.isfinite(pixels[:, 0]), radii <= fold)
    assert np.all(np.diff(pixels[radii <= fold, 0]) > 0)


@pytest.mark.parametrize(("focal", "k"), [(160.0, ()), (200.0, ()), (280.0, (0.0, 0.0, -0.12))])
def test_a_fisheye_shows_a_circle_beyond_which_there_is_nothing(focal, k):
    """Of 90 degrees and more off the axis, of 76 within the edges, and of a fold beyond the middle of an edge."""
    camera = Camera.calibrated(640, 480, (focal, focal), (320.0, 240.0), Distortion.of("equidistant", k))
    pose, rng = posed(np.random.default_rng(7), 0.1), np.random.default_rng(8)
    uv = rng.uniform(0, camera.size, (4000, 2))
    angles = np.linspace(0.0, math.atan(4.0), 20_001)
    seen = focal * angles * (1 + (k[2] if k else 0.0) * angles**6)
    rim = seen[np.argmax(seen)]
    radius = np.hypot(*(uv - [320, 240]).T)
    shown, near = np.isfinite(camera.slopes(uv)[:, 0]), np.abs(radius - rim) < 0.5
    np.testing.assert_array_equal(shown[~near], radius[~near] < rim)
    assert 0 < shown.sum() < 4000
    ground = camera.ground_points(pose, uv[shown], 0.85)
    points = np.column_stack([ground, np.full(len(ground), 0.85)])
    np.testing.assert_allclose(camera.project(pose, points)[0], uv[shown], atol=1e-6)
    edge = camera.shown(uv)
    np.testing.assert_array_equal(edge[shown], uv[shown])
    np.testing.assert_allclose(np.hypot(*(edge - [320, 240]).T), np.minimum(radius, rim), atol=0.01)
    outline = camera.footprint(Pose.level(0.0, 0.0, 20.0))
    west, east, south, north = camera.bounds
    assert np.isfinite(outline).all() and np.max(np.abs(outline)) <= 20 * math.tan(camera.fov / 2) + 1e-9
    corners = 20 * np.array([[x, y] for x in (west, east) for y in (south, north)])
    assert camera.sees(Pose.level(0.0, 0.0, 20.0), 0.999 * np.column_stack([corners, np.zeros(4)])).all()


def test_a_square_pinhole_camera_is_the_same_calibrated_or_not():
    square = Camera(math.radians(60), 128)
    same = Camera.calibrated(128, 128, (square.focal, square.focal), (64.0, 64.0))
    pose = posed(np.random.default_rng(4))
    uv = np.random.default_rng(5).uniform(0, 128, (100, 2))
    assert same.optics == square.optics and same.fov == pytest.approx(square.fov, rel=1e-15)
    np.testing.assert_array_equal(same.ground_points(pose, uv), square.ground_points(pose, uv))


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_a_bent_footprint_is_the_outline_of_what_is_seen(name):
    camera, rng = calibrated(name), np.random.default_rng(6)
    for _ in range(5):
        pose = posed(rng, 0.1 if name in WIDE else 0.4)
        outline = camera.footprint(pose, 0.85)
        assert len(outline) == (4 if name == "pinhole" else 64)
        points = outline.mean(axis=0) + rng.uniform(-40, 40, (2000, 2))
        seen = camera.sees(pose, np.column_stack([points, np.full(2000, 0.85)]))
        polygon = outline.astype(np.float32)[:, None]
        far = np.array([cv2.pointPolygonTest(polygon, p, True) for p in points.tolist()])
        # m: the chords of a bent edge are nearer to it
        clear = np.abs(far) > (0.003 * np.ptp(outline, axis=0).max() if name in WIDE else 0.02)
        np.testing.assert_array_equal(seen[clear], far[clear] > 0)
        assert 0 < seen.sum() < 2000


@pytest.mark.parametrize(
    ("values", "wrong"),
    [
        ((640, 480, (0.0, 600.0), (320.0, 240.0)), "fx: 0 is not allowed; expected more than 0"),
        ((640, 480, (600.0, 600.0), (math.inf, 240.0)), "cx: inf is not allowed; expected a number"),
        ((640, 480, (600.0, 600.0), (320.0, 240.0), (math.inf,)), "distortion: .* expected finite numbers"),
        ((640, 480, (400.0, 400.0), (320.0, 240.0), (-0.5,)), "distortion: .* folds the image over; expected "),
        ((640, 480, (400.0, 400.0), (320.0, 240.0), (0.1,) * 9), "distortion: .* more than the 8 coefficients of rat"),
        (
            (640, 480, (400.0, 400.0), (320.0, 240.0), Distortion.of("equidistant", (-2.0,))),
            r"distortion: \[-2.0, 0.0, 0.0, 0.0\] folds the image over; expected ",
        ),
    ],
)
def test_what_is_no_calibration_is_refused(values, wrong):
    with pytest.raises(ValueError, match=f"^{wrong}"):
        Camera.calibrated(*values)
