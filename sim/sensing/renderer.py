"""Rendered images of the world by one of PyBullet's renderers, with the ground drawn behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.sensing.culling import FAR, NEAR, in_frustum, people_hidden, trunks_hidden
from sim.sensing.ground import Ground
from sim.world.appearance import AMBIENT, DIFFUSE, LIGHT
from sim.world.engine import pybullet
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.numerics.arrays import Array
from tracking.numerics.matrices import applied
from tracking.numerics.trigonometry import tan

_LIGHT: dict[str, Any] = {
    "lightDirection": LIGHT,
    "lightColor": (1.0, 1.0, 1.0),
    "lightDistance": 100.0,
    "lightAmbientCoeff": AMBIENT,
    "lightDiffuseCoeff": DIFFUSE,
    "lightSpecularCoeff": 0.0,
    "shadow": 0,
}


@dataclass(frozen=True, eq=False)
class Rendered:
    """An image and its mask of people, which is ground truth for recordings and tests alone."""

    image: NDArray[np.uint8]  # (P, P, 3) RGB
    people: NDArray[np.int32]  # (P, P) index of the person at each pixel, -1 elsewhere


class Renderer:
    """Renders one world; it alone sets the visibility of the world's bodies.

    Cameras of several resolutions share it: the engine allocates anew at each change of size, which costs a frame 2 %
    or less (docs/results/benchmarks.md), no more than a client for each would.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._style = world.style
        self._light = {**_LIGHT, "lightDirection": self._style.light, "lightAmbientCoeff": self._style.ambient}
        self._trees = np.array([astuple(tree) for tree in world.trees], dtype=float).reshape(-1, 6)
        self._radii = np.array([body.radius for body in world.bodies])
        self._shown = np.ones(len(world.bodies), dtype=np.bool_)
        # One more element than there are ids: the background's -1 then finds the last one.
        self._people = np.full(max(body.id for body in world.bodies) + 2, -1, dtype=np.int32)
        people = [body.id for body in world.bodies if body.kind == "person"]
        self._people[people] = np.arange(len(people))
        self._ground = Ground(self._style.ground_tint, self._style.ground_place)

    def take(self, uav: int, time: float, camera: Camera, pose: Pose) -> Rendered:
        """The frame that a UAV's camera delivers at a time [s]: the view with the camera's own faults."""
        view = self.render(camera, pose)
        return Rendered(self._style.develop(view.image, uav, time), view.people)

    def render(self, camera: Camera, pose: Pose) -> Rendered:
        """The view of a camera at a pose."""
        if not self._world.opengl:  # which cannot hide single bodies
            self._show(self.in_view(camera, pose))
        image, _, bodies = capture(self._world.client, camera, pose, light=self._light, opengl=self._world.opengl)
        self._ground.draw(image, bodies, camera, pose)
        return Rendered(image, np.take(self._people, bodies, mode="wrap"))

    def in_view(self, camera: Camera, pose: Pose) -> NDArray[np.bool_]:
        """Mask (B,) of the world's bodies that may show in the image."""
        centres, position = self._world.centres, pose.position
        seen = in_frustum(centres, self._radii, position, pose.rotation, camera.fov)
        trees, people = len(self._trees), np.max(self._people) + 1
        seen[trees : 2 * trees] &= ~trunks_hidden(self._trees, position, camera.fov)
        of_people = slice(2 * trees, 2 * trees + people)
        seen[of_people] &= ~people_hidden(centres[of_people, :2], self._trees, position, camera.fov)
        return seen

    def _show(self, wanted: NDArray[np.bool_]) -> None:
        """Show or hide bodies; the rasteriser skips, before any work, what is wholly transparent."""
        for k in np.flatnonzero(wanted != self._shown).tolist():
            body = self._world.bodies[k]
            colour = (*body.tint, float(wanted[k]))
            pybullet.changeVisualShape(body.id, -1, rgbaColor=colour, physicsClientId=self._world.client)
        self._shown = wanted


def capture(
    client: int, camera: Camera, pose: Pose, *, light: Mapping[str, Any] = _LIGHT, opengl: bool = False
) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
    """Raw view of a client: RGB (P, P, 3), depth buffer (P, P) and body ids (P, P), -1 for the background.

    The depth buffer b belongs to the depth FAR NEAR / (FAR - (FAR - NEAR) b) along the optical axis.
    """
    rotation, position = pose.rotation, pose.position
    view = np.eye(4)
    view[:3, :3] = rotation.T
    view[:3, 3] = -applied(rotation.T, position)
    _, _, rgba, depth, bodies = pybullet.getCameraImage(
        camera.pixels,
        camera.pixels,
        viewMatrix=view.ravel(order="F").tolist(),
        projectionMatrix=_projection(camera, 0.0 if opengl else 0.5).ravel(order="F").tolist(),
        renderer=pybullet.ER_BULLET_HARDWARE_OPENGL if opengl else pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
        **light,
    )
    return np.asarray(cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB), dtype=np.uint8), depth, bodies


def _projection(camera: Camera, shift: float) -> Array:
    """OpenGL projection (4, 4), shifted by half a pixel for TinyRenderer, which samples pixels at their corners."""
    scale = 1.0 / tan(camera.fov / 2)
    projection = np.zeros((4, 4))
    projection[0, 0] = projection[1, 1] = scale
    projection[0, 2] = projection[1, 2] = 2.0 * shift / camera.pixels
    projection[2, 2] = -(FAR + NEAR) / (FAR - NEAR)
    projection[2, 3] = -2 * FAR * NEAR / (FAR - NEAR)
    projection[3, 2] = -1.0
    return projection
