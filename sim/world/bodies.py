"""Bodies of a world in the engine: ground, trees, people and quadrotors."""

import colorsys
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from sim.installation import ASSETS
from sim.scenario.scenario import Scenario
from sim.world.appearance import AppearanceSample
from sim.world.engine import Engine, pybullet
from sim.world.leaves import Leaves
from sim.world.quadrotor import GRAVITY
from tracking.geometry.person import ENCLOSING_RADIUS, PERSON_HEIGHT, PERSON_RADIUS
from tracking.geometry.visibility import PARTS, Forest, Part, Solid
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.trigonometry import hypot

AWAY = (0.0, 0.0, -1000.0)  # position of absent people: far below everything
_WHITE = (1.0, 1.0, 1.0)
_UNIT = (1.0, 1.0, 1.0)
_MESHES = {"uav": "quadrotor"}  # where a mesh has another name than its kind
_FOLIAGE = np.array([70.0, 96.0, 46.0]) / 255  # mean colour of the texture of closed crowns
_GOLDEN = (math.sqrt(5.0) - 1) / 2


Placed = tuple[Sequence[float], Sequence[float]]  # position m and quaternion xyzw, as given to the engine


@dataclass(frozen=True)
class BodyModel:
    """What renderers know of a body."""

    kind: Part | Literal["person", "uav"]
    index: int  # of the tree, person or UAV
    tint: tuple[float, float, float]  # multiplies the texture's red, green and blue
    radius: float  # m, of a sphere around the body's centre that encloses it
    scale: tuple[float, float, float]  # of the mesh of this kind
    place: tuple[float, float, float]  # m, where a tree stands; people are away and UAVs at their starts at first
    leaves: Leaves | None = None  # of a porous solid, in place of the mesh

    @property
    def shape(self) -> object:
        """What bodies with the same visual shape have in common."""
        return self.leaves or (self.kind, self.scale)


@dataclass(frozen=True)
class Body(BodyModel):
    """A body in the engine."""

    id: int = field(kw_only=True)


def order_solids(forest: Forest) -> tuple[tuple[Solid, int], ...]:
    """The solids of a forest, each with the index of its tree, in the order of bodies: the highest parts come first."""
    found = zip(forest.solids, forest.tree_of_solids.tolist(), strict=True)
    return tuple(sorted(found, key=lambda pair: -PARTS.index(pair[0].part)))


def list_models(
    scenario: Scenario, solids: Sequence[tuple[Solid, int]], style: AppearanceSample
) -> tuple[BodyModel, ...]:
    """Parts of trees as in `order_solids`, people and UAVs, the latter two in the order of people and scenario."""
    models = []
    for n, (solid, tree) in enumerate(solids):
        size = solid.radius
        height = solid.top - solid.bottom
        leaves = Leaves(style.seed, n, solid) if solid.is_porous else None
        wider = leaves.reach if leaves else 0.01 * size
        tint = _WHITE if solid.part == "trunk" else _multiply(_tint_tree(tree), style.canopies[tree])
        place = (solid.x, solid.y, solid.bottom)
        sphere = hypot(size + wider, height / 2 + wider)
        models.append(BodyModel(solid.part, tree, tint, sphere, (size, size, height), place, leaves))
    for m, shade in enumerate(style.clothes):
        models.append(BodyModel("person", m, _multiply(_WHITE, shade), ENCLOSING_RADIUS, _UNIT, AWAY))
    for i, uav in enumerate(scenario.uavs):
        models.append(BodyModel("uav", i, _WHITE, 0.45, _UNIT, (*uav.start, uav.altitude)))
    return tuple(models)


def _add_mesh(engine: Engine, model: BodyModel) -> int:
    """Id of a new visual shape in the engine."""
    if model.leaves:
        return _add_leaves(engine, model.leaves)
    path = str(ASSETS / "meshes" / mesh_file(model.kind))
    return int(engine.createVisualShape(pybullet.GEOM_MESH, fileName=path, meshScale=model.scale))


def mesh_file(kind: str) -> str:
    """Name of the file with the mesh of a kind of body."""
    return f"{_MESHES.get(kind, kind)}.obj"


def list_triangles(leaves: Leaves) -> tuple[Array, Indices, Array]:
    """Corners (N, 3) m of leaves, their triangles (F, 3), and normals (N, 3); without any, of a cluster of no size."""
    corners = leaves.draw()
    corners = corners if len(corners) else np.zeros((1, 4, 3))
    # Normals along an axis keep their bits (see `assets.mesh`): that nearest to the cluster's own, seen from above.
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    normals = np.where(normals[:, 2:] < 0, -normals, normals)
    axes = np.argmax(np.abs(normals), axis=1)
    normals = np.sign(normals) * np.eye(3)[axes]
    # The engine draws triangles only where they turn anticlockwise, and clusters show from both sides.
    both = np.array([0, 1, 2, 0, 2, 3, 0, 2, 1, 0, 3, 2])
    faces = (4 * np.arange(len(corners))[:, None] + both).reshape(-1, 3)
    return corners.reshape(-1, 3), faces, np.repeat(normals, 4, axis=0)


