"""The physical world: ground, trees, people and quadrotors, in a PyBullet client if one is needed."""

import math
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from sim.scenario.scenario import Scenario
from sim.world import opengl
from sim.world.appearance import sample_appearance
from sim.world.bodies import AWAY, Bodies, Body, rotate
from sim.world.contacts import Contact, nearest_approach
from sim.world.engine import Engine, pybullet
from sim.world.quadrotor import ROTORS, drag, glide, rotor_thrusts, settle, steady_thrusts
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import cos, sin

_CLEAR = 1.0  # m, from a UAV's centre to another's or to the bodies below; beyond this distance nothing touches


class World:
    """Ground, trees, people and quadrotors in one client, which the world owns.

    `bodies` lists canopies, trunks, people and UAVs, each in the order of the forest, the people and the scenario;
    `centres` gives their positions. Trees stand still, people are placed, and UAVs follow velocity commands.
    If the scenario varies the appearance, it is decided by the seed, and the noise of images by seed and repeat.
    Except with OpenGL, a world can be copied and pickled; the copy has its own client in the same state.
    For kinematic UAVs without rendering, the client is made only when it is first used.
    """

    def __init__(
        self,
        scenario: Scenario,
        forest: Forest,
        people: int,
        seed: int = 0,
        repeat: int = 0,
        *,
        client: int | None = None,
    ) -> None:
        """Build the world in the engine's `client`, such as one with a window; by default in a new one."""
        self.opengl = client is None and scenario.sensing.renders and scenario.sensing.renderer == "egl"
        self.style = sample_appearance(scenario, seed, trees=len(forest.trees), people=people, repeat=repeat)
        self._scenario, self._dt = scenario, 1.0 / scenario.rates.physics  # s, of the engine
        self._origin = scenario, forest, people, seed, repeat
        self.trees = forest.trees
        self._given = client
        self._altitudes = [uav.altitude for uav in scenario.uavs]
        starts = [(*uav.start, uav.altitude) for uav in scenario.uavs]
        self._positions = np.array(starts, dtype=float)  # positions of kinematic UAVs, as given to the engine
        self._quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (len(starts), 1))
        self._commands = np.zeros((len(starts), 2))
        centres = [(t.x, t.y, (t.canopy_base + t.canopy_top) / 2) for t in forest.trees]
        centres += [(t.x, t.y, t.canopy_base / 2) for t in forest.trees]
        self._tree_centres = np.array(centres, dtype=float).reshape(-1, 3)
        self._people_centres, self._headings = np.full((people, 3), np.nan), np.zeros(people)
        self._memories = np.zeros((len(starts), 3))  # m/s², memories of `steady_thrusts`
        self._touched: set[Contact] = set()
        self._closed = False
        tops = [t.canopy_top for t in forest.trees]
        above = min(self._altitudes) - max(2 * TARGET_HEIGHT, *tops, 0.0)
        self._kinematic = scenario.dynamics == "kinematic"
        self._alone = self._kinematic and above > _CLEAR  # True if UAVs can touch only one another
        if client is not None or not self._kinematic or scenario.sensing.renders:
            _ = self._bodies

    @property
    def client(self) -> int:
        """The engine's client."""
        return self._bodies.client

    @property
    def engine(self) -> Engine:
        """The engine's functions for the client."""
        return self._bodies.engine

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Canopies, trunks, people and UAVs."""
        return self._bodies.all

    @cached_property
    def _bodies(self) -> Bodies:
        """Bodies and their client, made at the first use in the present state of the world."""
        client = self._given
        if client is None:
            largest = max(uav.pixels for uav in self._scenario.uavs)
            client = opengl.connect(largest, self.trees) if self.opengl else pybullet.connect(pybullet.DIRECT)
        try:
            made = Bodies(client, self._scenario, self.trees, self.style, opengl=self.opengl)
            self._put_uavs(made)
            _put_people(made, self._people_centres, self._headings)
        except BaseException:
            self._disconnect(client)
            raise
        return made

    @property
    def _made(self) -> bool:
        return "_bodies" in vars(self)

    @property
    def centres(self) -> Array:
        """Centres (B, 3) m of the spheres around `bodies`; NaN for absent people."""
        uavs = [pose.position for pose in self.poses()]
        return np.vstack([self._tree_centres, self._people_centres, uavs])

    def place_people(self, positions: Array, headings: Array) -> None:
        """Put people at positions (M, 2) m with headings (M,) rad from east; NaN means absent."""
        self._people_centres[:, :2] = positions
        self._people_centres[:, 2] = np.where(np.isnan(positions[:, 0]), np.nan, TARGET_HEIGHT)
        self._headings = headings
        if self._made:
            _put_people(self._bodies, self._people_centres, headings)

    def place_uavs(self, poses: Sequence[Pose]) -> None:
        """Put each UAV at a recorded pose of its body, without a change of its velocity."""
        self._positions = np.array([pose.position for pose in poses])
        self._quaternions = np.array([pose.quaternion for pose in poses])
        for body, pose in zip(self._bodies.uavs, poses, strict=True):
            self.engine.resetBasePositionAndOrientation(body.id, pose.position.tolist(), pose.quaternion.tolist())

    def poses(self) -> list[Pose]:
        """Poses of the UAVs' bodies; axes: x forward (east at yaw 0), y left, z up."""
        if self._kinematic:
            return [Pose(*pose) for pose in zip(self._positions.copy(), settle(self._quaternions), strict=True)]
        found = [self.engine.getBasePositionAndOrientation(body.id) for body in self._bodies.uavs]
        return [Pose(*map(np.array, pose)) for pose in found]

    def velocities(self) -> Array:
        """Velocities of the UAVs (n, 3) m/s."""
        if self._kinematic:
            return np.pad(self._commands, ((0, 0), (0, 1)))
        return np.array([self.engine.getBaseVelocity(b.id)[0] for b in self._bodies.uavs])

    def advance(self, commands: Array, winds: Sequence[Array | None]) -> None:
        """Advance by one physics `step` per wind.

        Kinematic UAVs that are too far from everything to touch it make all steps at once, without the engine.
        """
        if self._alone and self._apart(commands, len(winds)):
            self._glide(commands, len(winds))
            return
        for wind in winds:
            self.step(commands, wind)

    def step(self, commands: Array, wind: Array | None = None) -> None:
        """Advance by one physics step under velocity commands (n, 2) m/s, east and north.

        wind (2,) m/s, east and north, pushes quadrotors, which hold against it; None means no air resistance.
        """
        if self._kinematic:
            _ = self._bodies
            self._glide(commands, 1)
            self.engine.performCollisionDetection()
            self._touch()
            return
        before = [self._state(body) for body in self._bodies.uavs]
        for uav, (state, command) in enumerate(zip(before, commands, strict=True)):
            self._apply_forces(uav, state, np.array([*command, self._altitudes[uav]]), wind)
        self.engine.stepSimulation()
        for body, state in zip(self._bodies.uavs, before, strict=True):
            self._redo_attitude(body, state[_QUATERNION])
        self._touch()

    def take_contacts(self) -> tuple[Contact, ...]:
        """Contacts of UAVs since the last call, sorted; a contact of two UAVs is listed once, for the first."""
        taken, self._touched = tuple(sorted(self._touched)), set()
        return taken

    def close(self) -> None:
        """Free the client, but only once, because PyBullet gives its number to the next client."""
        if self._made and not self._closed and self.engine.isConnected():
            self._disconnect(self.client)
        self._closed = True

    def _disconnect(self, client: int) -> None:
        (opengl.disconnect if self.opengl else pybullet.disconnect)(client)

    def __reduce__(self) -> tuple[Any, ...]:
        """Arguments and state from which `copy` and `pickle` make the world again."""
        if self.opengl:
            raise TypeError('worlds of sensing.renderer "egl" cannot be copied: OpenGL would mix up their bodies')
        engine = None
        if self._made and not self._closed:
            with TemporaryDirectory() as folder:
                path = Path(folder, "world.bullet")
                self.engine.saveBullet(str(path))
                engine = path.read_bytes()
        return World, self._origin, ({name: vars(self)[name] for name in _STATE}, engine)

    def __setstate__(self, given: tuple[dict[str, Any], bytes | None]) -> None:
        """Restore the state of a world with the same scenario and forest, and that of its client, if it has one."""
        state, engine = given
        if state["_closed"]:
            self.close()
        vars(self).update(state)
        if engine is not None:
            with TemporaryDirectory() as folder:
                path = Path(folder, "world.bullet")
                path.write_bytes(engine)
                self.engine.restoreState(fileName=str(path))

    def __enter__(self) -> "World":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _state(self, body: Body) -> Array:
        """State (13,) of a body: position m, quaternion, velocity m/s and spin rad/s."""
        position, quaternion = self.engine.getBasePositionAndOrientation(body.id)
        velocity, spin = self.engine.getBaseVelocity(body.id)
        return np.array(position + quaternion + velocity + spin)

    def _apply_forces(self, uav: int, state: Array, target: Array, wind: Array | None) -> None:
        """Apply the forces of the rotors and of the wind to a UAV in a state (13,).

        target (3,): velocity east and north m/s, altitude m.
        """
        body = self._bodies.uavs[uav]
        if wind is None:
            given = rotor_thrusts(state, target, _CALM)
        else:
            given, self._memories[uav] = steady_thrusts(state, target, self._memories[uav], self._dt)
            force = drag(state[_VELOCITY], wind).tolist()
            self.engine.applyExternalForce(body.id, -1, force, state[:3].tolist(), pybullet.WORLD_FRAME)
        *thrusts, yaw = given.tolist()
        for thrust, rotor in zip(thrusts, _ROTORS, strict=True):
            self.engine.applyExternalForce(body.id, -1, (0.0, 0.0, thrust), rotor, pybullet.LINK_FRAME)
        self.engine.applyExternalTorque(body.id, -1, (0.0, 0.0, yaw), pybullet.LINK_FRAME)

    def _redo_attitude(self, body: Body, before: Array) -> None:
        """Replace the engine's attitude after a step, whose bits depend on the processor; before (4,): quaternion."""
        position, _ = self.engine.getBasePositionAndOrientation(body.id)
        velocity, spin = self.engine.getBaseVelocity(body.id)
        quaternion = rotate(before, np.array(spin), self._dt)
        self.engine.resetBasePositionAndOrientation(body.id, position, quaternion.tolist())
        self.engine.resetBaseVelocity(body.id, velocity, spin)

    def _touch(self) -> None:
        """Note the contacts that the engine found, which has a margin of 2 cm."""
        for _, a, b, *_ in self.engine.getContactPoints():
            pair = sorted((self._bodies.names[a], self._bodies.names[b]), key=lambda name: (name[0] != "uav", name[1]))
            self._touched.add(Contact(pair[0][1], *pair[1]))

    def _apart(self, commands: Array, steps: int) -> bool:
        """True if UAVs stay clear of one another during these steps."""
        return nearest_approach(self._positions, commands, steps / self._scenario.rates.physics) > _CLEAR

    def _glide(self, commands: Array, steps: int) -> None:
        """Move UAVs by [Li22] eq. (5); at zero velocity the heading is kept."""
        self._positions, self._quaternions = glide(self._positions, self._quaternions, commands, self._dt, steps)
        self._commands = commands
        if self._made:
            self._put_uavs(self._bodies)

    def _put_uavs(self, bodies: Bodies) -> None:
        """Put UAVs at `_positions`: the present ones of kinematic UAVs, and the starts of quadrotors."""
        rows = (bodies.uavs, self._positions.tolist(), self._quaternions.tolist(), self._commands.tolist())
        for body, position, quaternion, command in zip(*rows, strict=True):
            bodies.engine.resetBasePositionAndOrientation(body.id, position, quaternion)
            bodies.engine.resetBaseVelocity(body.id, (*command, 0.0), (0.0, 0.0, 0.0))


def _put_people(bodies: Bodies, centres: Array, headings: Array) -> None:
    """Put people on the ground below centres (M, 3) m, NaN if absent, with headings (M,) rad."""
    for body, (x, y, _), heading in zip(bodies.people, centres.tolist(), headings.tolist(), strict=True):
        place = AWAY if math.isnan(x) else (x, y, 0.0)
        yaw = 0.0 if math.isnan(heading) else heading
        turned = (0.0, 0.0, sin(yaw / 2), cos(yaw / 2))
        bodies.engine.resetBasePositionAndOrientation(body.id, place, turned)


_STATE = ("_positions", "_quaternions", "_commands", "_people_centres", "_headings", "_memories", "_touched", "_closed")


_ROTORS: list[list[float]] = ROTORS.tolist()
_CALM = np.zeros(3)
_QUATERNION, _VELOCITY = slice(3, 7), slice(7, 10)  # in the state of a body
