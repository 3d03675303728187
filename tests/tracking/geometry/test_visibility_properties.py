"""Properties of lines of sight and probabilities of detection for any forest, cameras and people."""

import math

import numpy as np
from helpers.displacements import moved, turned
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree, probability_of_detection, visible_samples

FOV = math.radians(60)
CAMERA = Camera(FOV, 128)
CRUMB = 1e-6  # m and rad: what is nearer than this to the edge of a tree or of the image, rounding may decide
SHIFTS = st.tuples(st.floats(-500, 500), st.floats(-500, 500)).map(np.array)
MODES = st.sampled_from(["line_of_sight", "disc"])


def rows(*bounds, least=1, most=8):
    """Arrays (N, k) of numbers within k bounds."""
    return st.lists(st.tuples(*(st.floats(*b) for b in bounds)), min_size=least, max_size=most).map(
        lambda found: np.array(found, dtype=float).reshape(-1, len(bounds))
    )


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
        visible_samples(Camera(FOV + wider, 128), pose, *belief, moved(forest, 0, np.zeros(2), grown))
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
    now = visible_samples(CAMERA, there, means + shift, covariances, moved(forest, 0, shift))
    surely, perhaps = samples_within(pose, belief, forest)
    assert np.all(surely <= now) and np.all(now <= perhaps)
    probability = probability_of_detection(CAMERA, there, means + shift, covariances, moved(forest, 0, shift))
    np.testing.assert_array_equal(probability, now.mean(axis=1))


@claim
@given(TREES, POSES, ROUND, SHIFTS, st.integers(1, 3))
def test_turning_all_by_right_angles_changes_no_probability_of_detection(trees, pose, belief, shift, quarters):
    """By these alone and with round beliefs: other turns move the points that stand for a belief within it."""
    forest, (means, covariances), angle = Forest(trees), belief, quarters * math.pi / 2
    position = turned(pose.position, angle) + np.append(shift, 0.0)
    there = Pose(position, (Rotation.from_euler("z", angle) * Rotation.from_quat(pose.quaternion)).as_quat())
    now = probability_of_detection(
        CAMERA, there, turned(means, angle) + shift, covariances, moved(forest, angle, shift)
    )
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
    assert np.all(visible_samples(CAMERA, pose, *belief, many) <= visible_samples(CAMERA, pose, *belief, few))
    after, before = (probability_of_detection(CAMERA, pose, *belief, forest) for forest in (many, few))
    assert np.all(after <= before)


@claim
@given(TREES, PLACES, PLACES)
def test_what_is_above_all_canopies_is_visible_from_above(trees, cameras, points):
    lift = np.array([0.0, 0.0, max((tree.canopy_top for tree in trees), default=0.0) + CRUMB])
    assert Forest(trees).visible(cameras + lift, points + lift).all()


@claim
@given(BUSHES, POSES, BELIEFS)
def test_bushes_below_peoples_mid_height_hide_no_person_from_above(bushes, pose, belief):
    seen = visible_samples(CAMERA, pose, *belief, Forest(bushes))
    np.testing.assert_array_equal(seen, visible_samples(CAMERA, pose, *belief, Forest(())))
    np.testing.assert_array_equal(
        probability_of_detection(CAMERA, pose, *belief, Forest(bushes)),
        probability_of_detection(CAMERA, pose, *belief, Forest(())),
    )
