"""From world to scans: measured people, errors and covariances; false alarms and misses."""

import math
from functools import cache

import numpy as np
import pytest
from helpers.views import CAMERA

from planning.planner_loading import load_planner
from sim.mission.mission import Mission
from sim.scenario.environment import People, Trees
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from sim.scenario.uavs import DEFAULT_FLEET, Uav
from sim.sensing.renderer import Renderer
from sim.sensing.sensor_mode import Shot
from sim.sensing.sensors import Clutter, Sensors
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detection_errors import whole_covariances
from tracking.detection.detector import Frame
from tracking.detection.noise import NoiseModel
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree

OPEN = Forest(())
ALTITUDES = [uav.altitude for uav in DEFAULT_FLEET]
# The fleet's bodies stay out of each other's sight.
FLEET = tuple(Uav(start=(74.0, 10.0 * k), footprint=u.footprint, alpha=u.alpha) for k, u in enumerate(DEFAULT_FLEET))


def scenario(mode="camera", noise="range_bearing", uavs=FLEET):
    return Scenario(uavs=uavs, sensing=Sensing(mode=mode, noise=noise))


def sensors(setting, world, forest=OPEN, seed=0):
    return Sensors(setting, world, forest, np.random.default_rng(seed))


def take(subject, shot):
    return subject.read(subject.expose(shot))


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
            look = take(subject, Shot(0, 0, 0.4, pose, people))
        half = (exact.altitude - TARGET_HEIGHT) * math.tan(math.radians(30))
        inside = np.all(np.abs(people - pose.position[:2]) <= half, axis=1)
        points = np.column_stack([people, np.full(30, TARGET_HEIGHT)])
        free = forest.visible(pose.position, points)[0]
        found, expected = look.scan.measurements, people[inside & free]
        np.testing.assert_allclose(found[np.argsort(found[:, 0])], expected[np.argsort(expected[:, 0])], atol=1e-5)
        assert look.matched.tolist() == look.visible.astype(bool).tolist() == (inside & free).tolist()
        assert (look.image, look.scan.uav, look.scan.time, len(look.pixels)) == (None, 0, 0.4, 0)
        counts += [np.sum(inside & free), np.sum(inside & ~free), np.sum(~inside)]
    assert counts.min() > 50


def test_ideal_sensing_detects_people_under_porous_trees_as_often_as_enough_of_them_shows():
    rng = np.random.default_rng(0)
    setting = scenario("ideal", uavs=(Uav(start=(0.0, 0.0), footprint=22.0, alpha=1e-14),))
    trees = [Tree(*rng.uniform(-12, 12, 2), canopy_radius=3.0, leaf_area_density=d) for d in rng.uniform(0, 1.5, 8)]
    forest, pose, people = Forest(tuple(trees)), Pose.level(0.0, 0.0, 20.0), rng.uniform(-10, 10, (200, 2))
    with World(setting, forest, 200) as world:
        subject = sensors(setting, world, forest)
        found = np.mean([take(subject, Shot(0, 0, 0.0, pose, people)).matched for _ in range(400)], axis=0)
    points = np.column_stack([people, np.full(200, TARGET_HEIGHT)])
    expected = forest.detectabilities(subject.cameras[0].lens(pose), points)
    assert np.all(np.abs(found - expected) <= 4.5 * np.sqrt(expected * (1 - expected) / 400))
    assert np.sum((expected > 0.1) & (expected < 0.9)) > 50


@pytest.mark.parametrize("mode", ["ideal", "camera"])
def test_shots_that_are_read_together_give_what_they_give_one_after_another(mode):
    """To the bit, with misses, false alarms and porous trees."""
    rng = np.random.default_rng(3)
    sensing = Sensing(mode=mode, false_alarms=1.0, miss_probability=0.2)
    setting = Scenario(uavs=tuple(Uav(start=(0.0, 9.0 * k), footprint=22.0) for k in range(3)), sensing=sensing)
    forest = Forest(tuple(Tree(*rng.uniform(-12, 12, 2), 3.0, leaf_area_density=0.4) for _ in range(3)))
    found = 0
    with World(setting, forest, 20) as world:
        one, other = (sensors(setting, world, forest) for _ in range(2))
        for k in range(4):
            people = rng.uniform(-12, 12, (20, 2))
            people[k] = np.nan
            world.place_people(people, np.zeros(20))
            poses = [Pose.level(*rng.uniform(-3, 3, 2), setting.uavs[0].altitude) for _ in range(3)]
            shots = [Shot(i, k, k / 5, pose, people) for i, pose in enumerate(poses)]
            together = one.read_all([one.expose(shot) for shot in shots])
            for reading, expected in zip(together, [take(other, shot) for shot in shots], strict=True):
                for name in ("measurements", "covariances"):
                    np.testing.assert_array_equal(getattr(reading.scan, name), getattr(expected.scan, name))
                for name in ("pixels", "visible", "matched", "image"):
                    np.testing.assert_array_equal(getattr(reading, name), getattr(expected, name))
                found += len(reading.scan.measurements)
    assert found > 30


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
        scans = [take(subject, Shot(uav, 0, 0.0, pose, person[None])).scan for _ in range(draws)]
        seen = BlobDetector().detect(
            Frame(uav, 0.0, subject.cameras[uav], pose, Renderer(world).render(subject.cameras[uav], pose).image)
        )
    mean = person if mode == "ideal" else seen.ground[0]
    R = equation_4(DEFAULT_FLEET[uav].alpha, mean - pose.position[:2])
    # What the tracker is told is the covariance at the measurement: the true place would be the truth itself.
    told = [equation_4(DEFAULT_FLEET[uav].alpha, s.measurements[0] - pose.position[:2]) for s in scans]
    own = 0.0 if mode == "ideal" else seen.covariances[0]
    np.testing.assert_allclose([s.covariances[0] - own for s in scans], told, rtol=1e-9)
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
        subject = Sensors(setting, world, OPEN, chance)
        for uav, altitude in enumerate(ALTITUDES):
            people = np.array([[-6.0, -6.0], [5.0, -4.0], [-3.0, 6.0], [5.0, 5.0]]) + rng.uniform(-1, 1, (4, 2))
            world.place_people(people, rng.uniform(-3, 3, 4))
            look = take(subject, Shot(uav, 0, 0.0, Pose.level(0.0, 0.0, altitude), people))
            frame = Frame(uav, 0.0, subject.cameras[uav], look.scan.pose, look.image)
            assert len(look.scan.measurements) == 4
            np.testing.assert_array_equal(look.scan.measurements, BlobDetector().detect(frame).ground)
    assert chance.bit_generator.state == np.random.default_rng(5).bit_generator.state


