"""Line of sight against dense sampling, and probability of detection at its limits and against sampling."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from tracking.geometry.camera import ALL_ROUND, Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.quaternions import pitch
from tracking.geometry.visibility import SAMPLES, Forest, Tree, at_target_height, visible_samples

CAMERA = Camera(math.radians(60), 128)
LOW, HIGH = np.array([-30.0, -30.0, 0.0]), np.array([30.0, 30.0, 22.0])
HALF = (20.0 - TARGET_HEIGHT) * math.tan(math.radians(30))  # of the field of view at a person's mid-height


def random_forest(rng: np.random.Generator, trees: int = 12, **settings) -> Forest:
    """Trees of all sizes, also such that overlap."""
    return Forest(
        tuple(
            Tree(*rng.uniform(-25, 25, 2), rng.uniform(0.5, 5), trunk_radius=rng.uniform(0.1, 0.5))
            for _ in range(trees)
        ),
        **settings,
    )


def depths(origin: np.ndarray, point: np.ndarray, cylinders: np.ndarray, samples: int) -> np.ndarray:
    """Depth (B,) m of the segment in each solid, by sampling; negative outside."""
    at = origin + np.linspace(0, 1, samples)[:, None] * (point - origin)
    radial = cylinders[:, 2] - np.hypot(at[:, None, 0] - cylinders[:, 0], at[:, None, 1] - cylinders[:, 1])
    vertical = np.minimum(at[:, None, 2] - cylinders[:, 3], cylinders[:, 4] - at[:, None, 2])
    return np.minimum(radial, vertical).max(axis=0)


def test_line_of_sight_agrees_with_dense_sampling_along_segments():
    rng = np.random.default_rng(0)
    step, compared = 0.02, np.zeros(2, int)
    for _ in range(400):
        forest = random_forest(rng)
        origin, point = rng.uniform(LOW, HIGH), rng.uniform(LOW, [30, 30, 6])
        samples = int(np.linalg.norm(point - origin) / step) + 2
        deepest = depths(origin, point, forest.cylinders, samples).max()
        if abs(deepest) > step / 2:  # else sampling cannot tell
            visible = forest.visible(origin, point)[0, 0]
            assert visible == (deepest < 0)
            compared[int(visible)] += 1
    assert compared.min() > 80


def test_lines_of_sight_are_mutual_and_discs_hide_what_is_inside():
    rng = np.random.default_rng(1)
    forest = random_forest(rng)
    a, b = rng.uniform(LOW, HIGH, (40, 3)), rng.uniform(LOW, HIGH, (50, 3))
    np.testing.assert_array_equal(forest.visible(a, b), forest.visible(b, a).T)
    rng = np.random.default_rng(4)
    forest = random_forest(rng, occlusion="disc")
    points = np.column_stack([rng.uniform(-30, 30, (2000, 2)), np.full(2000, TARGET_HEIGHT)])
    cameras = rng.uniform([-30, -30, 8], HIGH, (5, 3))
    inside = np.array([[math.dist((t.x, t.y), p[:2]) <= t.canopy_radius for t in forest.trees] for p in points])
    np.testing.assert_array_equal(forest.visible(cameras, points), np.tile(~inside.any(axis=1), (5, 1)))


@pytest.mark.parametrize("occlusion", ["line_of_sight", "disc"])
def test_each_blocker_and_each_canopy_is_that_of_its_tree(occlusion):
    trees = tuple(Tree(float(k), -float(k), canopy_radius=1.0 + k) for k in range(3))
    forest = Forest(trees, occlusion)
    owners = [(trees[k].x, trees[k].y) for k in forest.tree_of_blockers.tolist()]
    assert owners == [tuple(row) for row in forest.blockers[:, :2].tolist()]
    np.testing.assert_array_equal(forest.canopies, [(t.x, t.y, t.canopy_radius, 3.0, 6.0, math.inf) for t in trees])
    assert Forest((), occlusion).tree_of_blockers.size == Forest((), occlusion).canopies.size == 0


def test_canopies_hide_what_is_at_their_height_up_to_their_ends():
    forest = Forest((Tree(0.0, 0.0, canopy_radius=1.0),))
    for z, free in ((2.99, True), (3.0, False), (5.0, False), (6.0, False), (6.01, True)):
        assert forest.visible(np.array([-5.0, 0.5, z]), np.array([5.0, 0.5, z]))[0, 0] == free
    inside = np.array([0.2, 0.1, 5.0])
    assert not forest.visible(inside, inside)[0, 0]
    rng = np.random.default_rng(5)
    for occlusion in ("line_of_sight", "disc"):
        assert Forest((), occlusion).visible(rng.normal(size=(3, 3)), rng.normal(size=(4, 3))).all()


def detection(mean, sigma: float, forest: Forest) -> float:
    belief = np.array([mean], float), sigma**2 * np.eye(2)[None]
    return float(visible_samples(forest, *belief, CAMERA.lens(Pose.level(0.0, 0.0, 20.0))).mean())


def test_probability_of_detection_is_one_zero_or_at_edges_between():
    forest = Forest((Tree(-5.0, 0.0, canopy_radius=3.0),))
    assert detection((3, 3), 0.5, forest) == 1.0 and detection((-5, 0), 0.3, forest) == 0.0
    assert detection((HALF + 2, 0), 0.5, forest) == 0.0
    nothing = np.zeros((0, 2)), np.zeros((0, 2, 2))
    assert visible_samples(forest, *nothing, CAMERA.lens(Pose.level(0, 0, 20))).shape == (0, 1, 36)
    assert detection((HALF, 0), 0.7, Forest(())) == 0.5 and detection((1, -HALF), 0.2, Forest(())) == 0.5
    assert detection((HALF, HALF), 0.4, Forest(())) == 0.25


@pytest.mark.parametrize("offset", np.linspace(-3, 3, 25))
def test_probability_of_detection_follows_the_normal_distribution_across_an_edge(offset):
    # The coarsest step of the rule is 3/8, so that it is off by at most half of it.
    assert abs(detection((HALF + offset, 0), 1.0, Forest(())) - norm.cdf(-offset)) <= 3 / 16 + 1e-12


def test_probability_of_detection_agrees_with_sampling_behind_trees():
    rng = np.random.default_rng(6)
    errors = []
    for _ in range(60):
        forest = random_forest(rng, 8)
        mean, root = rng.uniform(-10, 10, 2), rng.normal(size=(2, 2))
        covariance = root @ root.T + 0.1 * np.eye(2)
        pose = Pose.level(*rng.uniform(-5, 5, 2), 20.0)
        given = visible_samples(forest, mean[None], covariance[None], CAMERA.lens(pose))[:, 0].mean()
        samples = np.column_stack([rng.multivariate_normal(mean, covariance, 2000), np.full(2000, TARGET_HEIGHT)])
        truth = np.mean(CAMERA.sees(pose, samples) & forest.visible(pose.position, samples)[0])
        errors.append(given - truth)
    assert np.max(np.abs(errors)) < 0.2 and np.sqrt(np.mean(np.square(errors))) < 0.06
    assert abs(np.mean(errors)) < 0.02


def test_what_several_cameras_show_is_what_each_of_them_shows():
    rng = np.random.default_rng(6)
    forest = Forest(tuple(Tree(*rng.uniform(-15, 15, 2), 3.0, leaf_area_density=d) for d in (math.inf, 1.0, 2.0) * 3))
    bent = Camera.calibrated(64, 48, (50.0, 52.0), (31.0, 25.0), (-0.2, 0.02, 0.001, -0.001, 0.0))
    cameras = [Camera(1.0, 128), bent, Camera(ALL_ROUND, 128)]
    poses = [
        Pose(np.array([*rng.uniform(-3, 3, 2), 20.0]), np.array([math.sin(a), 0, 0, math.cos(a)]))
        for a in (0, 0.1, 0.2)
    ]
    points = np.column_stack([rng.uniform(-15, 15, (60, 2)), np.full(60, TARGET_HEIGHT)])
    rows = (
        np.array([camera.optics.numbers for camera in cameras]),
        *(np.array([getattr(pose, name) for pose in poses]) for name in ("position", "quaternion")),
    )
    found = forest.find_shown(*rows, points)
    for row, camera, pose in zip(found, cameras, poses, strict=True):
        expected = forest.detectabilities(camera.lens(pose), points) * camera.sees(pose, points)
        np.testing.assert_array_equal(row, expected)
        assert np.any((row > 0.0) & (row < 1.0)) and np.any(row == 0.0)
    points[3] = np.nan
    assert not forest.find_shown(*rows, points)[:, 3].any()


@pytest.mark.parametrize("tilt", [0.0, 0.6, 1.2])
def test_samples_in_view_are_those_inside_the_image_of_beliefs_near_and_far(tilt):
    """In the open, and against single points, as most beliefs are wholly outside and end at once."""
    rng, pose = np.random.default_rng(int(10 * tilt)), Pose.level(0.0, 0.0, 20.0)
    pose = Pose(pose.position, pitch(pose.quaternion, tilt))
    means = np.column_stack([rng.uniform(-60.0, 60.0, (300, 2)), np.zeros((300, 2))])
    roots = np.tril(rng.normal(size=(300, 2, 2))) * rng.choice([1e-6, 1.0, 20.0], (300, 1, 1))
    roots[:, [0, 1], [0, 1]] = np.abs(roots[:, [0, 1], [0, 1]])
    covariances = np.zeros((300, 4, 4))
    covariances[:, :2, :2] = roots @ np.swapaxes(roots, 1, 2)
    seen = visible_samples(Forest(()), means, covariances, CAMERA.lens(pose))[:, 0]
    places = means[:, None, :2] + np.einsum("tij,kj->tki", roots, SAMPLES)
    inside = CAMERA.sees(pose, at_target_height(places.reshape(-1, 2))).reshape(seen.shape)
    assert np.mean(seen.any(axis=1) & ~seen.all(axis=1)) > 0.05 and np.mean(seen == inside) > 0.9999
