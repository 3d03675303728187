"""Maps of several UAVs fused into one: closed forms, and draws of what they would have measured."""

from itertools import permutations

import numpy as np
import pytest

from tracking.geometry.line_of_sight import Raster
from tracking.geometry.visibility import Tree
from tracking.mapping.fusion import TreeMap, fuse_maps
from tracking.mapping.mapper import MappedTree

AREA = (40.0, 40.0)


def covariance_of(*deviations, cross=0.0):
    found = np.diag(np.square(deviations))
    found[0, 2] = found[2, 0] = cross
    return found


def mapped(x, y, radius=4.0, base=3.0, top=8.0, deviations=(0.2, 0.2, 0.2, 0.5, 0.3), existence=0.99, rim=0.8):
    return MappedTree(Tree(x, y, radius, base, top), covariance_of(*deviations), existence, rim)


def seen(value=np.nan):
    return Raster.over(AREA, np.full((20, 20), value))


def sizes(found):
    tree = found.tree
    return np.array([tree.x, tree.y, tree.canopy_radius, tree.canopy_base, tree.canopy_top])


def test_two_estimates_of_one_tree_are_fused_by_their_information():
    one = MappedTree(Tree(1.0, 2.0, 4.0, 3.0, 8.0), covariance_of(0.3, 0.1, 0.2, 0.5, 0.3, cross=0.03), 0.9, 0.4)
    other = MappedTree(Tree(1.2, 2.1, 4.2, 3.4, 8.1), covariance_of(0.1, 0.3, 0.3, 0.7, 0.2, cross=-0.02), 0.8, 0.7)
    (fused,) = fuse_maps([TreeMap((one,), seen()), TreeMap((other,), seen())]).trees
    P = np.linalg.inv(np.linalg.inv(one.covariance) + np.linalg.inv(other.covariance))
    mean = P @ (np.linalg.solve(one.covariance, sizes(one)) + np.linalg.solve(other.covariance, sizes(other)))
    np.testing.assert_allclose(fused.covariance, P, rtol=1e-10)
    np.testing.assert_allclose(sizes(fused), mean, rtol=1e-10)
    assert fused.existence == pytest.approx(0.9 * 0.8 / (0.9 * 0.8 + 0.1 * 0.2))


def test_fused_trees_are_as_far_off_as_they_say():
    rng, deviations = np.random.default_rng(0), np.array([0.2, 0.3, 0.15, 0.5, 0.3])
    true, errors = np.array([0.0, 0.0, 4.0, 3.0, 8.0]), []
    for _ in range(400):
        maps = []
        for scale in (1.0, 0.5, 2.0):
            x, y, radius, base, top = true + scale * deviations * rng.normal(size=5)
            maps.append(TreeMap((mapped(x, y, radius, base, top, scale * deviations),), seen()))
        found = fuse_maps(maps).trees
        assert len(found) == 1
        gap = (sizes(found[0]) - true)[:2]
        errors.append(gap @ np.linalg.solve(found[0].covariance[:2, :2], gap) / 2)
    assert np.mean(errors) == pytest.approx(1.0, abs=0.15)


def test_the_order_of_maps_does_not_matter():
    rng = np.random.default_rng(1)
    maps = [
        TreeMap(tuple(mapped(x + rng.normal(0, 0.2), 0.0) for x in (-12.0, 0.0, 12.0)[k:]), seen()) for k in range(3)
    ]
    one, other = (sorted(sizes(tree).tolist() for tree in fuse_maps(order).trees) for order in (maps, maps[::-1]))
    np.testing.assert_allclose(one, other, rtol=1e-9)
    assert len(one) == 3


@pytest.mark.parametrize("opens", [1, 2])
def test_each_map_that_has_open_ground_where_a_tree_stands_lowers_its_odds_once_in_any_order(opens):
    tree = mapped(0.0, 0.0, existence=0.9999)
    maps = [TreeMap((tree,), seen()), *(TreeMap((), seen(1.0)) for _ in range(opens)), TreeMap((), seen())]
    odds = 0.9999 / 0.0001 * 0.02**opens
    for order in permutations(maps):
        (found,) = fuse_maps(order).trees
        assert found.existence == pytest.approx(odds / (1 + odds), rel=1e-9)


def test_of_two_that_contradict_each_other_the_better_seen_one_stays():
    good, cut = mapped(0.0, 0.0, rim=0.9), mapped(1.5, 0.0, rim=0.2)
    for maps in ((good, cut), (cut, good)):
        (found,) = fuse_maps([TreeMap((tree,), seen()) for tree in maps]).trees
        np.testing.assert_array_equal(sizes(found), sizes(good))


def test_touching_trees_stay_two():
    found = fuse_maps([TreeMap((mapped(0.0, 0.0),), seen()), TreeMap((mapped(4.5, 0.0),), seen())]).trees
    assert len(found) == 2


@pytest.mark.parametrize(("existence", "ground", "stays"), [(0.9, 1.0, False), (0.999, 1.0, True), (0.9, np.nan, True)])
def test_a_tree_where_another_uav_saw_open_ground_has_to_be_sure(existence, ground, stays):
    tree = TreeMap((mapped(0.0, 0.0, existence=existence),), seen())
    for maps in ([tree, TreeMap((), seen(ground))], [TreeMap((), seen(ground)), tree]):
        assert bool(fuse_maps(maps).trees) == stays


def test_ground_is_seen_if_one_uav_saw_it_and_covered_below_trees():
    west, east = seen(), seen()
    west.values[:, :10], east.values[:, 10:] = 1.0, 1.0
    fused = fuse_maps([TreeMap((mapped(0.0, 0.0, existence=0.999),), west), TreeMap((), east)])
    values = fused.ground.values
    assert np.isnan(west.values[0, 15]) and np.isnan(east.values[0, 5])  # what was given is not changed
    assert values[9, 9] == values[10, 10] == 0.0 and values[0, 5] == values[0, 15] == 1.0
    assert np.count_nonzero(values == 0.0) == pytest.approx(np.pi * 4**2 / 4, abs=2)
