"""A frame follows from poses alone: it is the same whatever was rendered before, flown or replayed, in any process."""

import math

import numpy as np
import pytest
from helpers import synthetic
from helpers.flights import PAIR, filmed

from sim.facts.rerender import Rerenderer
from sim.mission.archive import load_recording, save
from sim.sensing.renderer import capture
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree

CAMERA = Camera(math.radians(60), 128)
# Where a pixel alternated with each image while the meshes had normals that do not stay: camera's place and quaternion.
ALTERNATED = {
    "canopy": ((8.22, 2.2, 7.44), (0.353, 0.46, 0.646, 0.496)),
    "uav": ((-10.48, -0.68, 8.35), (0.527, -0.167, -0.252, 0.794)),
}
APPEARANCE = {
    "plain": (),
    "mild": ("appearance=mild",),
    "camera": ("appearance.blur=0.5", "appearance.noise=4"),
    "all": ("appearance=full", "wind.velocity=[4,1]", "wind.gust=2", "uavs.1.rate=1", "uavs.0.fails_at=1.5"),
}


@pytest.mark.parametrize(("place", "quaternion"), ALTERNATED.values(), ids=ALTERNATED)
def test_the_same_view_is_the_same_image_again(place, quaternion):
    pose = Pose(np.array(place), np.array(quaternion) / np.linalg.norm(quaternion))
    with World(synthetic.scenario(uavs=1), Forest((Tree(0.0, 0.0, 5.0),)), 1) as world:
        world.place_people(np.array([[10.0, 0.0]]), np.zeros(1))
        world.place_uavs([Pose(np.array([-10.0, 0.0, 8.0]), np.array([0.0, 0.0, 0.0, 1.0]))])
        images = [capture(world.client, CAMERA, pose)[0] for _ in range(4)]
    for image in images[1:]:
        np.testing.assert_array_equal(image, images[0])


@pytest.mark.parametrize(("mount", "look"), [*(("body", look) for look in APPEARANCE), ("gimbal", "all")])
def test_frames_rendered_again_in_any_order_are_those_flown_byte_for_byte(mount, look, tmp_path):
    recording, images = filmed("trees.density=75", PAIR.format(mount), *APPEARANCE[look], duration=2)
    save(recording, tmp_path / "mission.npz")
    recording = load_recording(tmp_path / "mission.npz")
    order = np.random.default_rng(0).permutation(len(images)).tolist()
    with Rerenderer(recording) as again:
        for k in order:
            for mine, theirs in zip(again.images(k, [0, 1]), images[k], strict=True):
                assert (mine is None) == (theirs is None)
                assert mine is None or mine.tobytes() == theirs.tobytes()


@pytest.mark.slow
def test_six_thousand_frames_of_whole_missions_come_out_as_flown():
    for number in range(5):
        recording, images = filmed(
            "trees.density=75", PAIR.format(("gimbal", "body")[number % 2]), f"people.count={4 + number}", duration=40
        )
        with Rerenderer(recording) as again:
            for _ in range(3):
                for k, row in enumerate(images):
                    for mine, theirs in zip(again.images(k, [0, 1]), row, strict=True):
                        assert mine is not None and mine.tobytes() == theirs.tobytes()
