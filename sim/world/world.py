"""The physical world: one PyBullet client with ground, trees, people and quadrotors."""

import colorsys
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from sim.installation import ASSETS
from sim.scenario.scenario import Scenario
from sim.world import opengl
from sim.world.appearance import sample_appearance
from sim.world.contacts import Contact
from sim.world.engine import Engine, pybullet
from sim.world.quadrotor import GRAVITY, ROTORS, drag, rotor_thrusts, steady_thrusts
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest, Tree
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import arctan2, cos, hypot, sin

# Position of absent people: far below everything.
_AWAY = (0.0, 0.0, -1000.0)
_PERSON_RADIUS = 0.25  # m, of the solid body
_WHITE = (1.0, 1.0, 1.0)
_GOLDEN = (math.sqrt(5.0) - 1) / 2


@dataclass(frozen=True)
class Body:
    """A PyBullet body, as renderers need it."""

    id: int
    kind: Literal["canopy", "trunk", "person", "uav"]
    tint: tuple[float, float, float]  # multiplies the texture's red, green and blue
    radius: float  # m, of a sphere round the body's centre that holds all of it


class World:
    """Ground, trees, people and quadrotors in one client, which it owns.

    `bodies` lists canopies, trunks, people and UAVs, each kind in the order of the forest, the people and the
    scenario; `centres` gives their places. Trees stand still, people are placed, UAVs obey velocity commands.
    The seed gives its appearance, if the scenario varies that; the repeat gives the noise of its images.
    It can be copied and pickled, except with OpenGL: the copy has a client of its own in the same state.
    """

    def __init__(
        self,
        scenario: Scenario,
        forest: Forest,
        people: int,
        seed: int = 0,
        client: int | None = None,
        *,
        repeat: int = 0,
    ) -> None:
        """`client` is the engine's client to build in, such as one with a window; without it a new one."""
        self.opengl = client is None and scenario.sensing.renders and scenario.sensing.renderer == "egl"
        self.style = sample_appearance(scenario, seed, trees=len(forest.trees), people=people, repeat=repeat)
        self._scenario = scenario
        self._origin = scenario, forest, people, seed, repeat
        self.trees = forest.trees
        largest = max(uav.pixels for uav in scenario.uavs)
        if client is None:
            client = opengl.connect(largest) if self.opengl else pybullet.connect(pybullet.DIRECT)
        self.client: int = client
        self.engine = Engine(client)
        self.engine.setGravity(0.0, 0.0, -GRAVITY)
        self.engine.setTimeStep(1.0 / scenario.rates.physics)
        self.engine.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        ground = self._add_ground()
        trees = self._add_trees(forest.trees)
        self._people = self._add_people(people)
        self._altitudes = [uav.altitude for uav in scenario.uavs]
        self._uavs = [self._add_uav(*uav.start, z) for uav, z in zip(scenario.uavs, self._altitudes, strict=True)]
        self.bodies: tuple[Body, ...] = (*trees, *self._people, *self._uavs)
        centres = [(t.x, t.y, (t.canopy_base + t.canopy_top) / 2) for t in forest.trees]
        centres += [(t.x, t.y, t.canopy_base / 2) for t in forest.trees]
        self._tree_centres = np.array(centres, dtype=float).reshape(-1, 3)
        self._people_centres = np.full((people, 3), np.nan)
        self._memories = np.zeros((len(self._uavs), 3))  # m/s², of the controllers in wind
        self._names = {ground: ("ground", 0)}  # kind, and index among its kind, of each body
        for kind in ("canopy", "trunk", "person", "uav"):
            ids = [body.id for body in self.bodies if body.kind == kind]
            self._names.update({id_: (kind, k) for k, id_ in enumerate(ids)})
        self._touched: set[Contact] = set()

    @property
    def centres(self) -> Array:
        """Centres (B, 3) m of the spheres round `bodies`; NaN where a person is absent."""
        uavs = [pose.position for pose in self.poses()]
        return np.vstack([self._tree_centres, self._people_centres, uavs])

    def place_people(self, positions: Array, headings: Array) -> None:
        """Put people at positions (M, 2) m, NaN where absent, facing headings (M,) rad from east."""
        self._people_centres[:, :2] = positions
        self._people_centres[:, 2] = np.where(np.isnan(positions[:, 0]), np.nan, TARGET_HEIGHT)
        for body, (x, y), heading in zip(self._people, positions.tolist(), headings.tolist(), strict=True):
            place = _AWAY if math.isnan(x) else (x, y, 0.0)
            self._put(body, place, 0.0 if math.isnan(heading) else heading)

    def place_uavs(self, poses: Sequence[Pose]) -> None:
        """Put each UAV at a recorded pose of its body; its velocity stays."""
        for body, pose in zip(self._uavs, poses, strict=True):
            self.engine.resetBasePositionAndOrientation(body.id, pose.position.tolist(), pose.quaternion.tolist())

    def poses(self) -> list[Pose]:
        """Poses of the UAVs' bodies: x forward, which is east at yaw 0, y left, z up."""
        return [Pose(*map(np.array, self.engine.getBasePositionAndOrientation(body.id))) for body in self._uavs]

    def velocities(self) -> Array:
        """Velocities of the UAVs (n, 3) m/s."""
        return np.array([self.engine.getBaseVelocity(b.id)[0] for b in self._uavs])

    def step(self, commands: Array, wind: Array | None = None) -> None:
        """Advance by one physics step under velocity commands (n, 2) m/s, east and north.

        wind (2,) m/s, east and north, pushes quadrotors, which then hold against it; None: there is no air.
        """
        if self._scenario.dynamics == "kinematic":
            for body, (east, north) in zip(self._uavs, commands.tolist(), strict=True):
                self._glide(body, east, north)
            self.engine.performCollisionDetection()
            self._touch()
            return
        for k, (east, north) in enumerate(commands.tolist()):
            self._thrust(k, np.array([east, north, self._altitudes[k]]), wind)
        self.engine.stepSimulation()
        self._touch()

    def take_contacts(self) -> tuple[Contact, ...]:
        """Contacts of UAVs since the last call, ascending; a contact of two UAVs is listed for the first."""
        taken, self._touched = tuple(sorted(self._touched)), set()
        return taken

    def close(self) -> None:
        """Free the client."""
        if self.engine.isConnected():
            (opengl.disconnect if self.opengl else pybullet.disconnect)(self.client)

    def __reduce__(self) -> tuple[Any, ...]:
        """Recipe by which `copy` and `pickle` make it again."""
        if self.opengl:
            raise TypeError('worlds of sensing.renderer "egl" cannot be copied: OpenGL would mix up their bodies')
        state = None
        if self.engine.isConnected():
            with TemporaryDirectory() as folder:
                path = Path(folder, "world.bullet")
                self.engine.saveBullet(str(path))
                state = path.read_bytes()
        return _made_again, (*self._origin, state, self._memories, self._people_centres, self._touched)

    def restore(self, state: bytes | None, memories: Array, people_centres: Array, touched: set[Contact]) -> None:
        """Take over the state of a world of the same scenario and forest; None: it was closed."""
        self._memories, self._people_centres, self._touched = memories, people_centres, touched
        if state is None:
            self.close()
            return
        with TemporaryDirectory() as folder:
            path = Path(folder, "world.bullet")
            path.write_bytes(state)
            self.engine.restoreState(fileName=str(path))

    def __enter__(self) -> "World":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _thrust(self, uav: int, target: Array, wind: Array | None) -> None:
        """Apply what rotors, towards a target (3,): velocity east and north m/s, altitude m, and the wind give."""
        body = self._uavs[uav]
        position, quaternion = self.engine.getBasePositionAndOrientation(body.id)
        velocity, spin = self.engine.getBaseVelocity(body.id)
        state = np.array(position + quaternion + velocity + spin)
        if wind is None:
            given = rotor_thrusts(state, target, _CALM)
        else:
            given, self._memories[uav] = steady_thrusts(
                state, target, self._memories[uav], 1.0 / self._scenario.rates.physics
            )
            force = drag(state[7:10], wind).tolist()
            self.engine.applyExternalForce(body.id, -1, force, position, pybullet.WORLD_FRAME)
        *thrusts, yaw = given.tolist()
        for thrust, rotor in zip(thrusts, _ROTORS, strict=True):
            self.engine.applyExternalForce(body.id, -1, (0.0, 0.0, thrust), rotor, pybullet.LINK_FRAME)
        self.engine.applyExternalTorque(body.id, -1, (0.0, 0.0, yaw), pybullet.LINK_FRAME)

    def _touch(self) -> None:
        """Note the contacts that the engine found, with its margin of 2 cm."""
        for _, a, b, *_ in self.engine.getContactPoints():
            pair = sorted((self._names[a], self._names[b]), key=lambda name: (name[0] != "uav", name[1]))
            self._touched.add(Contact(pair[0][1], *pair[1]))

    def _glide(self, body: Body, east: float, north: float) -> None:
        """Move one UAV by [Li22] eq. (5); at zero velocity the heading is kept."""
        dt = 1.0 / self._scenario.rates.physics
        (x, y, z), (_, _, s, c) = self.engine.getBasePositionAndOrientation(body.id)
        yaw = arctan2(north, east) if east or north else 2 * arctan2(s, c)
        self._put(body, (x + east * dt, y + north * dt, z), yaw)
        self.engine.resetBaseVelocity(body.id, (east, north, 0.0), (0.0, 0.0, 0.0))

    def _put(self, body: Body, position: tuple[float, float, float], yaw: float) -> None:
        self.engine.resetBasePositionAndOrientation(body.id, position, (0.0, 0.0, sin(yaw / 2), cos(yaw / 2)))

    def _mesh(self, name: str, scale: tuple[float, float, float]) -> int:
        path = str(ASSETS / "meshes" / f"{name}.obj")
        return int(self.engine.createVisualShape(pybullet.GEOM_MESH, fileName=path, meshScale=scale))

    def _cylinder(self, radius: float, height: float) -> int:
        place = (0.0, 0.0, height / 2)
        solid = self.engine.createCollisionShape
        return int(solid(pybullet.GEOM_CYLINDER, radius=radius, height=height, collisionFramePosition=place))

    def _fixed(self, solid: int, mesh: int, position: tuple[float, float, float]) -> int:
        return int(self.engine.createMultiBody(0.0, solid, mesh, position))

    def _paint(self, body: Body) -> Body:
        self.engine.changeVisualShape(body.id, -1, rgbaColor=(*body.tint, 1.0))
        return body

    def _add_ground(self) -> int:
        plane = self.engine.createCollisionShape(pybullet.GEOM_PLANE)
        # A plane without a visual shape is given a chequered one, which OpenGL fails at: there, a speck far below.
        speck = {"radius": 1e-3, "visualFramePosition": _AWAY}
        visual = self.engine.createVisualShape(pybullet.GEOM_SPHERE, **speck) if self.opengl else -1
        ground = self._fixed(plane, visual, (0.0, 0.0, 0.0))
        self.engine.changeVisualShape(ground, -1, rgbaColor=(0.0, 0.0, 0.0, 0.0))
        return ground

    def _add_trees(self, trees: tuple[Tree, ...]) -> list[Body]:
        """Canopies, then trunks; shapes are made once for all trees of equal size."""
        shapes: dict[tuple[str, float, float], tuple[int, int]] = {}
        bodies = []
        if self.opengl and len({(t.canopy_radius, t.canopy_base, t.canopy_top, t.trunk_radius) for t in trees}) > 1:
            raise ValueError("EGL draws trees of one size only")
        for kind in ("canopy", "trunk"):
            for k, tree in enumerate(trees):
                canopy = kind == "canopy"
                base = tree.canopy_base if canopy else 0.0
                height = tree.canopy_top - base if canopy else tree.canopy_base
                radius = tree.canopy_radius if canopy else tree.trunk_radius
                key = (kind, radius, height)
                if key not in shapes:
                    shapes[key] = (self._cylinder(radius, height), self._mesh(kind, (radius, radius, height)))
                id_ = self._fixed(*shapes[key], (tree.x, tree.y, base))
                sphere = hypot(1.01 * radius, height / 2)
                tint = _times(_foliage(k), self.style.canopies[k]) if canopy else _WHITE
                bodies.append(self._paint(Body(id_, "canopy" if canopy else "trunk", tint, sphere)))
        return bodies

    def _add_people(self, count: int) -> list[Body]:
        if count == 0:
            return []
        mesh = self._mesh("person", (1.0, 1.0, 1.0))
        solid = self._cylinder(_PERSON_RADIUS, 2 * TARGET_HEIGHT)
        ids = [self._fixed(solid, mesh, _AWAY) for _ in range(count)]
        return [
            self._paint(Body(id_, "person", _times(_WHITE, tint), 1.1))
            for id_, tint in zip(ids, self.style.clothes, strict=True)
        ]

    def _add_uav(self, x: float, y: float, z: float) -> Body:
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        id_ = self.engine.loadURDF(str(ASSETS / "quadrotor.urdf"), (x, y, z), flags=flags)
        self.engine.changeDynamics(id_, -1, linearDamping=0.0, angularDamping=0.0)
        return self._paint(Body(id_, "uav", _WHITE, 0.45))


def _made_again(scenario: Scenario, forest: Forest, people: int, seed: int, repeat: int, *state: Any) -> World:  # noqa: ANN401 - as `restore` takes it
    made = World(scenario, forest, people, seed, repeat=repeat)
    made.restore(*state)
    return made


_ROTORS: list[list[float]] = ROTORS.tolist()
_CALM = np.zeros(3)


def _foliage(k: int) -> tuple[float, float, float]:
    """Tint of the k-th tree: hues and shades spread evenly over the forest, without chance."""
    spread = (k * _GOLDEN) % 1.0
    red, green, blue = colorsys.hsv_to_rgb(0.16 + 0.14 * spread, 0.22, 0.82 + 0.18 * ((7 * spread) % 1.0))
    return red, green, blue


def _times(tint: tuple[float, float, float], factors: Array) -> tuple[float, float, float]:
    red, green, blue = (np.array(tint) * factors).tolist()
    return red, green, blue
