"""Probabilities that lines of sight are free past trees whose places err, against drawn places and brute force."""

import math

import numpy as np
import pytest

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.leaf_gaps import lower_detectabilities, middle_detectability
from tracking.geometry.line_of_sight import is_blocked
from tracking.geometry.map_errors import clear_probability, hiding_probability
from tracking.geometry.visibility import Forest, Tree, at_target_height

DRAWS = 20_000


@pytest.mark.parametrize(
    ("radius", "deviation", "within", "bias"),
    [
        (0.2, 0.2, 0.012, 0.005),
        (0.2, 0.5, 0.004, 0.001),
        (0.2, 2.0, 0.002, 0.001),
        (0.8, 0.5, 0.05, 0.02),  # where neither approximation is good
        (1.5, 0.5, 0.02, 0.006),
        (5.0, 0.1, 0.004, 0.001),
        (5.0, 0.5, 0.006, 0.002),
        (5.0, 2.0, 0.03, 0.01),
    ],
)
def test_the_probability_of_being_hidden_is_that_of_drawn_places(radius, deviation, within, bias):
    rng, off, compared = np.random.default_rng(round(10 * radius + deviation)), [], 0
    for _ in range(25):
        origin = np.array([*rng.uniform(-12, 12, 2), rng.uniform(8, 25)])
        if rng.random() < 0.2:
            origin[:2] = 0.0  # straight above
        point = np.array([0.0, 0.0, 0.85])
        side = radius + deviation * rng.uniform(-2.5, 2.5)
        angle = rng.uniform(0, 2 * math.pi)
        low = rng.choice([0.85, 3.0])
        through = point + (low - 0.85) / (origin[2] - 0.85) * (origin - point)
        place = through[:2] + side * np.array([math.cos(angle), math.sin(angle)])
        top = low if rng.random() < 0.1 else low + 3.0  # as of the paper's discs
        found = hiding_probability(tuple(origin), tuple(point), (*place, radius, low, top, math.inf), deviation)
        offsets = rng.normal(0.0, deviation, (DRAWS, 2))
        hits = [is_blocked(origin, point, (*p, radius, low, top)) for p in (place + offsets).tolist()]
        error = math.sqrt(max(found * (1 - found), 1e-4) / DRAWS)
        assert found == pytest.approx(np.mean(hits), abs=4 * error + within)
        off.append(found - np.mean(hits))
        compared += 0.001 < found < 0.95
    assert compared >= 5 and abs(np.mean(off)) < bias


def test_far_from_every_edge_it_is_the_believed_line_of_sight():
    crown = (0.0, 0.0, 5.0, 3.0, 6.0, math.inf)
    assert hiding_probability((0.0, 0.0, 20.0), (0.0, 0.0, 0.85), crown, 0.5) == 1.0
    assert hiding_probability((9.0, 0.0, 20.0), (9.0, 0.0, 0.85), crown, 0.5) == 0.0
    assert hiding_probability((9.0, 0.0, 2.0), (-9.0, 0.0, 2.0), crown, 5.0) == 0.0  # below it


@pytest.mark.parametrize("occlusion", ["line_of_sight", "disc"])
def test_many_trees_hide_independently_whatever_the_raster(occlusion):
    rng = np.random.default_rng(4)
    trees = tuple(Tree(*rng.uniform(-40, 40, 2), rng.uniform(0.5, 3.0), 3.0, rng.uniform(4, 12)) for _ in range(60))
    forest, partly = Forest(trees, occlusion, deviation=0.8), 0
    assert forest.blockers.shape == (60 if occlusion == "disc" else 120, 7)
    for _ in range(300):
        origin, point = (
            tuple(rng.uniform([-45, -45, low], [45, 45, high]).tolist()) for low, high in ((2, 30), (0, 2))
        )
        expected = math.prod(1.0 - hiding_probability(origin, point, row[:6], 0.8) for row in forest.blockers)
        assert clear_probability(origin, point, forest.blockers, forest.grid) == pytest.approx(expected, abs=2e-6)
        partly += 0.01 < expected < 0.99
    assert partly > 20


