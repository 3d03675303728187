"""The physical world: ground, trees, people and quadrotors, in a PyBullet client if one is needed."""

import math
from collections.abc import Sequence
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.scenario.scenario import Scenario
from sim.world import opengl
from sim.world.appearance import sample_appearance
from sim.world.bodies import AWAY, Bodies, Body, BodyModel, Placed, list_models, order_solids
from sim.world.contacts import Contact
from sim.world.engine import Engine, pybullet
from sim.world.free_flight import fly_while_clear, glide_while_clear, move_kinematic, wrenches
from sim.world.lens_images import straighten
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.quaternions import level_attitude, rotate, settle
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array


class World:
    """Ground, trees, people and quadrotors, with the clients of the engine that they need, which the world owns.

    `bodies` lists canopies, trunks, people and UAVs, each in the order of the forest, the people and the scenario, and
    `solids` the parts of trees in the same order; `centres` gives their positions. Trees stand still, people are
    placed, and UAVs follow velocity commands.
    `states` (n, 13) has the UAVs' positions m, quaternions xyzw, velocities m/s and spins rad/s.
    If the scenario varies the appearance, it is decided by the seed, and the noise of images by seed and repeat.
    Except with OpenGL, a world can be copied and pickled; the copy has its own clients in the same state.
    The engine moves UAVs only when one is near another body, and the client is made only then, or for OpenGL, which
    draws its bodies.
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
        """Build the world.

        Args:
            scenario: Fleet, dynamics, rates and appearance.
            forest: The trees.
            people: Number of people; they are absent until they are placed.
            seed: Decides the appearance.
            repeat: Decides the noise of images, together with the seed.
            client: The engine's client, such as one with a window; by default a new one.
        """
        self.opengl = client is None and scenario.sensing.renders and scenario.sensing.renderer == "egl"
        self.style = sample_appearance(scenario, seed, trees=len(forest.trees), people=people, repeat=repeat)
        self._scenario = scenario
        self._dt = 1.0 / scenario.rates.physics  # s, of the engine
        self._origin = scenario, forest, people, seed, repeat
        self.trees = forest.trees
        self._given = client
        uavs = scenario.uavs
        self.states = np.array([(*uav.start, uav.altitude, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0) for uav in uavs], dtype=float)
        self._altitudes = self.states[:, 2].copy()
        self._solids = order_solids(forest)
        self.solids = tuple(solid for solid, _ in self._solids)
        centres = [(s.x, s.y, (s.bottom + s.top) / 2) for s in self.solids]
        self._tree_centres = np.array(centres, dtype=float).reshape(-1, 3)
        self._people_centres = np.full((people, 3), np.nan)
        self._headings = np.zeros(people)
        self._memories = np.zeros((len(uavs), 3))  # m/s², memories of `steady_thrusts`
        self._touched: set[Contact] = set()
        self._closed = False
        self._top = max(2 * TARGET_HEIGHT, *(s.top for s in self.solids), 0.0)  # m, of trees and people
        self._kinematic = scenario.dynamics == "kinematic"
        if client is not None or self.opengl:
            _ = self._bodies

    @property
    def client(self) -> int:
        """The engine's client."""
        return self._bodies.client

    @property
    def engine(self) -> Engine:
        """The engine's functions for the client."""
        return self._bodies.engine

    @cached_property
    def models(self) -> tuple[BodyModel, ...]:
        """What renderers know of the bodies, in their order."""
        return list_models(self._scenario, self._solids, self.style)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Parts of trees, people and UAVs."""
        return self._bodies.all

    @cached_property
    def _bodies(self) -> Bodies:
        """Bodies and the client that holds them. The first use makes them, at the places of that moment."""
        client = self._given
        if client is None:
            largest = max(max(straighten(uav.true_camera).straight.size) for uav in self._scenario.uavs)
            client = opengl.connect(largest, self.trees) if self.opengl else pybullet.connect(pybullet.DIRECT)
        try:
            made = Bodies(client, self._scenario, self.models, opengl=self.opengl, drawn=self._given is not None)
            self._put_uavs(made)
            self._put_people(made)
        except BaseException:
            self._disconnect(client)
            raise
        return made

    @property
    def people_by_id(self) -> NDArray[np.int32]:
        """The person of each id in the client, -1 for others and, by wrapping, for the background."""
        return self._bodies.people_by_id

    def find_place(self, k: int) -> Placed:
        """Where body k is."""
        model = self.models[k]
        if model.kind == "uav":
            state = self.states[model.index].tolist()
            return state[_POSITION], state[_QUATERNION]
        if model.kind != "person":
            return model.place, level_attitude(0.0)
        x, y, _ = self._people_centres[model.index].tolist()
        yaw = float(self._headings[model.index])
        yaw = 0.0 if math.isnan(yaw) else yaw
        return AWAY if math.isnan(x) else (x, y, 0.0), level_attitude(yaw)

    @property
    def _made(self) -> bool:
        return "_bodies" in vars(self)

    @property
    def centres(self) -> Array:
        """Centres (B, 3) m of the spheres around `bodies`; NaN for absent people."""
        return np.vstack([self._tree_centres, self._people_centres, self.states[:, _POSITION]])

    @property
    def people(self) -> tuple[Array, Array]:
        """Positions (M, 2) m and headings (M,) rad of people, as `place_people` takes them."""
        return self._people_centres[:, :2].copy(), self._headings

    def place_people(self, positions: Array, headings: Array) -> None:
        """Put people at positions (M, 2) m with headings (M,) rad from east; NaN means absent."""
        self._people_centres[:, :2] = positions
        self._people_centres[:, 2] = 0.0 * positions[:, 0] + TARGET_HEIGHT  # NaN if absent
        self._headings = headings
        if self._made:
            self._put_people(self._bodies)

    def place_uavs(self, poses: Sequence[Pose]) -> None:
        """Put each UAV at a recorded pose of its body, without a change of its velocity."""
        self.states[:, _POSITION] = [pose.position for pose in poses]
        self.states[:, _QUATERNION] = [pose.quaternion for pose in poses]
        if self._made:
            self._put_uavs(self._bodies)

    def poses(self) -> list[Pose]:
        """Poses of the UAVs' bodies; axes: x forward (east at yaw 0), y left, z up."""
        rows = self.states[:, _POSITION].copy(), settle(self.states[:, _QUATERNION])
        return [Pose(*pose) for pose in zip(*rows, strict=True)]

    def velocities(self) -> Array:
        """Velocities of the UAVs (n, 3) m/s."""
        return self.states[:, _VELOCITY].copy()

    def spins(self) -> Array:
        """Angular velocities of the UAVs (n, 3) rad/s, about the axes of the world."""
        return self.states[:, _SPIN].copy()

    def advance(
        self, commands: Array, steps: int, winds: Array | None = None, altitude_errors: Array | None = None
    ) -> None:
        """Advance by physics steps, as by so many calls of `step`; winds (steps, 2) m/s.

        The engine makes only those steps before which a UAV is near another body.
        """
        done = 0
        while done < steps:
            if self._kinematic:
                done += glide_while_clear(self.states, commands, self._dt, steps - done, self._top)
            else:
                air = np.zeros((steps - done, 2)) if winds is None else winds[done:]
                targets, calm = self._make_targets(commands, altitude_errors), winds is None
                done += fly_while_clear(self.states, targets, self._memories, air, calm, self._dt, self._top)
            if done < steps:
                self.step(commands, None if winds is None else winds[done], altitude_errors)
                done += 1
        if self._made:
            self._put_uavs(self._bodies)

    def step(self, commands: Array, wind: Array | None = None, altitude_errors: Array | None = None) -> None:
        """Advance by one physics step of the engine under velocity commands (n, 2) m/s, east and north.

        wind (2,) m/s, east and north, pushes quadrotors, which hold against it; None means no air resistance.
        altitude_errors (n,) m: of the altitudes that the control of each UAV believes; None means no errors.
        """
        bodies = self._bodies
        if self._kinematic:
            self.states = move_kinematic(self.states, commands, self._dt, True)
            self._put_uavs(bodies)
            self.engine.performCollisionDetection()
            self._note_contacts()
            return
        self._put_uavs(bodies)
        targets = self._make_targets(commands, altitude_errors)
        calm = wind is None
        given = wrenches(self.states, targets, self._memories, _CALM if wind is None else wind, calm, self._dt)
        for body, state, wrench in zip(bodies.uavs, self.states.tolist(), given.tolist(), strict=True):
            self.engine.applyExternalForce(body.id, -1, wrench[:3], state[_POSITION], pybullet.WORLD_FRAME)
            self.engine.applyExternalTorque(body.id, -1, wrench[3:], pybullet.WORLD_FRAME)
        self.engine.stepSimulation()
        for body, state in zip(bodies.uavs, self.states, strict=True):
            before = settle(state[None, _QUATERNION])[0]
            state[_POSITION], _ = self.engine.getBasePositionAndOrientation(body.id)
            state[_VELOCITY], state[_SPIN] = self.engine.getBaseVelocity(body.id)
            # The bits of the engine's own attitude depend on the processor.
            state[_QUATERNION] = rotate(before, state[_SPIN], self._dt)
        self._put_uavs(bodies)
        self._note_contacts()

    def take_contacts(self) -> tuple[Contact, ...]:
        """Contacts of UAVs since the last call, sorted; a contact of two UAVs is listed once, for the first."""
        taken = tuple(sorted(self._touched))
        self._touched = set()
        return taken

    def close(self) -> None:
        """Free the client. A second call does nothing: by then PyBullet may have given the number to another client."""
        if not self._closed:
            if self._made and self.engine.isConnected():
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
        return World, self._origin, (deepcopy({name: vars(self)[name] for name in _STATE}), engine)

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

    def _make_targets(self, commands: Array, altitude_errors: Array | None) -> Array:
        """Velocities m/s east and north, and altitudes m (n, 3) that quadrotors are to reach."""
        altitudes = self._altitudes if altitude_errors is None else self._altitudes - altitude_errors
        return np.column_stack([commands, altitudes])

    def _note_contacts(self) -> None:
        """Note the contacts that the engine found, which has a margin of 2 cm."""
        for _, a, b, *_ in self.engine.getContactPoints():
            pair = sorted((self._bodies.names[a], self._bodies.names[b]), key=lambda name: (name[0] != "uav", name[1]))
            self._touched.add(Contact(pair[0][1], *pair[1]))

    def _put_people(self, bodies: Bodies) -> None:
        """Put people where they are; absent ones are away."""
        first = len(self.solids)
        for m, body in enumerate(bodies.people):
            bodies.engine.resetBasePositionAndOrientation(body.id, *self.find_place(first + m))

    def _put_uavs(self, bodies: Bodies) -> None:
        """Put UAVs into their `states`."""
        for body, state in zip(bodies.uavs, self.states.tolist(), strict=True):
            bodies.engine.resetBasePositionAndOrientation(body.id, state[_POSITION], state[_QUATERNION])
            bodies.engine.resetBaseVelocity(body.id, state[_VELOCITY], state[_SPIN])


_STATE = ("states", "_people_centres", "_headings", "_memories", "_touched", "_closed")


_CALM = np.zeros(2)
_POSITION, _QUATERNION, _VELOCITY, _SPIN = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)  # in `states`
