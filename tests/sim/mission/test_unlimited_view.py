"""A view without limits: trees hide people and nothing else does, to sensors, trackers and planners alike."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.flights import fly
from helpers.nominal import team_cost, weighted_trace_penalty
from helpers.teams import refitted, with_little_effort

from planning.catalogue import PLANNERS
from planning.prediction.field_of_view import view_quadrangle
from planning.prediction.predicted_belief import LANES, add_information, predict_belief
from planning.prediction.quadrangle import inside, shortest_move
from sim.exchange.export import export
from sim.exchange.scanned_flight import read_flight
from sim.mission.archive import find_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.views.frames.frame_panels import write_frames
from tracking.geometry.camera import ALL_ROUND, Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, visible_samples

ALL = ("sensing.mode=ideal", "sensing.field_of_view=unlimited")


def all_round(team):
    """The team with cameras that see all round."""
    return refitted(team, lambda v: dataclasses.replace(v, camera=Camera(ALL_ROUND, 128)))


@pytest.mark.parametrize("occlusion", ["disc", "line_of_sight"])
def test_a_uav_measures_exactly_those_that_no_tree_hides(occlusion):
    mission, snapshots = fly(*ALL, f"sensing.occlusion={occlusion}", "trees.density=75", seed=1, duration=6)
    hidden, trees = 0, [Forest((tree,), occlusion) for tree in mission.forest.trees]
    for s in snapshots:
        points = np.column_stack([s.people, np.full(4, TARGET_HEIGHT)])
        for i, camera in enumerate(s.cameras):
            free = np.all([tree.visible(camera.position, points)[0] for tree in trees], axis=0)
            assert s.matched[i].tolist() == free.tolist() and len(s.scans[i].measurements) == free.sum()
            hidden += np.sum(~free)
    assert 0 < hidden < 31 * 12


def test_a_uav_sees_in_all_directions_with_the_noise_of_its_own_camera():
    rng = np.random.default_rng(0)
    points = rng.normal(0, 50, (200, 3))
    for _ in range(20):
        quaternion = rng.normal(size=4)
        pose = Pose(rng.normal(0, 10, 3), quaternion / np.linalg.norm(quaternion))
        assert Camera(ALL_ROUND, 128).sees(pose, points).all()
    means, covariances = rng.normal(0, 40, (50, 2)), np.tile(np.eye(2), (50, 1, 1))
    assert visible_samples(Forest(()), means, covariances, Camera(ALL_ROUND, 128).lens(pose))[:, 0].all()
    for noise in ("camera", "range_bearing"):
        limited = load_scenario("forest", [f"sensing.noise={noise}"])
        free = load_scenario("forest", [*ALL, f"sensing.noise={noise}"])
        for i, uav in enumerate(free.uavs):
            assert free.noise_model(i) == limited.noise_model(i)
            assert limited.believed_camera(i) == uav.true_camera and free.believed_camera(i).fov == ALL_ROUND


@pytest.mark.parametrize("occlusion", ["disc", "line_of_sight"])
def test_the_planner_sees_what_brute_force_sees(random_team, occlusion):
    hidden = 0
    for seed in range(8):
        team = all_round(random_team(seed, targets=12, trees=75, spread=60.0))
        situation = dataclasses.replace(team[0], forest=Forest(team[0].forest.trees, occlusion))
        rng = np.random.default_rng(seed)
        points = np.concatenate([rng.uniform(-70, 70, (3, 12, 1, 2)), np.full((3, 12, 1, 1), TARGET_HEIGHT)], axis=-1)
        view = predict_belief(situation, points, np.tile(np.eye(4), (12, 1, 1)))
        for uav, vehicle in enumerate(situation.vehicles):
            path = vehicle.position + np.cumsum(np.column_stack([rng.uniform(-3.5, 3.5, (3, 2)), np.zeros(3)]), axis=0)
            lanes = [np.repeat(path[k, :2, None], LANES, axis=1) for k in range(3)]
            work = np.zeros(3 * LANES), np.empty(LANES)
            seen = np.array([add_information(view, uav, lanes[r // 12], r, *work) for r in range(36)])
            free = [situation.forest.visible(path[k], points[k, :, 0])[0] for k in range(3)]
            np.testing.assert_array_equal(seen.reshape(3, 12), free)
            hidden += 36 - int(np.sum(free))
    assert hidden > 50


def test_with_an_unlimited_field_of_view_the_terminal_penalty_is_zero(random_team):
    team = all_round(random_team(2))
    views = np.array([view_quadrangle(s.own) for s in team])
    rng = np.random.default_rng(0)
    for dx, dy in rng.normal(0, 1e3, (50, 2)).tolist():
        assert inside(views[1], dx, dy) and shortest_move(views, 1, dx, dy) == (0.0, 0.0)
    targets = rng.normal(0, 500, (6, 2))
    assert weighted_trace_penalty(targets, np.ones(6), np.zeros((3, 2)), views) == 0.0
    still = np.zeros((3, 2, 2))
    means = np.array([t.belief.mean for t in team[0].tracks])
    points = np.tile(np.column_stack([means[:, :2], np.full(4, TARGET_HEIGHT)])[None, :, None], (2, 1, 1, 1))
    view = predict_belief(team[0], points, np.tile(np.eye(4), (4, 1, 1)))
    assert team_cost(view, still, 0.5) == team_cost(view, still, 0.0)


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_flies_with_an_unlimited_field_of_view(planner):
    mission, snapshots = fly(*ALL, "uavs.0.tilt_deg=30", planner=with_little_effort(planner))
    assert len(snapshots) == 6 and mission.faults == []


def test_a_mission_is_filmed_exported_and_read_again(tmp_path, without_pictures):
    run_mission(Trial(load_scenario("forest", [*ALL, "duration=1"]), "greedy", 0), tmp_path / "out")
    recording = find_recording(tmp_path / "out")
    export(recording, "csv", tmp_path / "csv")
    cameras = read_flight(tmp_path / "csv").cameras
    assert [camera.fov for camera in cameras] == [ALL_ROUND] * 3 and math.tau == ALL_ROUND
    write_frames(recording, [0], 0, tmp_path / "frames", size=256, progress=lambda k: None)
    assert len(list((tmp_path / "frames").iterdir())) == 1