def _add_leaves(engine: Engine, leaves: Leaves) -> int:
    """Id of the visual shape of leaves."""
    corners, faces, normals = list_triangles(leaves)
    return int(
        engine.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=corners.tolist(),
            indices=faces.ravel().tolist(),
            normals=normals.tolist(),
        )
    )


def paint_of(model: BodyModel) -> tuple[float, float, float]:
    """Red, green and blue that multiply a body's texture, which leaves have none of."""
    return model.tint if model.leaves is None else _multiply(model.tint, _FOLIAGE)


class Bodies:
    """Ground, trees, people and quadrotors in one client of the engine."""

    def __init__(
        self, client: int, scenario: Scenario, models: tuple[BodyModel, ...], *, opengl: bool, drawn: bool
    ) -> None:
        """Make all bodies; people are absent, and UAVs at their starts.

        opengl: True if OpenGL draws. drawn: True if images of this client are drawn, so that leaves are needed.
        """
        self._drawn = drawn
        self.client = client
        self.engine = Engine(client)
        self.opengl = opengl
        self.engine.setGravity(0.0, 0.0, -GRAVITY)
        self.engine.setTimeStep(1.0 / scenario.rates.physics)
        self.engine.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        ground = self._add_ground()
        self._shapes: dict[object, tuple[int, int]] = {}
        self.all = tuple(self._add(model) for model in models)
        self.people, self.uavs = ([body for body in self.all if body.kind == kind] for kind in ("person", "uav"))
        self.names = {ground: ("ground", 0)}  # kind of each body, and index of its tree, person or UAV
        self.names.update({body.id: (body.kind, body.index) for body in self.all})
        # The background's id -1 arrives at the end of the table by wrapping.
        self.people_by_id = np.full(2 * len(models) + 2, -1, dtype=np.int32)
        self.people_by_id[[body.id for body in self.people]] = np.arange(len(self.people))

    def _make_cylinder(self, radius: float, height: float) -> int:
        place = (0.0, 0.0, height / 2)
        solid = self.engine.createCollisionShape
        return int(solid(pybullet.GEOM_CYLINDER, radius=radius, height=height, collisionFramePosition=place))

    def _add_ground(self) -> int:
        plane = self.engine.createCollisionShape(pybullet.GEOM_PLANE)
        # PyBullet gives a plane without a visual shape a chequered one, at which OpenGL fails: so a speck far below.
        speck = {"radius": 1e-3, "visualFramePosition": AWAY}
        visual = self.engine.createVisualShape(pybullet.GEOM_SPHERE, **speck) if self.opengl else -1
        ground = int(self.engine.createMultiBody(0.0, plane, visual, (0.0, 0.0, 0.0)))
        self.engine.changeVisualShape(ground, -1, rgbaColor=(0.0, 0.0, 0.0, 0.0))
        return ground

    def _add(self, model: BodyModel) -> Body:
        """Add a body; trees of equal size share their shapes."""
        if model.kind == "uav":
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            id_ = self.engine.loadURDF(str(ASSETS / "quadrotor.urdf"), model.place, flags=flags)
            self.engine.changeDynamics(id_, -1, linearDamping=0.0, angularDamping=0.0)
        else:
            if model.shape not in self._shapes:
                size = (PERSON_RADIUS, PERSON_HEIGHT) if model.kind == "person" else model.scale[1:]
                mesh = _add_mesh(self.engine, model) if self._drawn or model.leaves is None else -1
                self._shapes[model.shape] = self._make_cylinder(*size), mesh
            id_ = int(self.engine.createMultiBody(0.0, *self._shapes[model.shape], model.place))
        self.engine.changeVisualShape(id_, -1, rgbaColor=(*paint_of(model), 1.0))
        return Body(**vars(model), id=id_)


def _tint_tree(k: int) -> tuple[float, float, float]:
    """Tint of the k-th tree; hues and shades are spread evenly over the forest, not at random."""
    spread = (k * _GOLDEN) % 1.0
    return colorsys.hsv_to_rgb(0.16 + 0.14 * spread, 0.22, 0.82 + 0.18 * ((7 * spread) % 1.0))


def _multiply(tint: tuple[float, float, float], factors: Array) -> tuple[float, float, float]:
    red, green, blue = (np.array(tint) * factors).tolist()
    return red, green, blue