@pytest.mark.parametrize("mode", ["ideal", "camera"])
def test_absent_people_are_never_seen(mode):
    setting = scenario(mode)
    pose = Pose.level(0.0, 0.0, ALTITUDES[0])
    people = np.array([[np.nan, np.nan], [2.0, -3.0], [np.nan, np.nan]])
    with World(setting, OPEN, 3) as world:
        world.place_people(people, np.zeros(3))
        look = take(sensors(setting, world), Shot(0, 0, 0.0, pose, people))
        absent = np.full((3, 2), np.nan)
        world.place_people(absent, np.zeros(3))
        empty = take(sensors(setting, world), Shot(0, 0, 0.0, pose, absent))
    assert look.matched.tolist() == (look.visible > 0).tolist() == [False, True, False]
    assert look.scan.measurements.shape == (1, 2)
    assert np.linalg.norm(look.scan.measurements[0] - people[1]) < 2.0
    assert empty.scan.measurements.shape == (0, 2) and empty.scan.covariances.shape == (0, 2, 2)
    assert not empty.matched.any() and not empty.visible.any()


@cache
def flown(mode, **sensing):
    """Scans and matches of a hovering UAV over one person, with initial tracks unknown to none."""
    setting = Scenario(
        duration=4.0,
        trees=Trees(density=0.0),
        people=People(count=2, paths=(((-28.0, -14.0), (-26.0, -12.0)), ((-30.0, -12.0), (-26.0, -16.0)))),
        uavs=(Uav(start=(-28.0, -14.0), footprint=30.0),),
        sensing=Sensing(mode=mode, **sensing),
    )
    return list(Mission(setting, load_planner("hover"), 3).fly())


def test_false_alarms_are_poisson_and_uniform_over_the_ground_in_view():
    clutter = Clutter(Sensing(false_alarms=3.0), np.random.default_rng(0))
    pose = Pose.level(5.0, -7.0, 20.0)
    frames = [clutter.draw_false_alarms(CAMERA, pose) for _ in range(2000)]
    counts = np.array([len(pixels) for pixels, _ in frames])
    assert counts.mean() == pytest.approx(3.0, abs=4 * math.sqrt(3.0 / 2000))
    assert counts.var() == pytest.approx(3.0, abs=0.45)
    half = (20.0 - TARGET_HEIGHT) * math.tan(CAMERA.fov / 2)
    offsets = (np.vstack([ground for _, ground in frames]) - [5.0, -7.0]) / half
    assert np.abs(offsets).max() <= 1.0 and np.ptp(offsets, axis=0).min() > 1.998
    cells = np.histogram2d(*offsets.T, bins=4, range=[[-1, 1], [-1, 1]])[0]
    expected = counts.sum() / 16
    assert ((cells - expected) ** 2 / expected).sum() < 37.7  # chi-square, 15 degrees of freedom, 0.1 %
    clutter = Clutter(Sensing(false_alarms=50.0), np.random.default_rng(0))
    level = Pose(np.array([0.0, 0.0, 10.0]), np.array([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]))
    pixels, ground = clutter.draw_false_alarms(CAMERA, level)
    assert 5 < len(pixels) < 45 and pixels[:, 1].min() > 64.0 and ground[:, 1].min() > 0.0


