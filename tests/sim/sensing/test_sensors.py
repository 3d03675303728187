"""From world to scans: measured people, errors and covariances."""

import math

import numpy as np
import pytest

from sim.scenario.fleet import DEFAULT_FLEET, Uav
from sim.scenario.perception import Sensing
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import camera_of
from sim.sensing.renderer import Renderer
from sim.sensing.sensors import Sensors
from sim.sensing.stopwatch import Stopwatch
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.detection.noise import NoiseModel
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest, Tree

OPEN = Forest(())
ALTITUDES = [uav.altitude for uav in DEFAULT_FLEET]
# The fleet's bodies stay out of each other's sight.
FLEET = tuple(
    Uav(start=(74.0, 10.0 * k), footprint=uav.footprint, alpha=uav.alpha) for k, uav in enumerate(DEFAULT_FLEET)
)


def scenario(mode="camera", noise="range_bearing", uavs=FLEET):
    return Scenario(uavs=uavs, sensing=Sensing(mode=mode, noise=noise))


def sensors(setting, world, forest=OPEN, seed=0):
    return Sensors(setting, world, forest, rng=np.random.default_rng(seed), clock=Stopwatch())


def equation_4(alpha, offset):
    """[Li22] eq. (4) for a target at `offset` (2,) m from the camera."""
    r, rho = max(np.hypot(*offset), 2.0), math.atan2(offset[1], offset[0])
    G = np.array([[math.cos(rho), -math.sin(rho)], [math.sin(rho), math.cos(rho)]])
    return alpha * G @ np.diag([0.1 * r, 0.1 * math.pi * r]) @ G.T


def test_ideal_sensing_measures_exactly_the_people_in_view_and_not_hidden():
    rng = np.random.default_rng(0)
    exact = Uav(start=(0.0, 0.0), footprint=22.0, alpha=1e-14)
    setting = scenario("ideal", uavs=(exact,))
    counts = np.zeros(3, dtype=int)
    for _ in range(30):
        forest = Forest(tuple(Tree(*rng.uniform(-12, 12, 2), canopy_radius=2.0) for _ in range(6)))
        with World(setting, forest, 30) as world:
            subject = sensors(setting, world, forest)
            pose = Pose.level(*rng.uniform(-3, 3, 2), exact.altitude)
            people = rng.uniform(-15, 15, (30, 2))
            look = subject.look(0, 0.4, pose, people)
        half = (exact.altitude - TARGET_HEIGHT) * math.tan(math.radians(30))
        inside = np.all(np.abs(people - pose.position[:2]) <= half, axis=1)
        points = np.column_stack([people, np.full(30, TARGET_HEIGHT)])
        free = forest.visible(pose.position, points)[0]
        np.testing.assert_allclose(look.scan.measurements, people[inside & free], atol=1e-5)
        assert look.matched.tolist() == look.visible.astype(bool).tolist() == (inside & free).tolist()
        assert (look.image, look.scan.uav, look.scan.time, len(look.pixels)) == (None, 0, 0.4, 0)
        counts += [np.sum(inside & free), np.sum(inside & ~free), np.sum(~inside)]
    assert counts.min() > 50


@pytest.mark.parametrize("draws", [400, pytest.param(1500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("mode", ["ideal", "camera"])
@pytest.mark.parametrize("offset", [(7.0, -4.0), (0.5, 1.0)])
def test_the_noise_that_is_added_has_the_papers_covariance(mode, offset, draws):
    """Of 400 draws it finds a mean that is off by a fifth of a standard deviation, or a variance by a third."""
    setting = scenario(mode)
    uav, pose = 1, Pose.level(3.0, -2.0, ALTITUDES[1])
    person = pose.position[:2] + np.array(offset)
    with World(setting, OPEN, 1) as world:
        world.place_people(person[None], np.zeros(1))
        subject = sensors(setting, world)
        scans = [subject.look(uav, 0.0, pose, person[None]).scan for _ in range(draws)]
        seen = BlobDetector().detect(
            Frame(uav, 0.0, subject.cameras[uav], pose, Renderer(world).render(subject.cameras[uav], pose).image)
        )
    mean = person if mode == "ideal" else seen.ground[0]
    R = equation_4(DEFAULT_FLEET[uav].alpha, mean - pose.position[:2])
    # What the tracker is told is the covariance at the measurement: the true place would be the truth itself.
    told = [equation_4(DEFAULT_FLEET[uav].alpha, s.measurements[0] - pose.position[:2]) for s in scans]
    np.testing.assert_allclose([s.covariances[0] for s in scans], told, rtol=1e-9)
    error = np.array([s.measurements[0] for s in scans]) - mean
    # Four standard errors of the mean, and of the entries of a Wishart matrix.
    assert np.all(np.abs(error.mean(axis=0)) < 4 * np.sqrt(np.diag(R) / draws))
    bound = 4 * np.sqrt((R**2 + np.outer(np.diag(R), np.diag(R))) / draws)
    assert np.all(np.abs(error.T @ error / draws - R) < bound)


def test_nothing_is_added_to_what_the_camera_itself_measures():
    rng = np.random.default_rng(1)
    setting = scenario(noise="camera")
    with World(setting, OPEN, 4) as world:
        chance = np.random.default_rng(5)
        subject = Sensors(setting, world, OPEN, rng=chance, clock=Stopwatch())
        for uav, altitude in enumerate(ALTITUDES):
            people = np.array([[-6.0, -6.0], [5.0, -4.0], [-3.0, 6.0], [5.0, 5.0]]) + rng.uniform(-1, 1, (4, 2))
            world.place_people(people, rng.uniform(-3, 3, 4))
            look = subject.look(uav, 0.0, Pose.level(0.0, 0.0, altitude), people)
            frame = Frame(uav, 0.0, subject.cameras[uav], look.scan.pose, look.image)
            assert len(look.scan.measurements) == 4
            np.testing.assert_array_equal(look.scan.measurements, BlobDetector().detect(frame).ground)
    assert chance.bit_generator.state == np.random.default_rng(5).bit_generator.state


@pytest.mark.parametrize("mode", ["ideal", "camera"])
def test_the_absent_are_never_seen(mode):
    setting = scenario(mode)
    pose = Pose.level(0.0, 0.0, ALTITUDES[0])
    people = np.array([[np.nan, np.nan], [2.0, -3.0], [np.nan, np.nan]])
    with World(setting, OPEN, 3) as world:
        world.place_people(people, np.zeros(3))
        look = sensors(setting, world).look(0, 0.0, pose, people)
        absent = np.full((3, 2), np.nan)
        world.place_people(absent, np.zeros(3))
        empty = sensors(setting, world).look(0, 0.0, pose, absent)
    assert look.matched.tolist() == (look.visible > 0).tolist() == [False, True, False]
    assert look.scan.measurements.shape == (1, 2)
    assert np.linalg.norm(look.scan.measurements[0] - people[1]) < 2.0
    assert empty.scan.measurements.shape == (0, 2) and empty.scan.covariances.shape == (0, 2, 2)
    assert not empty.matched.any() and not empty.visible.any()


def test_noise_models_are_the_scenarios():
    for noise, expected in (
        ("range_bearing", [NoiseModel.range_bearing(uav.alpha) for uav in FLEET]),
        ("camera", [NoiseModel.camera(camera_of(uav), uav.altitude) for uav in FLEET]),
    ):
        setting = scenario("ideal", noise)
        with World(setting, OPEN, 0) as world:
            assert sensors(setting, world).noises == expected
