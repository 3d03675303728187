import math

import numpy as np
from helpers.poses import tilted
from helpers.views import CAMERA

from sim.sensing.culling import (
    LEAST_FAR_PLANE,
    NEAR_PLANE,
    find_hidden,
    find_in_frustum,
    select_covers,
    select_standing,
)
from tracking.geometry.person import ENCLOSING_CYLINDER
from tracking.geometry.visibility import Forest, Tree


def test_a_sphere_is_in_the_frustum_if_a_point_is_in_the_image():
    rng = np.random.default_rng(0)
    seen = 0
    for _ in range(100):
        pose = tilted(rng, rng.uniform([-5, -5, 5], [5, 5, 25]), 1.5)
        centres, radii = rng.uniform([-40, -40, 0], [40, 40, 30], (200, 3)), rng.uniform(0.1, 6, 200)
        surface = rng.normal(size=(50, 3))
        points = centres[:, None] + radii[:, None, None] * surface / np.linalg.norm(surface, axis=1)[:, None]
        _, depths = CAMERA.project(pose, points.reshape(-1, 3))
        inside = CAMERA.sees(pose, points.reshape(-1, 3)) & (depths >= NEAR_PLANE) & (depths <= LEAST_FAR_PLANE)
        inside = inside.reshape(200, 50).any(axis=1)
        found = find_in_frustum(centres, radii, pose.position, pose.rotation, CAMERA.fov)
        assert not np.any(inside & ~found)
        # Only spheres near a plane of the frustum, or a corner, are kept for nothing.
        assert np.mean(found & ~inside) < 0.15
        seen += inside.sum()
    assert seen > 1000
    pose = tilted(np.random.default_rng(0), [0, 0, 20.0], 0.0)
    assert not find_in_frustum(np.full((1, 3), np.nan), np.ones(1), pose.position, pose.rotation, CAMERA.fov)[0]


def hides_its_trunk(tree, camera):
    trunk = select_standing(tree.solids)[:1]
    return find_hidden(trunk, select_covers(tree.solids), camera, CAMERA.fov)[0]


def test_a_trunk_is_left_out_only_where_its_own_canopy_hides_it():
    rng = np.random.default_rng(1)
    angle, height = np.linspace(0, 2 * math.pi, 24), np.linspace(0, 1, 12)
    hidden, seen, above = np.zeros((3, 500), bool)
    for k in range(500):
        base = rng.uniform(1, 5)
        tree = Tree(*rng.uniform(-3, 3, 2), rng.uniform(1, 6), base, base + rng.uniform(0.5, 4), rng.uniform(0.1, 0.5))
        camera = rng.uniform([-20, -20, 0], [20, 20, 25])
        hidden[k] = hides_its_trunk(tree, camera)
        x, y = 1.01 * tree.trunk_radius * np.array([np.cos(angle), np.sin(angle)])
        bark = [np.column_stack([tree.x + x, tree.y + y, np.full(24, h)]) for h in 0.999 * base * height]
        canopy = Forest((Tree(tree.x, tree.y, 0.99 * tree.canopy_radius, base, tree.canopy_top, 0.0),))
        seen[k] = canopy.visible(camera, np.concatenate(bark)).any()
        above[k] = camera[2] > tree.canopy_top + 1
    assert not np.any(hidden & seen) and np.mean((hidden | seen)[above]) > 0.95
    assert np.sum(hidden) > 100 and np.sum(seen & above) > 50
    for height, hides in ((6.0 + NEAR_PLANE, False), (6.0 + 2 * NEAR_PLANE, True), (2.0, False)):
        assert hides_its_trunk(Tree(0.0, 0.0), np.array([0.0, 0.0, height])) == hides
    assert not hides_its_trunk(Tree(0.0, 0.0, leaf_area_density=5.0), np.array([0.0, 0.0, 7.0]))


def test_a_person_is_left_out_only_where_a_canopy_hides_all_of_them():
    rng = np.random.default_rng(2)
    angle, height = np.linspace(0, 2 * math.pi, 24), np.linspace(0, 1.7, 12)
    ring = 0.49 * np.column_stack([np.cos(angle), np.sin(angle)])
    hidden, seen = np.zeros((2, 500), bool)
    for k in range(500):
        base = rng.uniform(1, 5)
        tree = Tree(0.0, 0.0, rng.uniform(2, 6), base, base + rng.uniform(0.5, 4), 0.0)
        camera, person = rng.uniform([-20, -20, 0], [20, 20, 25]), rng.uniform(-5, 5, 2)
        upright = np.array([[*person, *ENCLOSING_CYLINDER]])
        hidden[k] = find_hidden(upright, select_covers(tree.solids), camera, CAMERA.fov)[0]
        body = np.concatenate([np.column_stack([person + ring, np.full(24, h)]) for h in height])
        seen[k] = Forest((tree,)).visible(camera, body).any()
    assert not np.any(hidden & seen) and np.sum(hidden) > 50 and np.sum(seen) > 200
