import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.spatial.distance import pdist

from sim.scenario.environment import Area, Trees
from sim.world.forest import GAP, PATH_GAP, crown_radius, grow, trunk_radius

AREA = Area()


def centres(trees, seed, area=AREA, **keywords):
    forest = grow(trees, area, np.random.default_rng(seed), **keywords)
    return np.array([(t.x, t.y) for t in forest.trees]).reshape(-1, 2)


@pytest.mark.parametrize("density", [3, 15, 45])
def test_count_is_poisson(density):
    counts = [len(centres(Trees(density=density), seed)) for seed in range(300)]
    # Ten bins of about equal probability.
    edges = np.unique(stats.poisson.ppf(np.linspace(0.1, 0.9, 9), density))
    probability = np.diff(stats.poisson.cdf([-1, *edges, np.inf], density))
    observed = np.bincount(np.searchsorted(edges, counts), minlength=len(probability))
    assert stats.chisquare(observed, 300 * probability).pvalue > 0.01


@pytest.mark.parametrize("largest", [None, 7.0])
def test_places_are_those_of_drawing_trees_one_by_one(largest):
    trees = Trees(density=75 if largest is None else 50, largest_radius=largest)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        expected = []
        count = rng.poisson(trees.density)
        radii = np.full(count, 5.0) if largest is None else np.sort(rng.uniform(5, largest, count))[::-1]
        while len(expected) < count:
            candidate = rng.uniform([-75, -50], [75, 50])
            sums = radii[: len(expected)] + radii[len(expected)]
            if all(np.hypot(*(candidate - c)) >= sum_ for c, sum_ in zip(expected, sums, strict=True)):
                expected.append(candidate)
        assert np.array_equal(centres(trees, seed), expected)


def test_forests_of_any_size_have_uniform_places():
    places = np.vstack([centres(Trees(density=75, canopy_radius=0.3), seed) for seed in range(40)])
    assert stats.kstest(places[:, 0], stats.uniform(-75, 150).cdf).pvalue > 0.01
    assert stats.kstest(places[:, 1], stats.uniform(-50, 100).cdf).pvalue > 0.01
    assert pdist(centres(Trees(density=750), 0, Area(width=475.0, height=316.0))).min() >= 10


def test_trees_have_the_shape_density_and_seed_of_the_scenario():
    trees = Trees(density=20, canopy_radius=2.0, canopy_base=2.5, canopy_top=7.0, trunk_radius=0.3)
    for tree in grow(trees, AREA, np.random.default_rng(0)).trees:
        shape = (tree.canopy_radius, tree.canopy_base, tree.canopy_top, tree.trunk_radius)
        assert shape == (2.0, 2.5, 7.0, 0.3)
    assert np.array_equal(centres(Trees(), 7), centres(Trees(), 7))
    assert not np.array_equal(centres(Trees(), 7)[:10], centres(Trees(), 8)[:10])
    assert grow(Trees(density=0), AREA, np.random.default_rng(0)).trees == ()


def test_crowns_of_a_range_of_radii_do_not_overlap_and_count_by_the_hectare():
    trees = Trees(per_hectare=300, canopy_radius=1.0, largest_radius=3.0, density=3)
    counts, radii = [], []
    for seed in range(3):
        forest = grow(trees, AREA, np.random.default_rng(seed)).trees
        places, own = np.array([(t.x, t.y) for t in forest]), np.array([t.canopy_radius for t in forest])
        gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) - own[:, None] - own
        assert gaps[~np.eye(len(own), dtype=bool)].min() >= 0
        counts.append(len(own))
        radii.append(own)
    assert abs(np.mean(counts) - 450) < 40
    assert stats.kstest(np.concatenate(radii), stats.uniform(1, 2).cdf).pvalue > 0.01
    with pytest.raises(ValueError, match=r"trees\.per_hectare = 3500: .* of 1 to 3 m radius"):
        grow(Trees(per_hectare=3500, canopy_radius=1.0, largest_radius=3.0), AREA, np.random.default_rng(0))


def test_no_trunk_stands_on_a_point_to_keep_clear():
    path = np.column_stack([np.linspace(-75, 75, 400), np.zeros(400)])
    trees = Trees(density=75, canopy_radius=1.0)
    near = [np.abs(centres(trees, seed)[:, 1]).min() for seed in range(20)]
    kept = [np.abs(centres(trees, seed, keep_clear=path)[:, 1]).min() for seed in range(20)]
    assert min(near) < 0.2 and min(kept) >= 0.2 + PATH_GAP - 0.03


@pytest.mark.parametrize("density, radius, fits", [(150, 5, 105), (1e15, 5, 180), (9000, 0.7, 4000)])
def test_a_forest_too_dense_fails_and_says_what_fits(density, radius, fits):
    with pytest.raises(ValueError, match=re.escape(f"trees.density = {density:g}: ")) as error:
        grow(Trees(density=density, canopy_radius=radius), AREA, np.random.default_rng(0))
    said = int(str(error.value).split(" trees with canopies")[0].split()[-1])
    assert fits <= said <= 1.3 * fits


def test_trees_of_random_height_have_the_crowns_and_trunks_of_the_allometry():
    trees = Trees(per_hectare=1000, height=(8.0, 22.0), overlap=True)
    forest = grow(trees, AREA, np.random.default_rng(2)).trees
    heights = np.array([tree.canopy_top for tree in forest])
    assert stats.kstest(heights, stats.uniform(8, 14).cdf).pvalue > 0.01
    assert_allclose([tree.canopy_base for tree in forest], 0.5 * heights)
    # Forward: [Chave14] gives the height of these diameters, and [Jucker17] the diameters of these heights and crowns.
    diameters = np.array([200 * tree.trunk_radius for tree in forest])
    crowns = np.array([2 * tree.canopy_radius for tree in forest])
    logs = np.log(diameters)
    assert_allclose(np.exp(0.893 + 0.760 * logs - 0.0340 * logs**2), heights, rtol=1e-12)
    assert_allclose(0.557 * (heights * crowns) ** 0.809 * np.exp(0.056**2 / 2), diameters, rtol=1e-12)
    assert crown_radius(8.0) == pytest.approx(1.04, abs=0.01) and trunk_radius(40.0) == pytest.approx(0.52, abs=0.01)


@pytest.mark.parametrize("density", [300, 1500])
def test_crowns_overlap_by_choice_and_people_pass_between_trunks(density):
    counts = []
    for seed in range(4):
        trees = Trees(per_hectare=density, canopy_radius=1.0, largest_radius=3.0, overlap=True)
        forest = grow(trees, AREA, np.random.default_rng(seed)).trees
        places = np.array([(tree.x, tree.y) for tree in forest])
        assert pdist(places).min() >= 2 * 0.2 + GAP
        assert density == 300 or (pdist(places) < 2.0).any()  # crowns of 1 m and more overlap
        counts.append(len(forest))
    assert abs(np.mean(counts) - 1.5 * density) < 4 * np.sqrt(1.5 * density / 4)
    with pytest.raises(ValueError, match=r"trees\.per_hectare = 9000: .* 150 x 100 m 1 m apart; lower the density or"):
        grow(Trees(per_hectare=9000, overlap=True), AREA, np.random.default_rng(0))