@pytest.mark.parametrize("mode", ["camera", "ideal"])
def test_misses_and_false_alarms_leave_other_measurements_as_they_were(mode):
    plain = flown(mode)
    for setting in ({"false_alarms": 2.0}, {"miss_probability": 0.5}, {"false_alarms": 2.0, "miss_probability": 0.5}):
        added = missed = 0
        for before, after in zip(plain, flown(mode, **setting), strict=True):
            was, now = before.scans[0].measurements, after.scans[0].measurements
            same = (now[:, None] == was[None]).all(axis=2)
            added += int((~same.any(axis=1)).sum())
            missed += int((~same.any(axis=0)).sum())
            assert after.matched.sum() == same.any(axis=0).sum()
            assert len(after.pixels[0]) == (len(now) if mode == "camera" else 0)
            assert after.scans[0].covariances.shape == (len(now), 2, 2)
        assert (added > 0, missed > 0) == ("false_alarms" in setting, "miss_probability" in setting)
        assert added == 0 or 20 < added < 65  # 21 scans of two each
        assert missed == 0 or 8 < missed < 34  # 42 detections


def test_false_alarms_do_not_depend_on_misses():
    alone, both = flown("camera", false_alarms=2.0), flown("camera", false_alarms=2.0, miss_probability=1.0)
    for one, other in zip(alone, both, strict=True):
        alarms = {tuple(z) for z in other.scans[0].measurements}
        assert alarms <= {tuple(z) for z in one.scans[0].measurements}
        assert len(one.scans[0].measurements) == len(alarms) + one.matched.sum() and not other.matched.any()


@pytest.mark.parametrize("mode", ["camera", "ideal"])
def test_the_order_of_a_scan_does_not_reveal_false_alarms(mode):
    first, places = 0, 0.0
    for before, after in zip(flown(mode), flown(mode, false_alarms=2.0), strict=True):
        was, now = before.scans[0].measurements, after.scans[0].measurements
        alarm = ~(now[:, None] == was[None]).all(axis=2).any(axis=1)
        if mode == "camera":  # pixels are in the order of the scan
            ground = CAMERA.ground_points(after.cameras[0], after.pixels[0], TARGET_HEIGHT)
            np.testing.assert_allclose(ground[alarm], now[alarm], atol=1e-9)
        if alarm.any() and not alarm.all():
            first, places = first + alarm[0], places + alarm.mean()
    assert first == pytest.approx(places, abs=6.5)  # three standard deviations of twenty draws


def test_the_order_of_a_scan_without_images_does_not_reveal_who_is_who():
    scans = [(snapshot.people, snapshot.scans[0].measurements) for snapshot in flown("ideal")]
    first = [np.linalg.norm(people - z[0], axis=1).argmin() for people, z in scans if len(z) == 2]
    assert len(first) > 15 and abs(np.mean(first) - 0.5) < 1.5 / math.sqrt(len(first))  # three standard deviations


@pytest.mark.parametrize("noise", ["camera", "range_bearing"])
def test_false_alarms_have_the_covariance_of_a_person_there(noise):
    mission = flown("camera", false_alarms=2.0, miss_probability=1.0, noise=noise)
    count = 0
    for snapshot in mission:
        scan, pose = snapshot.scans[0], snapshot.cameras[0]
        frame = Frame(0, snapshot.time, CAMERA, pose, np.zeros((128, 128, 3), dtype=np.uint8))
        if noise == "camera":
            expected = whole_covariances(frame.camera.lens(frame.pose), scan.measurements)
        else:
            eye, model = pose.position[:2], NoiseModel.range_bearing(Uav(start=(0.0, 0.0)).alpha)
            expected = np.array([model.covariance(eye, z) for z in scan.measurements]).reshape(-1, 2, 2)
            expected = expected + whole_covariances(frame.camera.lens(frame.pose), scan.measurements)
        np.testing.assert_array_equal(scan.covariances, expected)
        count += len(expected)
    assert count > 20


def test_people_at_the_edge_of_a_canopy_are_measured_where_they_are():
    """Of those seen in part what shows lies away from the tree; the map and the detector's covariance mend it."""
    setting, pose, rng = scenario(), Pose.level(0.0, 0.0, ALTITUDES[0]), np.random.default_rng(2)
    tree = np.array([0.0, 5.0])
    forest, raw, mended, nees = Forest((Tree(*tree, 3.0),)), [], [], []
    with World(setting, forest, 1) as world:
        subject = sensors(setting, world, forest)
        for side in (-1, 1) * 150:
            angle = rng.uniform(0.0, 0.4)  # beside the tree and beyond it
            away = np.array([side * math.cos(angle), math.sin(angle)])
            person = tree + (2.3 * angle + rng.uniform(3.3, 4.0)) * away
            world.place_people(person[None], rng.uniform(-3, 3, 1))
            look = take(subject, Shot(0, 0, 0.0, pose, person[None], forest=forest))
            if 0 < look.visible[0] < 7:
                frame = Frame(0, 0.0, subject.cameras[0], pose, look.image)
                raw.append((BlobDetector().detect(frame).ground[0] - person) @ away)
                error, R = look.scan.measurements[0] - person, look.scan.covariances[0]
                mended.append(error @ away)
                nees.append(error @ np.linalg.solve(R, error))
    assert len(raw) > 60 and np.mean(raw) > 0.2
    assert abs(np.mean(mended)) < 0.1 and 1.5 < np.mean(nees) < 2.5
