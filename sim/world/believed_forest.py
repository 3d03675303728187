"""The map of trees that UAVs believe: trackers, detectors, planners, the search map and explanations ask here."""

import math
from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.exponential import exp_each, log
from tracking.numerics.normal import standard_normal


def believe_forest(forest: Forest, scenario: Scenario, seed: int) -> Forest:
    """The map of trees that UAVs are given, with the model of occlusion that they assume, drawn from a mission's seed.

    forest: the true trees. The errors are those of `scenario.believed`. Each kind has its own random stream, and a
    larger share has all the missing or invented trees of a smaller one. Radii and heights of a tree are off by two
    factors of mean 1, which are log-normal. Invented trees stand anywhere in the area, and have the sizes of others.
    """
    errors, occlusion = scenario.believed, scenario.sensing.occlusion
    if scenario.mapping.forest != "known":
        return Forest((), occlusion)
    trees = forest.trees if errors.knows_trees or not forest.trees else _mislead(forest.trees, scenario, seed)
    unknown = len(trees) * errors.trees_unknown / (1.0 - errors.trees_unknown)
    per_area = unknown / (scenario.area.width * scenario.area.height)
    believed = Forest(trees, occlusion, errors.tree_deviation, per_area)
    same = (believed.trees, believed.occlusion) == (forest.trees, forest.occlusion)
    return forest if same and errors.tree_deviation == unknown == 0.0 else believed


def _mislead(trees: Sequence[Tree], scenario: Scenario, seed: int) -> tuple[Tree, ...]:
    """The trees with the errors of `scenario.believed`."""
    errors = scenario.believed
    shifts, sizes, order, places = (stream(seed, "believed forest", kind) for kind in range(4))
    rows = np.array([astuple(tree) for tree in trees], dtype=float)
    count, spread = len(rows), math.sqrt(log(1.0 + errors.tree_sizes * errors.tree_sizes))
    rows[:, :2] += errors.tree_shift * standard_normal(shifts, (count, 2))
    factors = exp_each(spread * standard_normal(sizes, 2 * count) - 0.5 * spread * spread)
    rows[:, [2, 5]] *= factors[:count, None]  # radii
    rows[:, [3, 4]] *= factors[count:, None]  # heights
    rows[:, 6] *= errors.leaf_area
    missing = np.argsort(order.random(count), kind="stable")[: round(errors.trees_missing * count)]
    drawn = places.random((round(errors.trees_invented * count), 3))
    invented = rows[(drawn[:, 2] * count).astype(np.int64)]
    invented[:, :2] = (drawn[:, :2] - 0.5) * (scenario.area.width, scenario.area.height)
    believed = np.concatenate([np.delete(rows, missing, axis=0), invented])
    return tuple(Tree(*row) for row in believed.tolist())