@pytest.mark.parametrize("occlusion", ["line_of_sight", "disc"])
def test_of_unknown_trees_none_is_in_the_way_as_often_as_in_drawn_forests(occlusion):
    """Poisson fields of trees of the mean size of the known ones, on lines that are far from these."""
    rng, density = np.random.default_rng(8), 0.004
    known = (Tree(300.0, 300.0, 2.0, 3.0, 6.0, 0.0), Tree(320.0, 300.0, 4.0, 3.0, 8.0, 0.0))
    forest = Forest(known, occlusion, deviation=0.5, unknown=density)
    origin, points = np.array([0.0, 0.0, 20.0]), np.array([[0.0, 0.0, 0.85], [7.0, -3.0, 0.85], [-30.0, 20.0, 0.85]])
    found = [middle_detectability(tuple(origin), tuple(p), 0.1, forest.blockers, forest.grid) for p in points.tolist()]
    free = np.zeros(len(points))
    for _ in range(3000):
        places = rng.uniform(-60, 60, (rng.poisson(density * 120**2), 2))
        drawn = Forest(tuple(Tree(x, y, 3.0, 3.0, 7.0, 0.0) for x, y in places.tolist()), occlusion)
        free += drawn.free_shares(origin, points)[0]
    np.testing.assert_allclose(found, free / 3000, atol=0.022)
    shares = np.ones(1)
    lower_detectabilities(
        shares, np.zeros((2, 1)), 20.0, tuple(points[1].tolist()), 0.1, forest.blockers, forest.grid.unknown
    )
    assert shares[0] == pytest.approx(found[1], abs=2e-6)
    assert forest.shares_hidden(origin, points).shape == (3, 2)
    bare = Forest((), occlusion, deviation=0.5, unknown=density)
    assert middle_detectability((0.0, 0.0, 20.0), (0.0, 0.0, 0.85), 0.1, bare.blockers, bare.grid) == 1.0


@pytest.mark.parametrize("leaves", [math.inf, 0.5])
def test_planners_and_trackers_have_the_same_probability_and_leaves_come_on_top(leaves):
    rng = np.random.default_rng(6)
    trees = [Tree(*rng.uniform(-15, 15, 2), 3.0) for _ in range(4)]
    trees += [Tree(*rng.uniform(-15, 15, 2), 3.0, 3.0, 6.0, 0.2, leaves) for _ in range(4)]
    forest, exact = Forest(tuple(trees), deviation=1.0), Forest(tuple(trees))
    opaque = Forest(tuple(tree for tree in trees if math.isinf(tree.leaf_area_density)), deviation=1.0)
    trunks = [row for row in forest.blockers if math.isinf(row[5])]
    for _ in range(100):
        point = (*rng.uniform(-15, 15, 2).tolist(), 0.85)
        cameras = np.array([(*(point[:2] + rng.uniform(-8, 8, 2)), 18.0) for _ in range(5)])
        shares = np.array([1.0, 1.0, 1.0, 0.0, 1.0])
        lower_detectabilities(shares, cameras[:, :2].T.copy(), 18.0, point, 0.1, forest.blockers, forest.grid.unknown)
        for lane, camera in enumerate(cameras.tolist()):
            clear = math.prod(1.0 - hiding_probability(tuple(camera), point, row[:6], 1.0) for row in trunks)
            alone = Forest(tuple(t for t in trees if math.isfinite(t.leaf_area_density)))
            through = alone.detectabilities_through_leaves
            middle = middle_detectability(tuple(camera), point, 0.1, forest.blockers, forest.grid)
            assert shares[lane] == pytest.approx(0.0 if lane == 3 else middle, abs=2e-6)
            lens = Camera(math.radians(60), 128).lens(Pose.level(*camera))
            whole = forest.detectabilities(lens, np.array([point]))[0]
            assert whole == pytest.approx(clear * through(lens, np.array([point]))[0], abs=2e-6)
    assert exact.blockers.shape[1] == 6 and len(opaque.trees) >= 4


def test_the_edge_of_a_shadow_is_as_wide_as_the_error_of_the_map():
    """Straight below the camera along the east of a crown: the normal distribution, with the crown's curvature."""
    forest, x = Forest((Tree(0.0, 0.0),), deviation=0.5), np.linspace(3.0, 7.0, 9)
    shown = [
        forest.detectabilities(Camera(1.0, 128).lens(Pose.level(e, 0.0, 1e4)), at_target_height(np.array([[e, 0.0]])))[
            0
        ]
        for e in x
    ]
    from scipy.stats import ncx2

    np.testing.assert_allclose(shown, ncx2.sf((5.0 / 0.5) ** 2, 2, (x / 0.5) ** 2), atol=0.004)
