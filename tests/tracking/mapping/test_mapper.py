"""Trees are mapped from painted frames, whose trees are known, and nothing else is."""

import math

import numpy as np
import pytest

from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.quaternions import pitch
from tracking.geometry.visibility import Tree
from tracking.mapping.mapper import COVERED, OPEN, UNSEEN, ParallaxMapper

HEIGHT = 18.0
SQUARE = Camera(math.radians(60), 128)
LENS = Camera.calibrated(256, 192, (210.0, 210.0), (128.0, 96.0), (-0.2, 0.04))
TREES = (
    Tree(4.0, 3.0, 3.0, 3.0, 6.0),
    Tree(10.0, 3.0, 3.0, 3.0, 6.0),  # touches the first
    Tree(6.0, -3.5, 1.5, 2.0, 4.0),
    Tree(18.0, -6.5, 4.0, 2.5, 5.0),  # cut by the edge of all frames
)
PATH = [(0.9 * k, 0.15 * math.sin(k), HEIGHT) for k in range(28)]


def paint(camera, pose, trees, seed=0):
    """Image of a camera: every surface has its own pattern, the ground a weaker one."""
    width, height = camera.size
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = camera.rays(pose, np.column_stack([u.ravel(), v.ravel()]))
    x0, y0, z0 = pose.position
    nearest = z0 / -rays[:, 2]
    grey = pattern(x0 + nearest * rays[:, 0], y0 + nearest * rays[:, 1], seed, 110, 12)
    for n, tree in enumerate(trees):
        far = (z0 - tree.canopy_top) / -rays[:, 2]
        x, y = x0 + far * rays[:, 0], y0 + far * rays[:, 1]
        hit = (np.hypot(x - tree.x, y - tree.y) <= tree.canopy_radius) & (far < nearest)
        grey[hit], nearest[hit] = pattern(x, y, seed + n + 1, 90, 45)[hit], far[hit]
        a = rays[:, 0] ** 2 + rays[:, 1] ** 2
        b = rays[:, 0] * (x0 - tree.x) + rays[:, 1] * (y0 - tree.y)
        c = (x0 - tree.x) ** 2 + (y0 - tree.y) ** 2 - tree.canopy_radius**2
        with np.errstate(invalid="ignore", divide="ignore"):
            far = (-b - np.sqrt(b * b - a * c)) / a
        z = z0 + far * rays[:, 2]
        hit = (tree.canopy_base <= z) & (z <= tree.canopy_top) & (far > 0) & (far < nearest)
        around = tree.canopy_radius * np.arctan2(y0 + far * rays[:, 1] - tree.y, x0 + far * rays[:, 0] - tree.x)
        grey[hit], nearest[hit] = pattern(around, z, seed + n + 9, 60, 30)[hit], far[hit]
    return np.clip(grey, 0, 255).astype(np.uint8).reshape(height, width)


def pattern(x, y, seed, mean, contrast):
    """Smooth random grey levels over a plane, with details of a third of a metre."""
    values = np.random.default_rng(seed).uniform(-1, 1, (64, 64))
    a, b = np.nan_to_num(x) * 3 % 64, np.nan_to_num(y) * 3 % 64
    i, j = a.astype(int) % 64, b.astype(int) % 64
    p, q = a % 1.0, b % 1.0
    m, n = (i + 1) % 64, (j + 1) % 64
    mixed = (1 - p) * ((1 - q) * values[i, j] + q * values[i, n]) + p * ((1 - q) * values[m, j] + q * values[m, n])
    return mean + contrast * mixed


def fly(trees, *, path=PATH, camera=SQUARE, tilt=0.0, seed=0, noise=0.0):
    mapper, rng = ParallaxMapper(), np.random.default_rng(seed)
    for k, place in enumerate(path):
        level = Pose.level(*place)
        pose = Pose(level.position, pitch(level.quaternion, tilt)) if tilt else level
        image = paint(camera, pose, trees, seed)
        image = np.clip(image + noise * rng.standard_normal(image.shape), 0, 255).astype(np.uint8)
        mapper.add(Frame(0, 0.2 * k, camera, pose, image))
    return mapper


def match(mapped, tree):
    return min(mapped, key=lambda m: math.hypot(m.tree.x - tree.x, m.tree.y - tree.y))


