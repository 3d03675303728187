"""Images whose rows are exposed one after another, and detections in them."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planning.baselines import Greedy
from sim.facts.rerender import Rerenderer
from sim.mission.mission import Mission
from sim.mission.trial import Trial
from sim.running.fly import fly_mission, record
from sim.scenario.camera_settings import CameraSettings
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from sim.scenario.uavs import Uav, UavSettings
from sim.sensing.renderer import Renderer
from sim.sensing.rolling_shutter import Sweep
from sim.sensing.sensor_mode import Shot
from sim.sensing.sensors import Sensors
from sim.world.world import World
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest
from tracking.registration.pose_errors import move_to_believed

BARREL = Camera.calibrated(160, 120, (140.0, 138.0), (82.0, 59.0), (-0.3, 0.09, 0.001, -0.001))
SCENARIO = Scenario(uavs=(Uav(start=(74.0, 49.0)),))
PEOPLE = 8


def moving(rng: np.random.Generator, readout: float = 0.05) -> Sweep:
    """A camera that flies at up to 6 m/s and turns at up to 40 degrees a second, and people who walk."""
    speeds, spins = rng.uniform(-6, 6, 3) * [1, 1, 0.1], np.radians(rng.uniform(-40, 40, 3))
    return Sweep(readout, speeds, spins, rng.uniform(-1.5, 1.5, (PEOPLE, 2)))


def test_without_motion_the_image_is_that_of_one_moment_and_with_motion_each_row_has_its_own():
    rng = np.random.default_rng(1)
    with World(SCENARIO, Forest(()), PEOPLE) as world:
        renderer, pose = Renderer(world), Pose.level(0.0, 0.0, 20.0)
        people, headings = rng.uniform(-8, 8, (PEOPLE, 2)), rng.uniform(-3, 3, PEOPLE)
        for camera in (BARREL, Camera.calibrated(160, 120, (140.0, 140.0), (80.0, 60.0))):
            world.place_people(people, headings)
            still = renderer.render(camera, pose)
            same = renderer.take(0, 0.0, camera, pose, Sweep(0.05, np.zeros(3), np.zeros(3), np.zeros((PEOPLE, 2))))
            np.testing.assert_array_equal(still.image, same.image)
            sweep = moving(rng)
            shown = renderer.take(0, 0.0, camera, pose, sweep)
            np.testing.assert_array_equal(world.people[0], people)
            edges = sweep.edges(camera, 20.0)
            assert len(edges) > 4 and edges[0] == 0 and edges[-1] == 120
            for top, bottom in list(pairwise(edges))[:: len(edges) // 4]:
                delay = ((top + bottom) / 240 - 0.5) * 0.05
                world.place_people(people + delay * sweep.people, headings)
                own = renderer.render(camera, sweep.pose_at(pose, delay)).people[top:bottom]
                np.testing.assert_array_equal(own, shown.people[top:bottom])


def at(poses, share):
    """The pose at a share of the time from the first of two poses to the second."""
    first, later = (Rotation.from_quat(pose.quaternion) for pose in poses)
    turned = Rotation.from_rotvec(share * (later * first.inv()).as_rotvec()) * first
    return Pose(poses[0].position + share * (poses[1].position - poses[0].position), turned.as_quat())


def test_people_are_where_the_believed_poses_of_their_rows_put_them():
    """Errors change by 2 m/s and 10 degrees a second, so that the motion itself is believed wrongly."""
    rng, rows = np.random.default_rng(3), []
    lens = CameraSettings(160, 120, focal=(140.0, 138.0), distortion=(-0.3, 0.09), readout=0.1)
    setting = Scenario(uavs=(UavSettings(start=(74.0, 49.0), camera=lens).complete(),), sensing=Sensing(noise="camera"))
    with World(setting, Forest(()), PEOPLE) as world:
        for _ in range(120):
            turn = Rotation.from_euler("ZYX", [*rng.uniform(-180, 180, 1), *rng.uniform(-10, 10, 2)], degrees=True)
            spin = Rotation.from_rotvec(np.radians(rng.uniform(-4, 4, 3)))
            velocity = rng.uniform(-6, 6, 3) * [1, 1, 0.1]
            true = [Pose(np.array([0.0, 0.0, 20.0]) - 0.2 * velocity, (spin.inv() * turn).as_quat())]
            true.append(Pose(np.array([0.0, 0.0, 20.0]), turn.as_quat()))
            wrong = rng.uniform(-1, 1, 3) + np.outer([0.0, 0.2], rng.uniform(-2, 2, 3))
            yaws = rng.uniform(-5, 5) + np.array([0.0, 0.2]) * rng.uniform(-10, 10)
            turns = [Rotation.from_euler("z", yaw, degrees=True) for yaw in yaws]
            believed = [
                Pose(pose.position + moved, (turned * Rotation.from_quat(pose.quaternion)).as_quat())
                for pose, moved, turned in zip(true, wrong, turns, strict=True)
            ]
            i, j = np.meshgrid(np.arange(-10.0, 11.0, 5.0), np.arange(-10.0, 11.0, 5.0))
            people = rng.permutation(np.column_stack([i.ravel(), j.ravel()]))[:PEOPLE] + rng.uniform(-1, 1, (PEOPLE, 2))
            world.place_people(people, rng.uniform(-math.pi, math.pi, PEOPLE))
            subject = Sensors(setting, world, Forest(()), rng)
            subject.expose(Shot(0, 0, 0.0, true[0], people, believed[0]))
            found = subject.read(subject.expose(Shot(0, 0, 0.2, true[1], people, believed[1])))
            for z, (_, v) in zip(found.scan.measurements, found.pixels, strict=True):
                share = 1.0 + 0.5 * (v / 120 - 0.5)
                expected = move_to_believed(people, at(true, share), at(believed, share))
                rows.append([*min(z - expected, key=np.linalg.norm), v])
    table = np.array(rows)
    table = table[np.hypot(*table[:, :2].T) < 0.5]
    assert len(table) > 350
    for low, high in ((0, 40), (40, 80), (80, 120)):
        part = table[(table[:, 2] >= low) & (table[:, 2] <= high)]
        np.testing.assert_allclose(part[:, :2].mean(axis=0), 0.0, atol=0.03)
    assert np.sqrt(np.mean(np.square(table[:, :2]))) < 0.055


CAMERA = "{width = 160, height = 120, hfov_deg = 60, distortion = [-0.2], readout = 0.05}"


def test_frames_of_a_recording_are_those_of_the_mission():
    fleet = f'uavs=[{{start=[-25,-10], footprint=26, camera={CAMERA}, mount="body"}}]'
    scenario = load_scenario("forest", ["duration=3", "sensing.noise=camera", fleet])
    mission, snapshots, images = Mission(scenario, Greedy(), 1), [], []
    for snapshot in mission.fly():
        snapshots.append(snapshot)
        images.append(mission.images[0])
    with Rerenderer(record(mission, snapshots).recording) as again:
        for k, image in enumerate(images):
            np.testing.assert_array_equal(again.image(k, 0), image)


@pytest.mark.parametrize("planner", ["hover", "greedy"])
@pytest.mark.parametrize("mount", ["gimbal", "body"])
def test_a_person_whom_nothing_hides_has_share_one(planner, mount):
    """Also where the edge of the image cuts them."""
    fleet = f'uavs=[{{start=[-25,-10], footprint=26, camera={CAMERA.replace("0.05", "0.15")}, mount="{mount}"}}]'
    scenario = load_scenario("forest", ["duration=2", "trees.density=0", "people.count=4", fleet])
    recording = fly_mission(Trial(scenario, planner, 1)).recording
    shown = np.argwhere(recording.visible[:, 0] > 0).tolist()
    with Rerenderer(recording) as again:
        assert [again.count_whole(k, 0, m) for k, m in shown] == [recording.visible[k, 0, m] for k, m in shown]
    assert len(shown) > 10 and (np.ptp(recording.poses[:, 0, :2], axis=0).max() > 1) == (planner == "greedy")


def test_a_hovering_camera_shows_people_where_they_are_when_their_rows_are_exposed():
    """They walk by 0.87 pixels while the image is read out; without a sweep, and with one, that is seen to the east."""
    camera, pose, readout = Camera.calibrated(640, 480, (550.0, 550.0), (320.0, 240.0)), Pose.level(0.0, 0.0, 20.0), 0.1
    walk = 0.87 * 20.0 / 550.0 / readout
    people = np.array([[-7.0, 7.0], [0.0, 7.0], [7.0, 7.0], [-6.0, -7.5], [1.0, -7.5], [8.0, -7.5]])
    sweep = Sweep(readout, np.zeros(3), np.zeros(3), np.tile([walk, 0.0], (len(people), 1)))
    with World(SCENARIO, Forest(()), len(people)) as world:
        world.place_people(people, np.zeros(len(people)))
        renderer = Renderer(world)
        masks = [renderer.find_people(camera, pose, each) for each in (None, sweep)]
    for m in range(len(people)):
        (before, _), (after, rows) = (np.argwhere(mask == m)[:, ::-1].mean(axis=0) for mask in masks)
        assert after - before == pytest.approx(0.87 * (rows / 480 - 0.5), abs=0.2)
    assert not np.array_equal(*masks)


def test_a_readout_ends_before_the_next_scan():
    fleet = f"uavs=[{{start=[-25,-10], footprint=26, camera={CAMERA.replace('0.05', '0.25')}}}]"
    with pytest.raises(InputError, match=r"uavs.0.camera.readout: 0.25 s is too long; allowed is less than the 0.2 s"):
        load_scenario("forest", [fleet])
