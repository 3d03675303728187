"""PyBullet's window: what it shows at which time, in a world that only notes it."""

import types

import numpy as np
import pytest

from sim.views import window
from tracking.geometry.camera import Pose


class Shown:
    """A world that notes where it shows the person and the camera, at which time of a clock that sleeping advances."""

    def __init__(self, monkeypatch, pressed):
        self.now, self.engine, self.pressed, self.seen = 0.0, self, pressed, []
        monkeypatch.setattr(window.time, "monotonic", lambda: self.now)
        monkeypatch.setattr(window.time, "sleep", self.sleep)

    def sleep(self, seconds):
        self.now += seconds

    def getKeyboardEvents(self):
        return {key: 2 for at, key in self.pressed if self.now - 0.01 < at + 1e-9 <= self.now}

    def place_people(self, people, headings):
        self.seen.append([self.now, *people[0]])

    def place_uavs(self, poses):
        self.seen[-1] += poses[0].position.tolist()

    def resetBasePositionAndOrientation(self, cone, place, quaternion):
        self.seen[-1] += [*place]


def walk_until(time):
    """A snapshot of a person who walks east at 1 m/s, below a UAV that flies north at 2 m/s."""
    pose = Pose.level(0.0, 2.0 * time, 20.0)
    one = {"people": np.array([[time, 3.0]]), "headings": np.zeros(1), "poses": (pose,), "cameras": (pose,)}
    return types.SimpleNamespace(time=time, working=[0], **one)


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_the_window_shows_each_time_of_the_mission_at_its_speed_and_stands_still_in_pauses(monkeypatch, speed):
    times = np.arange(0.0, 2.1, 0.2)  # s
    world = Shown(monkeypatch, [(0.1, ord(" ")), (0.9, ord(" "))])
    window._play(world, [7], map(walk_until, times), speed)
    now, east, north = np.array(world.seen).T[[0, 1, 4]]
    passed = speed * (now - np.clip(now - 0.09, 0.0, 0.8))
    # A scan begins with the step after the one that ends the scan before, which loses less than a step each.
    assert np.all(np.abs(east - passed) <= 0.01 * speed * (1 + passed / 0.2))
    np.testing.assert_allclose(north, 2.0 * east, atol=1e-9)
    np.testing.assert_array_equal(np.array(world.seen)[:, 3:6], np.array(world.seen)[:, 6:9])  # the camera's view
    assert east[-1] == pytest.approx(2.0) and np.all(np.diff(east) >= 0.0)
    quits = Shown(monkeypatch, [(0.55 / speed, ord("q"))])
    window._play(quits, [7], map(walk_until, times), speed)
    assert quits.seen[-1][1] == pytest.approx(0.5, abs=0.1 + 0.03 * speed)
