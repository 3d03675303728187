"""Bodies of a world in the engine: ground, trees, people and quadrotors."""

import colorsys
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sim.installation import ASSETS
from sim.scenario.scenario import Scenario
from sim.world.appearance import AppearanceSample
from sim.world.engine import Engine, pybullet
from sim.world.quadrotor import GRAVITY
from tracking.geometry.visibility import TARGET_HEIGHT, Tree
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import hypot

AWAY = (0.0, 0.0, -1000.0)  # position of absent people: far below everything
_PERSON_RADIUS = 0.25  # m, of the solid body
_WHITE = (1.0, 1.0, 1.0)
_GOLDEN = (math.sqrt(5.0) - 1) / 2


@dataclass(frozen=True)
class Body:
    """A PyBullet body with the properties that renderers need."""

    id: int
    kind: Literal["canopy", "trunk", "person", "uav"]
    tint: tuple[float, float, float]  # multiplies the texture's red, green and blue
    radius: float  # m, of a sphere around the body's centre that encloses it


class Bodies:
    """Ground, trees, people and quadrotors in one client of the engine."""

    def __init__(
        self, client: int, scenario: Scenario, trees: tuple[Tree, ...], style: AppearanceSample, *, opengl: bool
    ) -> None:
        """Make all bodies; people are absent at first, and UAVs are at their starts."""
        self.client, self.engine, self.style, self.opengl = client, Engine(client), style, opengl
        self.engine.setGravity(0.0, 0.0, -GRAVITY)
        self.engine.setTimeStep(1.0 / scenario.rates.physics)
        self.engine.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        ground = self._add_ground()
        planted = self._add_trees(trees)
        self.people = self._add_people(len(style.clothes))
        self.uavs = [self._add_uav(*uav.start, uav.altitude) for uav in scenario.uavs]
        self.all: tuple[Body, ...] = (*planted, *self.people, *self.uavs)
        self.names = {ground: ("ground", 0)}  # kind, and index among its kind, of each body
        for kind in ("canopy", "trunk", "person", "uav"):
            ids = [body.id for body in self.all if body.kind == kind]
            self.names.update({id_: (kind, k) for k, id_ in enumerate(ids)})

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
        # PyBullet gives a plane without a visual shape a chequered one, at which OpenGL fails: so a speck far below.
        speck = {"radius": 1e-3, "visualFramePosition": AWAY}
        visual = self.engine.createVisualShape(pybullet.GEOM_SPHERE, **speck) if self.opengl else -1
        ground = self._fixed(plane, visual, (0.0, 0.0, 0.0))
        self.engine.changeVisualShape(ground, -1, rgbaColor=(0.0, 0.0, 0.0, 0.0))
        return ground

    def _add_trees(self, trees: tuple[Tree, ...]) -> list[Body]:
        """Canopies, then trunks; trees of equal size share their shapes."""
        shapes: dict[tuple[str, float, float], tuple[int, int]] = {}
        bodies = []
        for kind in ("canopy", "trunk"):
            for k, tree in enumerate(trees):
                canopy = kind == "canopy"
                base, top = (tree.canopy_base, tree.canopy_top) if canopy else (0.0, tree.canopy_base)
                radius, height = tree.canopy_radius if canopy else tree.trunk_radius, top - base
                key = (kind, radius, height)
                if key not in shapes:
                    shapes[key] = (self._cylinder(radius, height), self._mesh(kind, (radius, radius, height)))
                id_ = self._fixed(*shapes[key], (tree.x, tree.y, base))
                sphere = hypot(1.01 * radius, height / 2)
                tint = _multiply(_foliage(k), self.style.canopies[k]) if canopy else _WHITE
                bodies.append(self._paint(Body(id_, "canopy" if canopy else "trunk", tint, sphere)))
        return bodies

    def _add_people(self, count: int) -> list[Body]:
        if count == 0:
            return []
        mesh = self._mesh("person", (1.0, 1.0, 1.0))
        solid = self._cylinder(_PERSON_RADIUS, 2 * TARGET_HEIGHT)
        ids = [self._fixed(solid, mesh, AWAY) for _ in range(count)]
        return [
            self._paint(Body(id_, "person", _multiply(_WHITE, tint), 1.1))
            for id_, tint in zip(ids, self.style.clothes, strict=True)
        ]

    def _add_uav(self, x: float, y: float, z: float) -> Body:
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        id_ = self.engine.loadURDF(str(ASSETS / "quadrotor.urdf"), (x, y, z), flags=flags)
        self.engine.changeDynamics(id_, -1, linearDamping=0.0, angularDamping=0.0)
        return self._paint(Body(id_, "uav", _WHITE, 0.45))


def _foliage(k: int) -> tuple[float, float, float]:
    """Tint of the k-th tree; hues and shades are spread evenly over the forest, not at random."""
    spread = (k * _GOLDEN) % 1.0
    return colorsys.hsv_to_rgb(0.16 + 0.14 * spread, 0.22, 0.82 + 0.18 * ((7 * spread) % 1.0))


def _multiply(tint: tuple[float, float, float], factors: Array) -> tuple[float, float, float]:
    red, green, blue = (np.array(tint) * factors).tolist()
    return red, green, blue
