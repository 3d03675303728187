"""A recorded mission in PyBullet's window, which shows it from any side."""

import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np

from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot
from sim.scenario.scenario import Scenario
from sim.views.palette import uav_colour
from sim.world.engine import Engine, explain_failure, pybullet, silence, silence_c_code
from sim.world.world import World
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose

_TRIAL = "import pybullet; assert pybullet.connect(pybullet.GUI) >= 0; pybullet.disconnect()"


def explain_refusal() -> str:
    """Reason why no window can be opened here; empty if one can."""
    hidden = sys.platform.startswith("linux") and not os.environ.get("DISPLAY")
    return "DISPLAY is not set" if hidden else explain_failure("the display", _TRIAL)


def show(recording: Recording, scans: Sequence[int], *, speed: float = 1.0, say: Callable[[str], None]) -> None:
    """Show successive scans in a window, `speed` times as fast as flown; InputError if no window can be opened.

    The show ends with the last scan, by Q or Esc, or when the window is closed; the space bar pauses and continues it.
    """
    if reason := explain_refusal():
        raise InputError(f"--gui: no window can be opened here ({reason}); --video makes a film instead")
    with silence_c_code():
        client = pybullet.connect(pybullet.GUI, options="--width=1280 --height=800")
        people = recording.person_count
        world = World(recording.setting, recording.forest, people, recording.seed, recording.repeat, client=client)
    say("Q or Esc closes it, the space bar pauses; turn the view with Ctrl and the mouse, zoom with the wheel.")
    try:
        cones = _furnish(world.engine, recording.setting)
        _play(world, cones, map(recording.snapshot, scans), speed)
    except pybullet.error:
        if world.engine.isConnected():
            raise  # otherwise the window was closed
    finally:
        with silence(1, 2), silence_c_code():  # no other C code of the process prints here
            world.close()


def _furnish(engine: Engine, scenario: Scenario) -> list[int]:
    """Lay the ground and look at all of it from the south; return the ids of the views of all cameras."""
    width, height = scenario.area.width, scenario.area.height
    half = (width / 2, height / 2, 0.05)
    ground = engine.createVisualShape(pybullet.GEOM_BOX, halfExtents=half, rgbaColor=(0.46, 0.51, 0.36, 1.0))
    engine.createMultiBody(0.0, -1, ground, (0.0, 0.0, -0.05))
    for option in (pybullet.COV_ENABLE_GUI, pybullet.COV_ENABLE_SHADOWS, pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS):
        engine.configureDebugVisualizer(option, 0)
    distance = 0.47 * max(width, 1.6 * height)  # the window is 1.6 times as wide as high
    engine.resetDebugVisualizerCamera(distance, 0.0, -50.0, (0.0, -0.05 * height, 0.0))
    return [_add_cone(engine, uav.true_camera, uav.altitude, i) for i, uav in enumerate(scenario.uavs)]


def _add_cone(engine: Engine, camera: Camera, length: float, uav: int) -> int:
    """Id of a new pyramid of coloured glass: the view of a camera at the origin that looks down."""
    ends = [(length * x, -length * y, -length) for x, y in camera.slopes(camera.shown(camera.corners)).tolist()]
    sides = [index for k in range(4) for index in (0, 1 + k, 1 + (k + 1) % 4)]
    look = {"indices": sides, "rgbaColor": (*(tone / 255 for tone in uav_colour(uav)), 0.22)}
    shape = engine.createVisualShape(pybullet.GEOM_MESH, vertices=[(0, 0, 0), *ends], **look)
    return int(engine.createMultiBody(0.0, -1, shape))


def _play(world: World, cones: Sequence[int], snapshots: Iterable[Snapshot], speed: float) -> None:
    """Move evenly from each snapshot to the next at the pace of the clock, until a key ends the show."""
    runs = True
    for before, now in pairwise(snapshots):
        span = now.time - before.time
        passed = 0.0  # s of the mission
        clock = time.monotonic()
        while passed < span:
            time.sleep(0.01)
            pressed = {key for key, state in world.engine.getKeyboardEvents().items() if state & 2}
            if pressed & {ord("q"), 27}:  # Q or Esc
                return
            runs ^= ord(" ") in pressed
            spent = time.monotonic() - clock
            clock += spent
            passed += speed * spent * runs
            _place(world, cones, before, now, min(passed / span, 1.0))


def _place(world: World, cones: Sequence[int], one: Snapshot, other: Snapshot, share: float) -> None:
    people = np.where(np.isnan(other.people), one.people, one.people + share * (other.people - one.people))
    world.place_people(people, one.headings)
    bodies = [a.position + share * (b.position - a.position) for a, b in zip(one.poses, other.poses, strict=True)]
    world.place_uavs([Pose(at, pose.quaternion) for at, pose in zip(bodies, one.poses, strict=True)])
    for i, at in enumerate(bodies):  # where cameras are, too
        place = at.tolist() if i in one.working else (0.0, 0.0, -1000.0)
        world.engine.resetBasePositionAndOrientation(cones[i], place, one.cameras[i].quaternion.tolist())
