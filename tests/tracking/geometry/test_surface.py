"""Rays that meet rough ground against marching along them, and covariances there against moved rays."""

import math

import numpy as np
import pytest

from tracking.geometry.surface import Surface, describe_ground, find_ground, lay_on_ground, meet_ground

CELL, STEP, REACH = 2.0, 0.004, 120.0  # m


def rough(rng, rough=3.0, points=40):
    """Ground with a slope and bumps, whose grid is turned and not square."""
    heights = np.cumsum(rng.normal(0.0, 0.2 * rough, (points, points + 5)), axis=0)
    heights += rng.normal(0.0, rough / 3, heights.shape)
    c, s = math.cos(0.3) / CELL, math.sin(0.3) / CELL
    return Surface(heights, (points / 2, c, s), (points / 2, s, -c))


def march(surface, eye, ray, above):
    """The place where a ray is first below the ground, by small steps; NaN if it leaves known ground before."""
    steps = np.arange(0.0, REACH, STEP) / np.linalg.norm(ray)
    points = eye + steps[:, None] * ray
    gaps = points[:, 2] - above - find_ground(surface, np.ascontiguousarray(points[:, :2]))[:, 0]
    first = np.flatnonzero(~(gaps > 0.0))[0] if not (gaps > 0.0).all() else len(gaps) - 1
    return points[first, :2] if gaps[first] <= 0.0 else np.full(2, np.nan)


@pytest.mark.parametrize("seed", range(8))
def test_rays_meet_rough_ground_where_marching_does(seed):
    rng = np.random.default_rng(seed)
    surface, above = rough(rng, rng.uniform(0.0, 6.0)), 0.85
    if seed % 2:
        surface.heights[rng.random(surface.heights.shape) < 0.03] = np.nan
    met = 0
    while met < 50:
        x, y = rng.uniform(-20, 20, 2)
        eye = np.array([x, y, describe_ground(surface, x, y)[0] + rng.uniform(1.0, 40.0)])
        if np.isnan(eye[2]):
            continue
        rays = rng.normal(size=(20, 3)) * (1.0, 1.0, rng.choice([0.03, 0.3, 3.0]))
        rays[0] = 0.0, 0.0, -1.0
        for ray, found in zip(rays, meet_ground(surface, eye, rays, above), strict=True):
            expected = march(surface, eye, ray, above)
            if np.isnan(expected[0]) and not np.isnan(found[0]):  # it came down past a cell without heights, or later
                height = describe_ground(surface, *found)[0] + above
                scale = (height - eye[2]) / ray[2] if ray[2] else math.nan
                assert seed % 2 or scale * np.linalg.norm(ray) > REACH - 1 or near_edge(surface, found)
                np.testing.assert_allclose(eye[:2] + scale * ray[:2], found, atol=1e-6)
            else:
                np.testing.assert_allclose(found, expected, atol=0.01)
                met += not np.isnan(found[0])


def near_edge(surface, place):
    """True where steps may miss the last bit of ground."""
    (a, b, c), (d, e, f) = surface.column, surface.row
    u, v = a + b * place[0] + c * place[1], d + e * place[0] + f * place[1]
    rows, columns = surface.heights.shape
    return min(u, columns - 1 - u, v, rows - 1 - v) < STEP


def test_covariances_on_a_slope_are_those_of_rays_that_err_and_of_ground_that_is_higher():
    surface = Surface(np.add.outer(0.3 * np.arange(60.0), -0.5 * np.arange(60.0)), (30, 0.5, 0.0), (30, 0.0, -0.5))
    eye, ray, above, h = np.array([1.0, 2.0, 40.0]), np.array([[0.3, -0.4, -1.0]]), 0.85, 1e-5
    place = meet_ground(surface, eye, ray, above)
    height, east, north = describe_ground(surface, *place[0])
    assert (east, north) == pytest.approx((-0.25, -0.15))
    level = np.append(place[0], height + above)  # errors on level ground move the ray through this point
    moved = [meet_ground(surface, eye, (level + h * axis - eye)[None], above)[0] - place[0] for axis in np.eye(3)[:2]]
    A = np.column_stack(moved) / h
    higher = (meet_ground(surface, eye, ray, above + h)[0] - place[0]) / h
    C = np.array([[0.2, 0.05], [0.05, 0.1]])
    found = lay_on_ground(surface, eye, place, above, C[None], 0.4)[0]
    np.testing.assert_allclose(found, A @ C @ A.T + 0.16 * np.outer(higher, higher), rtol=1e-4)
