"""Trees on unseen ground, and trees with a deviation each, against forests that are drawn from the belief."""

import math
from dataclasses import replace

import numpy as np
import pytest

from planning.prediction.predicted_belief import predict_belief
from planning.testing.made_up_teams import make_random_team
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.leaf_gaps import lower_detectabilities
from tracking.geometry.line_of_sight import Raster
from tracking.geometry.unseen_ground import PRIOR_GAP, expect_unseen_trees, find_gap_fraction
from tracking.geometry.visibility import Forest, Tree, at_target_height

DRAWS = 800
AREA = (80.0, 60.0)
SIZE = Tree(0.0, 0.0, 4.0)
KNOWN = (Tree(-25.0, 5.0), Tree(-14.0, -8.0, 3.0), Tree(-30.0, -12.0, 4.0))
DEVIATIONS = (0.2, 1.0, 2.0)
DENSER = 3.0  # than expected, so that much is hidden


def middles(ground):
    rows, columns = np.indices(ground.values.shape)
    return np.stack([columns + 0.5, rows + 0.5], axis=-1) * ground.cell + ground.low


def gaps(places):
    """Distances [m] of places (..., 2) m from the nearest known crown, with three deviations."""
    trees = zip(KNOWN, DEVIATIONS, strict=True)
    return np.min([np.linalg.norm(places - (t.x, t.y), axis=-1) - t.canopy_radius - 3 * d for t, d in trees], axis=0)


def see_ground():
    """The west is seen, open except below the known crowns; so is a clearing in the east, where all else is unseen."""
    ground = Raster.over(AREA, np.full((40, 40), np.nan))
    ground.values[:, :20] = gaps(middles(ground))[:, :20] > 0.0
    ground.values[10:20, 28:33] = 1.0
    return ground


GROUND = see_ground()
EXPECTED = expect_unseen_trees(GROUND, SIZE.canopy_radius)
BELIEVED = Forest(KNOWN, "line_of_sight", DEVIATIONS, EXPECTED._replace(values=DENSER * EXPECTED.values), SIZE)


def draw(rng):
    """A forest from the belief: known trees where they may be, and a Poisson process where trees may be unknown."""
    trees = [
        replace(t, x=t.x + rng.normal(0, d), y=t.y + rng.normal(0, d)) for t, d in zip(KNOWN, DEVIATIONS, strict=True)
    ]
    counts = rng.poisson(BELIEVED.unknown.values * math.prod(GROUND.cell))
    places = np.repeat(middles(GROUND).reshape(-1, 2), counts.ravel(), axis=0)
    places += GROUND.cell * (rng.random(places.shape) - 0.5)
    return Forest((*trees, *(replace(SIZE, x=x, y=y) for x, y in places.tolist())))


@pytest.mark.parametrize("camera", [(-12.0, 0.0, 18.0), (8.0, 4.0, 20.0), (22.0, -10.0, 30.0)])
def test_the_probability_of_detection_is_the_share_of_drawn_forests_with_a_free_line_of_sight(camera):
    rng = np.random.default_rng(1)
    points = at_target_height(camera[:2] + rng.uniform(-14, 14, (30, 2)))
    lens = Camera(math.radians(120), 128).lens(Pose.level(*camera))
    told = BELIEVED.detectabilities(lens, points)
    free = sum(draw(rng).free_shares(np.array(camera), points)[0] for _ in range(DRAWS)) / DRAWS
    # At the edges of unseen ground the law errs most; 0.05 is three standard errors of the draws.
    np.testing.assert_allclose(told, free, atol=0.07 + 0.05)
    assert abs(np.mean(told - free)) < 0.025 and np.ptp(free) > 0.3


def test_far_from_seen_ground_the_gap_fraction_is_left_and_open_ground_is_open():
    camera, places = Camera(math.radians(60), 128), middles(GROUND).reshape(-1, 2)
    lenses = [camera.lens(Pose.level(*place, 1e4)) for place in places]
    told = [
        BELIEVED.detectabilities(lens, point[None])[0]
        for lens, point in zip(lenses, at_target_height(places), strict=True)
    ]
    told, gap = np.reshape(told, GROUND.values.shape), find_gap_fraction(GROUND) ** DENSER
    np.testing.assert_allclose(told[26:34, 28:34], gap, rtol=1e-9)
    assert np.all(told[(GROUND.values == 1.0) & (gaps(middles(GROUND)) > 0.0)] == 1.0)
    unseen = told[np.isnan(GROUND.values)]
    assert unseen.min() >= gap - 1e-9 and np.sum((unseen > gap + 0.05) & (unseen < 0.95)) > 50  # soft edges


def test_the_gap_fraction_is_a_prior_that_seen_ground_outweighs():
    def found(values):
        return find_gap_fraction(Raster.over((100.0, 100.0), np.array(values)))

    assert found([[np.nan, np.nan]]) == PRIOR_GAP
    assert found([[1.0, np.nan]]) == pytest.approx((0.7 * 500 + 5000) / 5500)
    assert found([[0.0, 0.0], [0.0, 1.0]]) == pytest.approx((0.7 * 500 + 2500) / 10500)
    wall = Raster.over((1e4, 1e4), np.zeros((2, 2)))
    assert find_gap_fraction(wall) == 0.01 and not expect_unseen_trees(wall, 4.0).values.any()


def test_planners_expect_unseen_trees_around_each_point_as_trackers_do():
    rng = np.random.default_rng(2)
    situation = replace(make_random_team(0, uavs=1)[0], forest=BELIEVED)
    own = replace(situation.own, position=np.array([10.0, 0.0, 20.0]))
    points = at_target_height(rng.uniform((-30, -20), (35, 25), (40, 2)))
    belief = predict_belief(replace(situation, own=own), points[:, None, None], np.eye(4)[None])
    for n, point in enumerate(points):
        camera, shares = np.add(point, (3.0, -4.0, 20.0)), np.ones(1)
        rows = belief.blockers[belief.offsets[n] : belief.offsets[n + 1]]
        lower_detectabilities(
            shares, camera[:2, None].copy(), camera[2], tuple(point.tolist()), 0.16, rows, belief.unknown
        )
        lens = Camera(math.radians(90), 128).lens(Pose.level(*camera))
        assert shares[0] == pytest.approx(BELIEVED.detectabilities(lens, point[None])[0], abs=2e-6)


def test_a_deviation_of_each_tree_is_that_of_all_if_all_have_the_same():
    one, each = Forest(KNOWN, deviation=0.5), Forest(KNOWN, deviation=(0.5,) * 3)
    np.testing.assert_array_equal(one.blockers, each.blockers)
    own = Forest(KNOWN, deviation=DEVIATIONS)
    np.testing.assert_array_equal(own.blockers[:, 6], np.take(DEVIATIONS, own.tree_of_blockers))
    assert Forest(KNOWN, deviation=(0.0,) * 3).blockers.shape[1] == 6 and own.as_mapped.blockers.shape[1] == 6
    bare = Forest((), unknown=BELIEVED.unknown)  # of no known size
    assert bare.free_shares(np.array([0.0, 0.0, 20.0]), np.array([[20.0, 20.0, 0.85]])) == 1.0 and not bare.errs
