"""What cameras have in view, in a client of the engine that draws and does not move anything."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim.world.bodies import BodyModel, Placed, add_mesh, empty_people_by_id, paint
from sim.world.engine import Engine
from tracking.numerics.arrays import Flags

_KEPT = 25  # frames of each camera for which a body stays although none shows it


class ShownBodies:
    """The bodies that cameras show or lately showed, in one client; an image takes longer with each body in it."""

    def __init__(self, client: int, models: tuple[BodyModel, ...], moving: int, cameras: int) -> None:
        """Begin without bodies. The last `moving` of the `models` are people and UAVs; so many `cameras` take turns."""
        self.client = client
        self._engine = Engine(client)
        self._models = models
        self._cameras = cameras
        self._first = len(models) - moving  # of those that move
        self._meshes: dict[object, int] = {}
        self._ids = np.full(len(models), -1)  # -1 for a body that is not there
        self._shown = np.zeros(len(models), dtype=np.bool_)
        self._seen = np.zeros(len(models), dtype=np.int64)  # frame that last showed each body
        self._frames = 0
        self.people_by_id = empty_people_by_id(models)

    def show(self, wanted: Flags, place: Callable[[int], Placed]) -> None:
        """Show bodies (B,) and no others; `place` gives the pose of each body that moves, people first."""
        self._frames += 1
        if self._frames % (_KEPT * self._cameras) == 0:
            self._remove(np.flatnonzero((self._ids >= 0) & (self._seen <= self._frames - _KEPT * self._cameras)))
        self._seen[wanted] = self._frames
        for k in np.flatnonzero(wanted & (self._ids < 0)).tolist():
            self._add(k)
        for k in np.flatnonzero(wanted != self._shown).tolist():
            # The rasteriser skips fully transparent bodies at once.
            paint(self._engine, int(self._ids[k]), self._models[k], alpha=float(wanted[k]))
        self._shown = wanted.copy()
        for m in np.flatnonzero(wanted[self._first :]).tolist():
            self._engine.resetBasePositionAndOrientation(int(self._ids[self._first + m]), *place(m))

    def _add(self, k: int) -> None:
        model = self._models[k]
        if model.shape not in self._meshes:
            self._meshes[model.shape] = add_mesh(self._engine, model)
        self._ids[k] = self._engine.createMultiBody(0.0, -1, self._meshes[model.shape], model.place)
        self.people_by_id[self._ids[k]] = k - self._first if model.kind == "person" else -1

    def _remove(self, bodies: NDArray[np.int64]) -> None:
        for k in bodies.tolist():
            self._engine.removeBody(int(self._ids[k]))
        self._ids[bodies] = -1
        self._shown[bodies] = False
