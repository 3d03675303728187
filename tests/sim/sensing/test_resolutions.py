"""Cameras of several resolutions share one client: each sees what it would see if all were like it."""

import itertools
import math

import msgspec
import numpy as np
from helpers.views import SCENARIO, random_forest

from sim.mission.mission import Mission, Trial
from sim.scenario.fleet import DEFAULT_FLEET
from sim.scenario.scenario import Scenario
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose

PIXELS = (96, 128, 256)


def flown(pixels):
    """Images of each scan of a short mission, UAV by UAV."""
    uavs = tuple(msgspec.structs.replace(uav, pixels=n) for uav, n in zip(DEFAULT_FLEET, pixels, strict=True))
    mission = Mission.of(Trial(Scenario(duration=0.4, uavs=uavs), "hover", 2))
    return [tuple(mission.frames) for _ in mission.fly()]


def test_a_fleet_of_several_resolutions_gets_the_frames_of_fleets_of_one():
    mixed = flown(PIXELS)
    equal = [flown((n, n, n)) for n in PIXELS]
    assert len(mixed) == 3
    for k, uav in itertools.product(range(3), range(3)):
        assert mixed[k][uav].shape == (PIXELS[uav], PIXELS[uav], 3)
        assert mixed[k][uav].tobytes() == equal[uav][k][uav].tobytes()


def test_whatever_size_was_rendered_before_an_image_and_its_mask_are_the_same():
    rng = np.random.default_rng(0)
    forest, places = random_forest(rng, 24, 5.0), rng.uniform(-15, 15, (12, 2))
    cameras = [Camera(math.radians(60), n) for n in (16, 97, 128, 512)]
    poses = [Pose.level(*rng.uniform(-15, 15, 2), 19.0) for _ in range(4)]

    def shots(order):
        with World(SCENARIO, forest, 12) as world:
            world.place_people(places, np.zeros(12))
            renderer = Renderer(world)
            views = {(i, j): renderer.render(cameras[i], poses[j]) for i, j in order}
        return {key: (view.image.tobytes(), view.people.tobytes()) for key, view in views.items()}

    sorted_by_size = list(itertools.product(range(4), range(4)))
    expected = shots(sorted_by_size)
    assert len(set(expected.values())) == 16
    assert shots([(i, j) for j in range(4) for i in (3, 0, 2, 1)]) == expected
    assert shots([sorted_by_size[k] for k in rng.permutation(16)]) == expected
