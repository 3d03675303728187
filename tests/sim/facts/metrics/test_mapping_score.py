"""Errors of maps that UAVs made: by hand, and of a recording without such maps."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.mapping_score import compare_maps
from tracking.geometry.line_of_sight import Raster
from tracking.geometry.visibility import Forest, Tree

TRUE = Forest((Tree(0.0, 0.0, 3.0), Tree(7.0, 0.0, 3.0), Tree(-15.0, 0.0, 3.0), Tree(15.0, 5.0, 2.0)))
UNSEEN = Raster.over((40.0, 20.0), np.array([[0.5, 0.0, 0.0, 0.0]]))  # the west, where the third tree stands
# One tree is there twice, one is off by 0.5 m, one is none, and one is off by more than the crown's radius.
FIRST = Forest((Tree(1.0, 0.0), Tree(0.0, 0.2), Tree(7.3, 0.4), Tree(0.0, 8.0), Tree(15.0, 7.5)), unknown=UNSEEN)
SECOND = Forest((), unknown=Raster.over((40.0, 20.0), np.ones((1, 4))), unknown_tree=Tree(0.0, 0.0))


def recorded(*maps):
    """What metrics take of a recording: the true trees, and the last map of each UAV."""
    counts = {"scan_count": 1, "uav_count": len(maps), "labelled": True}
    return SimpleNamespace(maps=np.zeros(1), forest=TRUE, believed_at=lambda k, uav: maps[uav], **counts)


def test_trees_are_counted_once_and_only_on_ground_that_was_seen():
    errors = compare_maps(recorded(FIRST))
    assert (errors.seen, errors.found, errors.mapped) == (3, 2, 5)
    assert sorted(errors.distances) == pytest.approx([0.2, 0.5])
    assert compare_maps(recorded(FIRST, SECOND))[:3] == (3, 2, 5)
    assert compare_maps(recorded(FIRST, FIRST))[:3] == (6, 4, 10)


def test_metrics_are_shares_and_a_mean_and_none_without_own_maps():
    def values(recording):
        outcome = SimpleNamespace(recording=recording)
        return [METRICS[f"map.{name}"](outcome) for name in ("recall", "false_share", "error_m")]

    assert values(recorded(FIRST)) == pytest.approx([2 / 3, 3 / 5, math.sqrt((0.04 + 0.25) / 2)])
    assert values(recorded(SECOND)) == [None, None, None]
    given = recorded(FIRST)
    given.maps = None
    assert values(given) == [None, None, None]
