"""False alarms and misses: how many, where, and that nothing else changes."""

import math
from functools import cache

import numpy as np
import pytest

from planning.loading import load_planner
from sim.mission.mission import Mission
from sim.scenario.environment import People, Trees
from sim.scenario.fleet import Uav
from sim.scenario.perception import Sensing
from sim.scenario.scenario import Scenario
from sim.sensing.sensors import Clutter
from tracking.detection.detector import Frame
from tracking.detection.ground_measurement import whole_covariances
from tracking.detection.noise import NoiseModel
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT

CAMERA = Camera(math.radians(60), 128)


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
    frames = [clutter.false_alarms(CAMERA, pose) for _ in range(2000)]
    counts = np.array([len(pixels) for pixels, _ in frames])
    assert counts.mean() == pytest.approx(3.0, abs=4 * math.sqrt(3.0 / 2000))
    assert counts.var() == pytest.approx(3.0, abs=0.45)
    half = (20.0 - TARGET_HEIGHT) * math.tan(CAMERA.fov / 2)
    offsets = (np.vstack([ground for _, ground in frames]) - [5.0, -7.0]) / half
    assert np.abs(offsets).max() <= 1.0
    cells = np.histogram2d(*offsets.T, bins=4, range=[[-1, 1], [-1, 1]])[0]
    expected = counts.sum() / 16
    assert ((cells - expected) ** 2 / expected).sum() < 37.7  # chi-square, 15 degrees of freedom, 0.1 %


def test_no_false_alarm_is_above_the_horizon():
    clutter = Clutter(Sensing(false_alarms=50.0), np.random.default_rng(0))
    level = Pose(np.array([0.0, 0.0, 10.0]), np.array([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]))
    pixels, ground = clutter.false_alarms(CAMERA, level)
    assert 5 < len(pixels) < 45 and pixels[:, 1].min() > 64.0 and ground[:, 1].min() > 0.0


@pytest.mark.parametrize("mode", ["camera", "ideal"])
def test_what_goes_wrong_leaves_what_is_detected_as_it_was(mode):
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
        assert len(one.scans[0].measurements) == len(alarms) + one.matched.sum()
        assert not other.matched.any()


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


@pytest.mark.parametrize("noise", ["camera", "range_bearing"])
def test_false_alarms_have_the_covariance_of_a_person_there(noise):
    mission = flown("camera", false_alarms=2.0, miss_probability=1.0, noise=noise)
    count = 0
    for snapshot in mission:
        scan, pose = snapshot.scans[0], snapshot.cameras[0]
        frame = Frame(0, snapshot.time, CAMERA, pose, np.zeros((128, 128, 3), dtype=np.uint8))
        if noise == "camera":
            expected = whole_covariances(frame, scan.measurements)
        else:
            eye, model = pose.position[:2], NoiseModel.range_bearing(Uav(start=(0.0, 0.0)).alpha)
            expected = np.array([model.covariance(eye, z) for z in scan.measurements]).reshape(-1, 2, 2)
        np.testing.assert_array_equal(scan.covariances, expected)
        count += len(expected)
    assert count > 20
