"""Line of sight against dense sampling, probability of detection at its limits, and what holds for any scene."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree, visible_samples

CAMERA = Camera(math.radians(60), 128)
LOW, HIGH = np.array([-30.0, -30.0, 0.0]), np.array([30.0, 30.0, 22.0])
HALF = (20.0 - TARGET_HEIGHT) * math.tan(math.radians(30))  # of the field of view at a person's mid-height
FOV = math.radians(60)
CRUMB = 1e-6  # m and rad: what is nearer than this to the edge of a tree or of the image, rounding may decide
SHIFTS = st.tuples(st.floats(-500, 500), st.floats(-500, 500)).map(np.array)
MODES = st.sampled_from(["line_of_sight", "disc"])


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


def test_canopies_and_trunks_hide_what_is_under_them_or_at_their_height():
    tree = Forest((Tree(2.0, -1.0, canopy_radius=5.0),))
    for distance, free in ((0.0, False), (4.999, False), (5.001, True)):
        x = 2.0 + distance
        assert tree.visible(np.array([x, -1.0, 20.0]), np.array([x, -1.0, 0.85]))[0, 0] == free
    forest = Forest((Tree(0.0, 0.0, canopy_radius=5.0),))
    person = np.array([3.0, 0.0, 0.85])
    # The ray leaves the canopy's disc, at x = 5, below its base at 3 m only if it is flat enough.
    assert forest.visible(np.array([23.0, 0.0, 17.0]), person)[0, 0]
    assert not forest.visible(np.array([13.0, 0.0, 17.0]), person)[0, 0]
    # The trunk alone hides from the other side at the height of the eyes.
    assert not forest.visible(np.array([-20.0, 0.0, 1.5]), person)[0, 0]
    assert forest.visible(np.array([-20.0, 2.0, 1.5]), person)[0, 0]
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


def rows(*bounds, least=1, most=8):
    """Arrays (N, k) of numbers within k bounds."""
    return st.lists(st.tuples(*(st.floats(*b) for b in bounds)), min_size=least, max_size=most).map(
        lambda found: np.array(found, dtype=float).reshape(-1, len(bounds))
    )


def moved(forest: Forest, angle: float, shift: np.ndarray, grown: float = 0.0) -> Forest:
    """The forest turned about the vertical axis through the origin, shifted, its cylinders grown."""
    trees = []
    for t in forest.trees:
        x, y = turned(np.array([t.x, t.y]), angle) + shift
        size = t.canopy_radius + grown, t.canopy_base - grown, t.canopy_top + grown, t.trunk_radius + grown
        trees.append(Tree(float(x), float(y), *size))
    return Forest(tuple(trees))


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """Points (..., 2 or 3) turned about the vertical axis."""
    out = points.copy()
    out[..., 0] = math.cos(angle) * points[..., 0] - math.sin(angle) * points[..., 1]
    out[..., 1] = math.sin(angle) * points[..., 0] + math.cos(angle) * points[..., 1]
    return out


PLACES = rows((-30, 30), (-30, 30), (0, 30))
BELOW_THE_TOPS = (-25, 25), (-25, 25), (0.3, 6.0), (1.0, 3.0), (3.1, 8.0), (0.05, 0.3)  # a tree's fields


def trees(*bounds):
    return rows(*bounds, least=0).map(lambda found: tuple(Tree(*row) for row in found.tolist()))


TREES = trees(*BELOW_THE_TOPS)
BUSHES = trees((-25, 25), (-25, 25), (0.3, 6.0), (0.05, 0.4), (0.5, 0.84), (0.05, 0.3))  # lower than a person's middle
# Cameras above all of them, turned and tilted at will.
POSES = rows((-5, 5), (-5, 5), (9, 25), (-3, 3), (-0.35, 0.35), (-0.35, 0.35), most=1).map(
    lambda found: Pose(found[0, :3], Rotation.from_euler("zyx", found[0, 3:]).as_quat())
)


def gaussian(row):
    """Mean (2,) and covariance (2, 2) from a place, two standard deviations and the angle of the first."""
    turn = Rotation.from_euler("z", row[4]).as_matrix()[:2, :2]
    covariance = turn @ np.diag(np.square(row[2:4])) @ turn.T
    return row[:2], (covariance + covariance.T) / 2


BELIEFS = rows((-12, 12), (-12, 12), (0.05, 4), (0.05, 4), (-3, 3), most=4).map(
    lambda found: tuple(np.array(part) for part in zip(*map(gaussian, found), strict=True))
)
ROUND = rows((-12, 12), (-12, 12), (0.05, 4), most=4).map(
    lambda found: (found[:, :2], found[:, 2, None, None] ** 2 * np.eye(2))
)


def claim(test):
    return settings(max_examples=40, deadline=None, derandomize=True)(test)


def samples_within(pose, belief, forest):
    """Samples (N, 36) seen beyond all doubt, and those that may be seen: by less and more image, past more and less."""
    bounds = ((-CRUMB, CRUMB), (CRUMB, -CRUMB))
    return [
        visible_samples(moved(forest, 0, np.zeros(2), grown), *belief, Camera(FOV + wider, 128).lens(pose))[:, 0]
        for wider, grown in bounds
    ]


@claim
@given(TREES, PLACES, PLACES, SHIFTS, st.floats(-4, 4))
def test_moving_cameras_points_and_trees_together_changes_no_line_of_sight(trees, cameras, points, shift, angle):
    forest = Forest(trees)
    there = [turned(p, angle) + np.append(shift, 0.0) for p in (cameras, points)]
    now = moved(forest, angle, shift).visible(*there)
    surely, perhaps = (moved(forest, 0, np.zeros(2), g).visible(cameras, points) for g in (CRUMB, -CRUMB))
    assert np.all(surely <= now) and np.all(now <= perhaps)


@claim
@given(TREES, POSES, BELIEFS, SHIFTS)
def test_moving_camera_beliefs_and_trees_together_changes_no_probability_of_detection(trees, pose, belief, shift):
    forest, (means, covariances) = Forest(trees), belief
    there = Pose(pose.position + np.append(shift, 0.0), pose.quaternion)
    now = visible_samples(moved(forest, 0, shift), means + shift, covariances, CAMERA.lens(there))[:, 0]
    surely, perhaps = samples_within(pose, belief, forest)
    assert np.all(surely <= now) and np.all(now <= perhaps)


@claim
@given(TREES, POSES, ROUND, SHIFTS, st.integers(1, 3))
def test_turning_all_by_right_angles_changes_no_probability_of_detection(trees, pose, belief, shift, quarters):
    """By these alone and with round beliefs: other turns move the points that stand for a belief within it."""
    forest, (means, covariances), angle = Forest(trees), belief, quarters * math.pi / 2
    position = turned(pose.position, angle) + np.append(shift, 0.0)
    there = Pose(position, (Rotation.from_euler("z", angle) * Rotation.from_quat(pose.quaternion)).as_quat())
    means = turned(means, angle) + shift
    now = visible_samples(moved(forest, angle, shift), means, covariances, CAMERA.lens(there))[:, 0].mean(axis=1)
    surely, perhaps = (seen.mean(axis=1) for seen in samples_within(pose, belief, forest))
    assert np.all(surely <= now) and np.all(now <= perhaps)


@claim
@given(TREES, TREES, MODES, PLACES, PLACES)
def test_more_trees_never_open_a_line_of_sight(trees, more, occlusion, cameras, points):
    before = Forest(trees, occlusion).visible(cameras, points)
    assert np.all(Forest((*trees, *more), occlusion).visible(cameras, points) <= before)


@claim
@given(TREES, TREES, MODES, POSES, BELIEFS)
def test_more_trees_never_raise_the_probability_of_detection(trees, more, occlusion, pose, belief):
    few, many = Forest(trees, occlusion), Forest((*trees, *more), occlusion)
    lens = CAMERA.lens(pose)
    assert np.all(visible_samples(many, *belief, lens) <= visible_samples(few, *belief, lens))


@claim
@given(TREES, PLACES, PLACES)
def test_what_is_above_all_canopies_is_visible_from_above(trees, cameras, points):
    lift = np.array([0.0, 0.0, max((tree.canopy_top for tree in trees), default=0.0) + CRUMB])
    assert Forest(trees).visible(cameras + lift, points + lift).all()


@claim
@given(BUSHES, POSES, BELIEFS)
def test_bushes_below_peoples_mid_height_hide_no_person_from_above(bushes, pose, belief):
    seen = visible_samples(Forest(bushes), *belief, CAMERA.lens(pose))[:, 0]
    np.testing.assert_array_equal(seen, visible_samples(Forest(()), *belief, CAMERA.lens(pose))[:, 0])
