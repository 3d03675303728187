"""Spatial culling against testing every cylinder."""

import math

import numpy as np
import pytest

from tracking.geometry.line_of_sight import is_blocked
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.compiled import compiled


@compiled
def exhaustive(cameras, points, cylinders):
    """Line of sight past every cylinder, one after the other."""
    free = np.ones((len(cameras), len(points)), dtype=np.bool_)
    for i in range(len(cameras)):
        for j in range(len(points)):
            for k in range(len(cylinders)):
                if is_blocked(cameras[i], points[j], cylinders[k]):
                    free[i, j] = False
                    break
    return free


def scene(rng, trees, span, occlusion="line_of_sight"):
    """Trees of all sizes and heights, also such that overlap, in a square of 2 `span` m."""
    bases = rng.uniform(0, 5, trees)
    return Forest(
        tuple(
            Tree(
                *rng.uniform(-span, span, 2), rng.uniform(0.5, 5), base, base + rng.uniform(0, 4), rng.uniform(0.1, 0.5)
            )
            for base in bases
        ),
        occlusion,
    )


def segments(rng, kind, span):
    """Cameras (40, 3) and points (100, 3): from above, from anywhere, far outside, on level and upright lines."""
    reach = {"outside": 3 * span, "horizon": 1e4 * span}.get(kind, span)
    lowest = 17.0 if kind == "above" else -1.0
    cameras = rng.uniform([-reach, -reach, lowest], [reach, reach, 22], (40, 3))
    points = rng.uniform([-reach, -reach, 0], [reach, reach, 7], (100, 3))
    if kind == "above":
        points[:, 2] = TARGET_HEIGHT
    if kind == "rounded":  # many equal heights, upright segments and segments of length zero
        cameras, points = np.round(cameras), np.round(points)
        points[:20], points[20:40, :2] = cameras[:20], cameras[20:, :2]
    return cameras, points


@pytest.mark.parametrize("occlusion", ["line_of_sight", "disc"])
@pytest.mark.parametrize("trees", [0, 1, 2, 12, 75])
def test_culling_changes_no_line_of_sight(trees, occlusion):
    rng = np.random.default_rng(trees)
    hidden = 0
    for span in (10.0, 30.0, 75.0):
        forest = scene(rng, trees, span, occlusion)
        for kind in ("above", "anywhere", "outside", "horizon", "rounded"):
            cameras, points = segments(rng, kind, span)
            free = forest.visible(cameras, points)
            np.testing.assert_array_equal(free, exhaustive(cameras, points, forest.blockers))
            hidden += np.sum(~free)
    assert (hidden > 20) == (trees > 0)


def test_what_is_not_a_number_is_answered_as_without_culling():
    forest = scene(np.random.default_rng(1), 20, 20.0)
    cameras, points = segments(np.random.default_rng(2), "anywhere", 20.0)
    cameras[:9] = np.where(np.arange(27).reshape(9, 3) % 4 == 0, np.nan, cameras[:9])
    np.testing.assert_array_equal(forest.visible(cameras, points), exhaustive(cameras, points, forest.blockers))


def test_a_grid_over_trees_far_apart_stays_small_and_exact():
    forest = Forest((Tree(-5e5, 2e5), Tree(5e5, -2e5), Tree(0.0, 0.0)))
    assert len(forest.grid.starts) < 600_000
    for tree in forest.trees:
        person = np.array([tree.x, tree.y + 1.0, TARGET_HEIGHT])
        above, aside = np.array([0.0, 2.0, 19.0]), np.array([0.0, 8.0, 0.0])
        assert not forest.visible(person + above, person)[0, 0]
        assert forest.visible(person + above + aside, person + aside)[0, 0]
        west, east = np.array([tree.x - 30.0, tree.y, 4.0]), np.array([tree.x + 30.0, tree.y, 4.0])
        assert not forest.visible(west, east)[0, 0]
    assert math.isclose(forest.grid.high[0], 5e5 + 5.0, abs_tol=1e-3)
