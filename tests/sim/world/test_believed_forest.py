"""Errors of the map of trees that UAVs believe: as large as asked for, and drawn from the seed alone."""

import dataclasses
import math

import numpy as np
import pytest
from msgspec.structs import replace

from sim.scenario.believed import Believed
from sim.scenario.environment import Area
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from sim.world.believed_forest import believe_forest
from tracking.geometry.visibility import Forest, Tree

AREA = Area(width=3000.0, height=1000.0)
TREES = [
    Tree(*row, 4.0 + k % 3, 3.0, 7.0, 0.3, 0.4)
    for k, row in enumerate(np.random.default_rng(3).uniform(-400, 400, (4000, 2)))
]
TRUE = Forest(tuple(TREES))


def believed(seed=5, forest=TRUE, **errors):
    return believe_forest(forest, Scenario(area=AREA, believed=Believed(**errors)), seed).trees


def rows(trees):
    return np.array([dataclasses.astuple(tree) for tree in trees])


def test_without_errors_the_map_is_the_true_one():
    assert believe_forest(TRUE, Scenario(), 0) is TRUE
    discs = believe_forest(TRUE, Scenario(sensing=Sensing(occlusion="disc"), believed=Believed(speed=2.0)), 0)
    assert discs.occlusion == "disc" and discs.trees == TRUE.trees
    bare = Forest(())
    assert believe_forest(bare, Scenario(believed=Believed(trees_invented=1.0)), 0) is bare


def test_shifts_have_the_deviation_along_each_axis_and_nothing_else_changes():
    moved = rows(believed(tree_shift=0.5)) - rows(TREES)
    assert moved[:, :2].std(axis=0) == pytest.approx(0.5, rel=0.04) and moved[:, :2].mean() == pytest.approx(
        0, abs=0.02
    )
    assert abs(np.corrcoef(moved[:, :2].T)[0, 1]) < 0.05 and not moved[:, 2:].any()


def test_sizes_have_mean_one_and_the_relative_deviation():
    ratio = rows(believed(tree_sizes=0.3)) / rows(TREES)
    for column in (2, 3):
        assert ratio[:, column].mean() == pytest.approx(1.0, abs=0.02)
        assert ratio[:, column].std() == pytest.approx(0.3, rel=0.06)
    np.testing.assert_allclose(ratio[:, 5], ratio[:, 2])  # trunk and crown
    np.testing.assert_allclose(ratio[:, 4], ratio[:, 3])  # base and top
    assert abs(np.corrcoef(ratio[:, 2], ratio[:, 3])[0, 1]) < 0.05
    np.testing.assert_array_equal(ratio[:, [0, 1, 6]], 1.0)


def test_missing_and_invented_trees_are_the_shares_and_nested():
    few, many = (set(believed(trees_missing=share)) for share in (0.2, 0.5))
    assert len(few) == 3200 and many < few < set(TREES) and len(many) == 2000
    assert believed(trees_missing=1.0) == ()
    here, more = (believed(trees_invented=share) for share in (0.1, 0.25))
    assert here[:4000] == more[:4000] == TRUE.trees and len(more) == 5000 and more[4000:4400] == here[4000:]
    invented = rows(more[4000:])
    for axis, side in enumerate((3000.0, 1000.0)):  # uniform over the area
        assert np.abs(invented[:, axis]).max() <= side / 2
        assert invented[:, axis].std() == pytest.approx(side / math.sqrt(12), rel=0.06)
    shares = [np.mean(invented[:, 2] == radius) for radius in (4.0, 5.0, 6.0)]  # the sizes of others
    assert shares == pytest.approx([1 / 3] * 3, abs=0.05)


def test_leaf_area_is_off_by_a_factor_and_opaque_crowns_stay_opaque():
    assert all(tree.leaf_area_density == pytest.approx(0.8) for tree in believed(leaf_area=2.0))
    opaque = believed(forest=Forest((Tree(0.0, 0.0),)), leaf_area=0.5, tree_shift=1.0)
    assert math.isinf(opaque[0].leaf_area_density)


def test_what_uavs_reckon_with_is_in_the_map_whether_it_errs_or_not():
    scenario = Scenario(area=AREA, believed=Believed(tree_deviation=0.5, trees_unknown=0.2))
    found = believe_forest(TRUE, scenario, 0)
    assert found.trees == TRUE.trees and found.deviation == 0.5
    assert found.unknown == pytest.approx(1000 / 3e6)  # 4000 of 5000 trees are known
    half = believe_forest(TRUE, replace(scenario, believed=Believed(trees_missing=0.5, trees_unknown=0.5)), 0)
    assert len(half.trees) == 2000 and half.unknown == pytest.approx(2000 / 3e6) and half.deviation == 0.0
    empty = believe_forest(TRUE, replace(scenario, believed=Believed(trees_missing=1.0, trees_unknown=0.5)), 0)
    assert empty.trees == () and empty.unknown == 0.0


def test_errors_are_independent_of_one_another_and_depend_on_the_seed_alone():
    kinds = {"tree_shift": 1.0, "tree_sizes": 0.2, "trees_missing": 0.4, "trees_invented": 0.3}
    both = believed(**kinds)
    assert both == believed(**kinds) != believed(seed=6, **kinds)
    kept = [TREES.index(tree) for tree in believed(trees_missing=0.4)]
    place, size = rows(believed(tree_shift=1.0))[kept], rows(believed(tree_sizes=0.2))[kept]
    np.testing.assert_array_equal(rows(both)[: len(kept), :2], place[:, :2])
    np.testing.assert_array_equal(rows(both)[: len(kept), 2:], size[:, 2:])
    added = [rows(trees)[-1200:, :2] for trees in (both, believed(trees_invented=0.3))]
    np.testing.assert_array_equal(*added)


def test_the_map_of_a_seed_stays_the_same_from_release_to_release():
    """Recordings hold the true trees only; what was believed is drawn again from their seed."""
    two = Forest((Tree(1.0, 2.0), Tree(-8.0, 9.0), Tree(20.0, -30.0)))
    found = believed(0, two, tree_shift=1.0, tree_sizes=0.1, trees_missing=0.4, trees_invented=0.4)
    np.testing.assert_array_equal(rows(found)[:, :6], EXPECTED)


EXPECTED = [
    [
        1.8317917286575138,
        0.7700935421481976,
        5.082739144541444,
        2.781713122041864,
        5.563426244083728,
        0.20330956578165776,
    ],
    [
        19.998597101793663,
        -29.306398135528624,
        4.690262703865043,
        2.855333513981196,
        5.710667027962392,
        0.18761050815460173,
    ],
    [
        -331.4538058748854,
        477.505811548768,
        4.216912335991458,
        2.4180315656339273,
        4.836063131267855,
        0.16867649343965835,
    ],
]  # exact
