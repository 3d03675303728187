"""The planner's idea of a tilted camera's field of view against the camera itself."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.nominal import nominal, plain_cost, squares, team_cost
from helpers.teams import refitted
from scipy.spatial.transform import Rotation

from planning.planner import Vehicle
from planning.prediction.field_of_view import aim_point, points_shown, view_quadrangle, viewing_range
from planning.prediction.intent import base_control
from planning.prediction.quadrangle import inside, radius_in_view, shortest_move
from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.trigonometry import tan
from tracking.track import Track


def vehicle(tilt=0.0, heading=0.0, *, fov=60.0, height=19.1, place=(3.0, -4.0)):
    """A vehicle with its camera turned by `heading` and then pitched by `tilt` towards it, in degrees."""
    attitude = Rotation.from_euler("ZY", [heading, -tilt], degrees=True).as_quat()
    camera = Camera(math.radians(fov), 128)
    return Vehicle(0, np.array([*place, height]), camera, NoiseModel.range_bearing(0.1), 5.0, attitude)


def random_vehicle(rng):
    fov = rng.uniform(20, 90)
    return vehicle(rng.uniform(0, min(60, 85 - fov / 2)), rng.uniform(-180, 180), fov=fov, height=rng.uniform(7, 40))


def seen(v, offsets):
    """Mask (N,) of targets at offsets (N, 2) m from the vehicle that the camera sees, by projection."""
    points = np.column_stack([v.position[:2] + offsets, np.full(len(offsets), TARGET_HEIGHT)])
    return v.camera.sees(Pose(v.position, v.attitude), points)


def test_the_half_planes_hold_exactly_what_the_camera_sees():
    rng, shares = np.random.default_rng(0), []
    for _ in range(60):
        v = random_vehicle(rng)
        offsets = rng.uniform(-1.2, 1.2, (300, 2)) * viewing_range(v)
        view = view_quadrangle(v)
        clear = np.min(np.abs(offsets @ view[:4, :2].T - view[:4, 2]), axis=1) > 1e-9
        expected = seen(v, offsets[clear])
        found = [inside(view, dx, dy) for dx, dy in offsets[clear]]
        np.testing.assert_array_equal(found, expected)
        shares.append(expected.mean())
    assert 0.02 < np.mean(shares) < 0.5


@pytest.mark.parametrize(
    ("camera", "lost"),  # largest share of the true view, in level flight, that planners do not claim
    [
        (Camera.calibrated(640, 360, (500.0, 510.0), (300.0, 170.0)), 0.0),
        (Camera.calibrated(640, 512, (760.0, 760.0), (320.0, 256.0), (-0.37,)), 0.08),
        (Camera.calibrated(528, 396, (371.0, 371.0), (265.0, 197.0), (-0.11, 0.015, 0.0, 0.0, -0.027)), 0.08),
        (Camera.calibrated(640, 480, (550.0, 550.0), (320.0, 240.0), (0.14, 0.0, 0.001, -0.002)), 0.05),
    ],
    ids=["pinhole", "thermal", "wide", "pincushion"],
)
def test_no_point_is_claimed_that_a_lens_does_not_show(camera, lost):
    rng, seen_by_both = np.random.default_rng(8), []
    for k in range(30):
        tilt, heading = (rng.uniform(0, 20), rng.uniform(-180, 180)) if k else (0.0, 0.0)
        v = dataclasses.replace(vehicle(tilt, heading), camera=camera)
        offsets = rng.uniform(-1.3, 1.3, (2000, 2)) * viewing_range(v)
        view = view_quadrangle(v)
        far = np.min(np.abs(offsets @ view[:4, :2].T - view[:4, 2]), axis=1) > 1e-9
        claimed, shown = np.array([inside(view, dx, dy) for dx, dy in offsets[far]]), seen(v, offsets[far])
        assert not np.any(claimed & ~shown)
        seen_by_both.append(1.0 - claimed.sum() / shown.sum())
    assert lost / 3 <= seen_by_both[0] <= lost
    assert np.all(np.equal(seen_by_both, 0.0)) == (lost == 0.0)


def test_a_level_camera_sees_a_square_with_moves_along_each_axis():
    for fov, height in ((60.0, 17.3), (75.0, 21.7), (33.3, 8.1)):
        v = vehicle(fov=fov, height=height)
        half = (height - TARGET_HEIGHT) * tan(math.radians(fov) / 2)
        view = view_quadrangle(v)
        assert view[4, 2] == pytest.approx(2 * half / 128, rel=1e-12)  # edge of a pixel
        view[4, 2] = 0.0
        np.testing.assert_array_equal(view, squares([half])[0])
        assert radius_in_view(view_quadrangle(v)) == viewing_range(v) / math.sqrt(2)  # so recordings stay as they are
    rng, half = np.random.default_rng(3), 11.27
    for target in rng.uniform(-30, 30, (200, 2)):
        excess = np.copysign(np.maximum(np.abs(target) - half, 0.0), target)
        np.testing.assert_array_equal(shortest_move(squares([half]), 0, *target), excess)


def test_image_marks_are_where_rays_of_tilted_cameras_meet_the_targets_plane():
    rng = np.random.default_rng(1)
    for _ in range(20):
        v, marks = random_vehicle(rng), rng.uniform(-1, 1, (30, 2))
        pixels = v.camera.pixels / 2 * (1 + marks * [1, -1])
        expected = v.camera.ground_points(Pose(v.position, v.attitude), pixels, TARGET_HEIGHT)
        np.testing.assert_allclose(v.position[:2] + points_shown(v, marks), expected, atol=1e-9)
        np.testing.assert_array_equal(aim_point(v), points_shown(v, np.zeros((1, 2)))[0])
        assert aim_point(v) == pytest.approx(view_quadrangle(v)[4, :2])


def test_the_shortest_move_just_covers_the_target_and_no_shorter_one_does():
    rng = np.random.default_rng(2)
    for _ in range(40):
        v = random_vehicle(rng)
        view = view_quadrangle(v)[None]
        corners = v.camera.footprint(Pose(v.position, v.attitude), TARGET_HEIGHT) - v.position[:2]
        rim = np.vstack([np.linspace(a, b, 4001) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
        inner = np.min(np.linalg.norm(rim - aim_point(v), axis=1))
        assert radius_in_view(view[0]) == pytest.approx(inner, rel=1e-3)
        for target in rng.uniform(-2, 2, (20, 2)) * viewing_range(v):
            move = np.array(shortest_move(view, 0, *target))
            if seen(v, target[None])[0]:
                np.testing.assert_array_equal(move, 0.0)
                continue
            nearest = np.min(np.linalg.norm(rim - target, axis=1))
            assert np.linalg.norm(move) == pytest.approx(nearest, rel=1e-3, abs=1e-3)
            assert np.linalg.norm(move) <= nearest + 1e-9
            slack = 1e-7 * (target - move - corners.mean(axis=0))
            assert seen(v, (target - move - slack)[None])[0] and not seen(v, (target - move + slack)[None])[0]


def tilted_team(team, seed):
    """The team's situations with cameras tilted at random."""
    rng = np.random.default_rng(seed)
    turns = [Rotation.from_euler("ZY", [rng.uniform(-3, 3), -rng.uniform(0.2, 0.9)]).as_quat() for _ in team]
    return refitted(team, lambda v: dataclasses.replace(v, attitude=turns[v.id]))


def test_the_compiled_objective_of_tilted_cameras_equals_a_plain_transcription(random_team):
    counts = []
    for seed in range(25):
        situation = tilted_team(random_team(seed, spread=12.0 + seed), seed)[0]
        controls = np.random.default_rng(seed).uniform(-3.5, 3.5, (3, 5, 2))
        expected, count = plain_cost(situation, controls, 0.0)
        assert team_cost(nominal(situation, 5), controls, 0.0) == pytest.approx(expected, rel=1e-9)
        counts += count
    assert 0 in counts and 1 in counts and 2 in counts


def test_the_base_policy_counts_from_where_a_tilted_camera_looks(random_team):
    v = vehicle(40.0, 120.0)
    target = v.position[:2] + aim_point(v) + [3.0, -2.0]
    track = Track(0, Gaussian(np.array([*target, 0.0, 0.0]), np.eye(4)))
    alone = dataclasses.replace(random_team(0)[0], own=v, tracks=(track,))
    np.testing.assert_allclose(base_control(alone), [3.0, -2.0], atol=1e-12)
