"""Cameras with their own mounting angle and rate, from the scenario to tracks, plans and the film."""

import math

import numpy as np
import pytest
from helpers.flights import fly
from scipy.spatial.transform import Rotation

from sim.mission.knowledge import BodyState, vehicle_of
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.sensing.sensor_mode import Shot
from sim.sensing.sensors import Sensors
from sim.world.world import World
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest


def uav(mount="gimbal", tilt=30.0):
    return Uav(start=(0.0, 0.0), mount=mount, tilt_deg=tilt)


def body(*angles):
    """A body turned by yaw, pitch and roll in degrees."""
    return Pose(np.array([1.0, 2.0, 19.0]), Rotation.from_euler("ZYX", angles, degrees=True).as_quat())


def planned_attitude(carrier, pose):
    return vehicle_of(Scenario(uavs=(carrier,)), 0, BodyState(pose, np.zeros(2))).attitude


@pytest.mark.parametrize("tilt", [0.0, 10.0, 59.0])
def test_a_gimbal_holds_its_camera_tilted_to_the_east_however_the_body_turns(tilt):
    sin, cos = math.sin(math.radians(tilt)), math.cos(math.radians(tilt))
    for pose in (body(0, 0, 0), body(70, 10, -20)):
        camera = uav(tilt=tilt).camera_pose(pose)
        np.testing.assert_allclose(-camera.rotation[:, 2], [sin, 0.0, -cos], atol=1e-12)  # where it looks
        np.testing.assert_allclose(camera.rotation[:, 1], [0.0, 1.0, 0.0], atol=1e-12)  # north at the top
        np.testing.assert_array_equal(camera.quaternion, planned_attitude(uav(tilt=tilt), pose))


def test_a_body_fixed_camera_turns_with_the_body_which_planners_take_as_level():
    for angles in ((0, 0, 0), (90, 0, 0), (-130, 12, 7)):
        pose = body(*angles)
        camera = uav("body", 40.0).camera_pose(pose)
        expected = pose.rotation @ Rotation.from_euler("Y", -40.0, degrees=True).as_matrix()
        np.testing.assert_allclose(camera.rotation, expected, atol=1e-12)
    north = uav("body", 40.0).camera_pose(body(90, 0, 0))
    assert -north.rotation[:, 2] == pytest.approx([0.0, math.sin(math.radians(40)), -math.cos(math.radians(40))])
    leaning, level = body(-130, 12, 7), body(-130, 0, 0)
    heading = math.atan2(leaning.rotation[1, 0], leaning.rotation[0, 0])
    assert math.degrees(heading) == pytest.approx(-130)
    expected = uav("body").camera_pose(level).quaternion
    np.testing.assert_allclose(planned_attitude(uav("body"), leaning), expected, atol=1e-12)
    np.testing.assert_array_equal(planned_attitude(uav("body", 0.0), leaning), [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("tilt", [20.0, 45.0])
def test_a_tilted_camera_measures_people_ahead_where_they_are(tilt):
    setting = load_scenario(
        "forest", [f"uavs=[{{start=[0, 0], tilt_deg={tilt}, footprint=20}}]", "sensing.noise=camera"]
    )
    ahead = setting.uavs[0].altitude * math.tan(math.radians(tilt))
    people = np.array([[ahead, 0.0], [ahead + 4.0, 3.0], [ahead - 3.0, -4.0], [-6.0, 0.0]])
    with World(setting, Forest(()), 4) as world:
        world.place_people(people, np.zeros(4))
        sensors = Sensors(setting, world, Forest(()), np.random.default_rng(0))
        look = sensors.read(sensors.expose(Shot(0, 0, 0.0, setting.uavs[0].camera_pose(world.poses()[0]), people)))
    assert look.matched.tolist() == [True, True, True, False]  # the last one stands behind
    gaps = np.linalg.norm(people[:3, None] - look.scan.measurements, axis=2).min(axis=1)
    assert gaps.max() < 0.3


@pytest.mark.parametrize("mount", ["gimbal", "body"])
@pytest.mark.parametrize("dynamics", ["quadrotor", "kinematic"])
def test_tilted_fleets_fly_and_see_people_where_they_look(mount, dynamics):
    tilts = [f"uavs.{i}.{key}" for i in range(3) for key in ("tilt_deg=30", f"mount={mount}")]
    mission, snapshots = fly(*tilts, f"dynamics={dynamics}", "trees.density=0", planner="sma-nbo-mwtp", duration=3)
    assert mission.faults == []
    for s in snapshots:
        for i, (uav, camera) in enumerate(zip(mission.scenario.uavs, s.cameras, strict=True)):
            np.testing.assert_array_equal(camera.quaternion, uav.camera_pose(s.poses[i]).quaternion)
    assert any(s.matched.any() for s in snapshots) and max(s.ospa[:, 0].mean() for s in snapshots) < 1.0


def test_each_camera_takes_frames_at_its_own_rate_by_default_at_each_scan():
    frames = []

    def keep(mission):
        frames.append([frame is not None for frame in mission.images])

    mission, snapshots = fly("uavs.1.rate=1", "trees.density=0", duration=3, see=keep)
    expected = np.ones((16, 3), dtype=bool)
    expected[:, 1] = np.arange(16) % 5 == 0
    np.testing.assert_array_equal(frames, expected)
    for k, s in enumerate(snapshots):
        assert mission.scenario.has_frame(1, k) == expected[k, 1]
        assert len(s.scans[1].measurements) == len(s.pixels[1]) == int(s.matched[1].sum())
        assert expected[k, 1] or not s.visible[1].any()
        assert s.scans[1].time == s.time
    assert any(len(s.scans[1].measurements) for s in snapshots)
    scenario = Scenario()
    assert all(scenario.has_frame(i, k) for i in range(3) for k in range(20))
    for s in fly("sensing.mode=ideal", duration=0.4)[1]:
        np.testing.assert_array_equal([c.quaternion for c in s.cameras], np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)))


def test_a_slow_camera_alone_needs_two_of_its_own_frames_for_a_track():
    overrides = ("uavs=[{start=[-28, -6], rate=1, footprint=30}]", "tracking.initial_tracks=none", "trees.density=0")
    _, snapshots = fly(*overrides, duration=3)
    held = [len(s.tracks[0]) > 0 for s in snapshots]
    assert held == [k >= 5 for k in range(16)]
