"""A recorded mission in PyBullet's window, which shows it from any side."""

import os
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot
from sim.scenario.scenario import Scenario
from sim.views.palette import uav_colour
from sim.world.engine import explain_failure, pybullet, silence, silence_c_code
from sim.world.world import World
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose

_SIZE = (1280, 800)
_GRASS = (0.46, 0.51, 0.36, 1.0)
_GLASS = 0.22  # opacity of a camera's pyramid of view
_ENDS = (ord("q"), 27)  # Q and Esc
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
        client = pybullet.connect(pybullet.GUI, options=f"--width={_SIZE[0]} --height={_SIZE[1]}")
        people = recording.person_count
        world = World(recording.setting, recording.forest, people, recording.seed, recording.repeat, client=client)
    say("Q or Esc closes it, the space bar pauses; turn the view with Ctrl and the mouse, zoom with the wheel.")
    try:
        window = Window(world, recording.setting, speed)
        all(window.add(recording.snapshot(k)) for k in scans)
    except pybullet.error:
        if world.engine.isConnected():
            raise  # otherwise the window was closed
    finally:
        with silence(1, 2), silence_c_code():  # no other C code of the process prints here
            world.close()


class Window:
    """Shows successive snapshots of a world with a window; positions move evenly between them."""

    def __init__(self, world: World, scenario: Scenario, speed: float) -> None:
        """Lay the ground and look at all of it from the south."""
        self._world = world
        self._engine = world.engine
        self._speed = speed
        self._last: Snapshot | None = None
        self._runs = True
        self._cones = [self._add_cone(uav.true_camera, uav.altitude, i) for i, uav in enumerate(scenario.uavs)]
        width, height = scenario.area.width, scenario.area.height
        half = (width / 2, height / 2, 0.05)
        ground = self._engine.createVisualShape(pybullet.GEOM_BOX, halfExtents=half, rgbaColor=_GRASS)
        self._engine.createMultiBody(0.0, -1, ground, (0.0, 0.0, -0.05))
        for option in (pybullet.COV_ENABLE_GUI, pybullet.COV_ENABLE_SHADOWS, pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS):
            self._engine.configureDebugVisualizer(option, 0)
        distance = 0.47 * max(width, height * _SIZE[0] / _SIZE[1])
        self._engine.resetDebugVisualizerCamera(distance, 0.0, -50.0, (0.0, -0.05 * height, 0.0))

    def _add_cone(self, camera: Camera, length: float, uav: int) -> int:
        """Id of a new pyramid of coloured glass: the view of a camera at the origin that looks down."""
        ends = [(length * x, -length * y, -length) for x, y in camera.slopes(camera.corners).tolist()]
        sides = [index for k in range(4) for index in (0, 1 + k, 1 + (k + 1) % 4)]
        look = {"indices": sides, "rgbaColor": (*(tone / 255 for tone in uav_colour(uav)), _GLASS)}
        shape = self._engine.createVisualShape(pybullet.GEOM_MESH, vertices=[(0, 0, 0), *ends], **look)
        return int(self._engine.createMultiBody(0.0, -1, shape))

    def add(self, snapshot: Snapshot) -> bool:
        """Show the time until this snapshot at the pace of the clock; False if a key ends the show."""
        before = self._last or snapshot
        self._last = snapshot
        span = snapshot.time - before.time
        passed = 0.0  # s of the mission
        clock = time.monotonic()
        while passed < span:
            time.sleep(0.01)
            pressed = {key for key, state in self._engine.getKeyboardEvents().items() if state & 2}
            if pressed.intersection(_ENDS):
                return False
            self._runs ^= ord(" ") in pressed
            spent = time.monotonic() - clock
            clock += spent
            passed += self._speed * spent * self._runs
            self._place(before, snapshot, min(passed / span, 1.0))
        return True

    def _place(self, one: Snapshot, other: Snapshot, share: float) -> None:
        people = np.where(np.isnan(other.people), one.people, one.people + share * (other.people - one.people))
        self._world.place_people(people, one.headings)
        bodies = [a.position + share * (b.position - a.position) for a, b in zip(one.poses, other.poses, strict=True)]
        self._world.place_uavs([Pose(at, pose.quaternion) for at, pose in zip(bodies, one.poses, strict=True)])
        for i, at in enumerate(bodies):  # where cameras are, too
            place = at.tolist() if i in one.working else (0.0, 0.0, -1000.0)
            self._engine.resetBasePositionAndOrientation(self._cones[i], place, one.cameras[i].quaternion.tolist())
