"""Porous crowns: the share of gaps in images follows from the leaf area density, from above and obliquely."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.views import SCENARIO

from sim.facts.rerender import Rerenderer
from sim.mission.archive import compute_digest
from sim.sensing.detection_truth import count_visible_pixels
from sim.sensing.rasteriser import Rasteriser
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.quaternions import rotation
from tracking.geometry.visibility import Forest, Tree
from understory import run

CROWN = Tree(0.0, 0.0, 3.0, 3.0, 6.0, 0.01)
FAR = Camera(math.radians(1.0), 64)  # from so far away that all rays through a crown are parallel


def gap(tree, seeds, tilt):
    """Share of gaps, over crowns of as many seeds, around the middle of a crown seen at `tilt` rad from the zenith."""
    middle = np.array([tree.x, tree.y, (tree.canopy_base + tree.canopy_top) / 2])
    pose = Pose(np.zeros(3), np.array([math.sin(tilt / 2), 0.0, 0.0, math.cos(tilt / 2)]))
    camera = Pose(middle + 100.0 * rotation(pose.quaternion)[:, 2], pose.quaternion)
    shares = []
    for seed in range(seeds):
        with World(SCENARIO, Forest((tree,)), 0, seed) as world:
            shares.append(np.mean(Rasteriser(world).draw(FAR, camera, np.ones(len(world.models), np.bool_)).bodies < 0))
    return np.mean(shares), np.std(shares) / math.sqrt(seeds)


@pytest.mark.parametrize("density", [0.1, 0.3, 0.6, 1.2])
@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_gaps_in_images_are_as_large_as_the_law_of_beer_and_lambert_says(density, tilt):
    """Of the crown about 1.7 m across its middle show, where every ray passes its bottom and top."""
    found, error = gap(replace(CROWN, leaf_area_density=density), 150, tilt)
    assert found == pytest.approx(math.exp(-0.5 * density * 3.0 / math.cos(tilt)), abs=4 * error)
    assert error < 0.015


def test_a_crown_without_leaves_shows_all_that_is_under_it_and_a_huge_one_has_larger_clusters():
    with World(SCENARIO, Forest((replace(CROWN, leaf_area_density=0.0),)), 1) as world:
        world.place_people(np.zeros((1, 2)) + 0.5, np.zeros(1))
        assert (Renderer(world).render(Camera(0.5, 128), Pose.level(0.0, 0.0, 20.0)).people == 0).any()
    huge = Tree(0.0, 0.0, 50.0, 3.0, 40.0, 0.01, 5.0)
    with World(SCENARIO, Forest((huge,)), 0) as world:
        drawn = Rasteriser(world).draw(FAR, Pose.level(0.0, 0.0, 100.0), np.ones(len(world.models), np.bool_))
        assert (drawn.bodies >= 0).all()


def test_a_mission_under_porous_crowns_is_recorded_and_rendered_again():
    settings = {"trees.leaf_area_density": 0.6, "trees.density": 75, "duration": 6}
    first, again = (run("forest", "greedy", seed=2, settings=settings).recording for _ in range(2))
    assert compute_digest(first) == compute_digest(again) and set(first.trees[:, 6]) == {0.6}
    seen = 0
    with Rerenderer(first) as rerenderer:
        for k, i in np.ndindex(first.visible.shape[:2]):
            shown = count_visible_pixels(rerenderer.rendered(k, i).people, first.people.shape[1])
            np.testing.assert_array_equal(shown, first.visible[k, i])
            seen += sum(shown[m] < rerenderer.count_whole(k, i, m) for m in np.flatnonzero(shown))
    assert seen > 0
