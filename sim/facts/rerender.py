"""Images of a recorded mission, rendered again from its poses."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sim.mission.recording import Recording
from sim.scenario.loading import change_settings
from sim.scenario.scenario import encode_scenario
from tracking.numerics.arrays import Image

if TYPE_CHECKING:
    from sim.sensing.sensor_mode import Rendered, Shot


class Rerenderer(ExitStack):
    """The world of a recording, in which any of its frames can be rendered again without a flight.

    The images are equal to those of the mission, byte for byte, because scenario, seed, repeat and the poses of
    cameras, people and UAVs determine them.
    """

    def __init__(self, recording: Recording) -> None:
        # Here, as flights from elsewhere are shown without the engine.
        from sim.sensing.renderer import Renderer
        from sim.world.world import World

        super().__init__()
        self.recording = recording
        people = recording.person_count
        world = World(recording.setting, recording.forest, people, recording.seed, repeat=recording.repeat)
        self._world = self.enter_context(world)
        self._renderer = Renderer(self._world)

    def image(self, k: int, uav: int) -> Image:
        """The image (H, W, 3) RGB of the UAV's camera at scan k; in ideal sensing, the one that it would have taken."""
        return self.rendered(k, uav).image

    def rendered(self, k: int, uav: int) -> "Rendered":
        """The same image with the mask of people."""
        r = self.recording
        self._world.place_people(r.people[k], r.headings[k])
        self._world.place_uavs(r.poses_at(k))
        shot = self._expose(k, uav)
        return self._renderer.take(uav, shot.time, r.setting.uavs[uav].true_camera, shot.true, shot.sweep)

    def _expose(self, k: int, uav: int) -> "Shot":
        """The UAV's shot at scan k, with the motion while its image was read out, as in the mission."""
        from sim.sensing.sensor_mode import Shot

        r = self.recording
        earlier = np.flatnonzero(r.frames_taken[:k, uav])[-1:].tolist()
        *before, shot = [Shot(uav, j, float(r.times[j]), r.camera_at(j, uav), r.people[j]) for j in (*earlier, k)]
        return shot.expose(before[0] if before else None, r.setting.uavs[uav].readout)

    def count_whole(self, k: int, uav: int, person: int) -> int:
        """Number of pixels of one person in the same image if nothing hid it."""
        r = self.recording
        bare = self._treeless
        others = np.arange(r.person_count) != person
        bare._world.place_people(np.where(others[:, None], np.nan, r.people[k]), r.headings[k])
        bare._world.place_uavs([r.poses_at(k)[uav]] * r.uav_count)  # before the near plane, where none shows
        shot = self._expose(k, uav)
        return int(np.sum(bare._renderer.find_people(r.setting.uavs[uav].true_camera, shot.true, shot.sweep) >= 0))

    @cached_property
    def _treeless(self) -> "Rerenderer":
        """Renderer of the same world without trees, on the CPU, as OpenGL draws one world at a time."""
        scenario = encode_scenario(change_settings(self.recording.setting, {"sensing.renderer": "tiny"}))
        return self.enter_context(Rerenderer(replace(self.recording, trees=np.zeros((0, 6)), scenario=scenario)))

    def images(self, k: int, uavs: Sequence[int]) -> list[Image | None]:
        """The images that the given UAVs took at scan k, by UAV of the mission; None for a UAV without one.

        A UAV takes none in ideal sensing, after it has broken down, and between the frames of a slow camera.
        """
        recording = self.recording
        taken: list[Image | None] = [None] * recording.uav_count
        for i in uavs if recording.setting.sensing.renders else ():
            if recording.frames_taken[k, i]:
                taken[i] = self.image(k, i)
        return taken