def test_crowns_that_touch_that_are_small_and_that_are_cut_are_mapped():
    mapped = fly(TREES).trees()
    assert len(mapped) == len(TREES)
    for tree in TREES:
        found = match(mapped, tree).tree
        assert math.hypot(found.x - tree.x, found.y - tree.y) < 0.3
        assert found.canopy_radius == pytest.approx(tree.canopy_radius, abs=0.3)
        assert found.canopy_top == pytest.approx(tree.canopy_top, abs=0.5)


@pytest.mark.parametrize(("camera", "tilt", "noise"), [(LENS, 0.0, 0.0), (SQUARE, 0.25, 0.0), (SQUARE, 0.0, 6.0)])
def test_lens_tilt_and_noise_leave_the_map(camera, tilt, noise):
    mapped = fly(TREES[:2], camera=camera, tilt=tilt, noise=noise).trees()
    assert len(mapped) == 2
    for tree in TREES[:2]:
        found = match(mapped, tree).tree
        assert math.hypot(found.x - tree.x, found.y - tree.y) < 0.35
        assert found.canopy_top == pytest.approx(tree.canopy_top, abs=0.5)


@pytest.mark.parametrize("path", [[(3.0, 2.0, HEIGHT)] * 20, [(3.0 + 20.0 * k, 2.0, HEIGHT) for k in range(5)]])
def test_without_parallax_nothing_is_known(path):
    mapper = fly(TREES, path=path)
    assert mapper.trees() == ()
    assert not mapper.ground().states.any()


def test_a_meadow_has_no_trees_and_is_open():
    mapper = fly(())
    assert mapper.trees() == ()
    states = mapper.ground().states
    assert np.count_nonzero(states == OPEN) > 1000
    assert not np.any(states == COVERED)


def test_a_tree_that_no_camera_saw_changes_nothing():
    one, other = fly(TREES).trees(), fly((*TREES, Tree(8.0, 30.0))).trees()
    assert [(m.tree, m.covariance.tobytes()) for m in one] == [(m.tree, m.covariance.tobytes()) for m in other]


def test_maps_made_in_parts_are_those_made_at_once():
    whole = fly(TREES)
    parts = ParallaxMapper()
    for k, place in enumerate(PATH):
        pose = Pose.level(*place)
        parts.add(Frame(0, 0.2 * k, SQUARE, pose, paint(SQUARE, pose, TREES)))
        if k % 7 == 0:
            parts.trees()
    for tree in TREES:
        found, same = match(whole.trees(), tree).tree, match(parts.trees(), tree).tree
        assert (found.x, found.y, found.canopy_radius) == pytest.approx((same.x, same.y, same.canopy_radius), abs=0.1)


def test_ground_is_open_beside_crowns_covered_below_and_unseen_elsewhere():
    ground = fly(TREES).ground()

    def state(x, y):
        return ground.states[int((y - ground.corner[1]) / ground.cell), int((x - ground.corner[0]) / ground.cell)]

    assert state(4.0, 3.0) == COVERED
    assert state(14.5, 0.0) == OPEN
    assert state(14.5, 11.5) == UNSEEN


def test_covariances_tell_the_errors():
    squares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        trees = [Tree(x, y, r) for x, y, r in zip((5, 16), rng.uniform(-5, 5, 2), rng.uniform(2, 4, 2), strict=True)]
        mapped = fly(trees, seed=20 * seed, noise=2.0).trees()
        for tree in trees:
            found = match(mapped, tree)
            error = np.array(
                [found.tree.x - tree.x, found.tree.y - tree.y, found.tree.canopy_radius - tree.canopy_radius]
            )
            squares.append(error @ np.linalg.solve(found.covariance[:3, :3], error) / 3)
    assert len(squares) == 16
    assert 0.3 < np.mean(squares) < 2.0


def test_frames_that_have_nothing_in_common_show_no_tree():
    mapper, rng = ParallaxMapper(), np.random.default_rng(0)
    for k, place in enumerate(PATH):
        image = rng.integers(90, 130, (128, 128, 3), dtype=np.uint8)
        mapper.add(Frame(0, 0.2 * k, SQUARE, Pose.level(*place), image))
    assert mapper.trees() == ()
