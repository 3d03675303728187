"""A recorded mission in PyBullet's window, which shows it from any side."""

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from sim.mission.recording import Recording
from sim.scenario.environment import Area
from sim.views.drawing.palette import uav_colour
from sim.world.engine import Engine, explain_failure, pybullet, silence, silence_c_code
from sim.world.world import World
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.quaternions import interpolate_poses
from tracking.numerics.arrays import Array

_SIZE = (1280, 800)
_GRASS = (0.46, 0.51, 0.36, 1.0)
_GLASS = 0.22  # opacity of a camera's pyramid of view
_ENDS = (ord("q"), 27)  # Q and Esc
_TRIAL = "import pybullet; assert pybullet.connect(pybullet.GUI) >= 0; pybullet.disconnect()"


def explain_refusal() -> str:
    """Reason why no window can be opened here; empty if one can."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        return "DISPLAY is not set"
    return explain_failure("the display", _TRIAL)


def show(recording: Recording, scans: Sequence[int], *, speed: float = 1.0, say: Callable[[str], None]) -> None:
    """Show successive scans in a window, `speed` times as fast as flown; InputError if no window can be opened.

    People and UAVs move evenly between scans. The show ends with the last scan, by Q or Esc, or when the window is
    closed; the space bar pauses and continues it.
    """
    reason = explain_refusal()
    if reason:
        raise InputError(f"--gui: no window can be opened here ({reason}); --video makes a film instead")
    setting = recording.setting
    with _open_world(recording) as world:
        cones = [_add_cone(world.engine, uav.true_camera, uav.altitude, i) for i, uav in enumerate(setting.uavs)]
        _set_scene(world.engine, setting.area)
        say("Q or Esc closes it, the space bar pauses; turn the view with Ctrl and the mouse, zoom with the wheel.")
        try:
            for moment in _list_moments(world.engine, recording.times[list(scans)], speed):
                _place(world, cones, recording, moment)
        except pybullet.error:
            if world.engine.isConnected():
                raise  # otherwise the window was closed


@contextmanager
def _open_world(recording: Recording) -> Iterator[World]:
    """The world of a recording in a window, without the engine's output."""
    options = f"--width={_SIZE[0]} --height={_SIZE[1]}"
    with silence_c_code():
        client = pybullet.connect(pybullet.GUI, options=options)
        pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_RENDERING, 0, physicsClientId=client)
        people = recording.person_count
        world = World(recording.setting, recording.forest, people, recording.seed, recording.repeat, client=client)
        world.engine.configureDebugVisualizer(pybullet.COV_ENABLE_RENDERING, 1)
    try:
        yield world
    finally:
        with silence(1, 2), silence_c_code():  # no other C code of the process prints here
            world.close()


def _set_scene(engine: Engine, area: Area) -> None:
    """Lay the ground and look at all of it from the south."""
    half = (area.width / 2, area.height / 2, 0.05)
    ground = engine.createVisualShape(pybullet.GEOM_BOX, halfExtents=half, rgbaColor=_GRASS)
    engine.createMultiBody(0.0, -1, ground, (0.0, 0.0, -0.05))
    for option in (pybullet.COV_ENABLE_GUI, pybullet.COV_ENABLE_SHADOWS, pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS):
        engine.configureDebugVisualizer(option, 0)
    distance = 0.47 * max(area.width, area.height * _SIZE[0] / _SIZE[1])
    engine.resetDebugVisualizerCamera(distance, 0.0, -50.0, (0.0, -0.05 * area.height, 0.0))


def _add_cone(engine: Engine, camera: Camera, length: float, uav: int) -> int:
    """Id of a new pyramid of coloured glass: the view of a camera at the origin that looks down."""
    corners = [[length * x, -length * y, -length] for x, y in camera.slopes(camera.corners).tolist()]
    sides = [index for k in range(4) for index in (0, 1 + k, 1 + (k + 1) % 4)]
    shape = engine.createVisualShape(
        pybullet.GEOM_MESH,
        vertices=[[0.0, 0.0, 0.0], *corners],
        indices=sides,
        rgbaColor=(*(tone / 255 for tone in uav_colour(uav)), _GLASS),
    )
    return int(engine.createMultiBody(0.0, -1, shape))


def _list_moments(engine: Engine, times: Array, speed: float) -> Iterator[float]:
    """The times [s] to show from the first to the last, at the pace of the clock, until a key ends it."""
    now = float(times[0])
    before = time.monotonic()
    runs = True
    yield now
    while now < times[-1]:
        time.sleep(0.01)
        pressed = {key for key, state in engine.getKeyboardEvents().items() if state & 2}
        if pressed.intersection(_ENDS):
            return
        runs ^= ord(" ") in pressed
        clock = time.monotonic()
        if runs:
            now = min(now + speed * (clock - before), float(times[-1]))
            yield now
        before = clock


def _place(world: World, cones: Sequence[int], recording: Recording, moment: float) -> None:
    k = int(np.searchsorted(recording.times, moment, side="right")) - 1
    after = min(k + 1, len(recording.times) - 1)
    share = (moment - recording.times[k]) / (recording.times[after] - recording.times[k]) if after > k else 0.0
    people = recording.people[k] + share * (recording.people[after] - recording.people[k])
    people = np.where(np.isnan(people), recording.people[k], people)
    world.place_people(people, recording.headings[k])
    world.place_uavs(_find_poses(recording.poses, recording.times, moment))
    for i, pose in enumerate(_find_poses(recording.cameras, recording.times, moment)):
        place = pose.position if recording.working[k, i] else np.array([0.0, 0.0, -1000.0])
        world.engine.resetBasePositionAndOrientation(cones[i], place.tolist(), pose.quaternion.tolist())


def _find_poses(rows: Array, times: Array, moment: float) -> list[Pose]:
    """Poses of all UAVs at a moment, from rows (K, n, 7) at times (K,) s."""
    found = [interpolate_poses(times, own, np.array([moment]))[0] for own in rows.swapaxes(0, 1)]
    return [Pose(row[:3], row[3:]) for row in found]
