"""What a camera sees: images of the world by one of PyBullet's renderers, on a ground painted underneath."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from assets import ASSETS
from sim.appearance import AMBIENT, DIFFUSE, LIGHT
from sim.culling import FAR, NEAR, in_frustum, people_hidden, trunks_hidden
from sim.engine import pybullet
from sim.world import World
from tracking.camera import Camera, Pose
from tracking.compiled import Array
from tracking.elementary import tan
from tracking.matrices import applied, product

_TEXELS = 10.0  # of the ground per m
_SKY = np.array([186, 208, 226], dtype=np.uint8)
_HAZE = 0.02  # slope of a downward ray below which the ground is lost in the sky
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
    """An image and, as ground truth for recordings and tests alone, who is where in it."""

    image: NDArray[np.uint8]  # (P, P, 3) RGB
    people: NDArray[np.int32]  # (P, P) index of the person at each pixel, -1 elsewhere


class Renderer:
    """Renders one world; it alone sets the visibility of the world's bodies.

    Cameras of several resolutions share it: the engine allocates anew at each change of size, which costs a frame 2 %
    or less (docs/benchmarks.md), no more than a client for each would.
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
        ground = np.asarray(cv2.imread(str(ASSETS / "meshes" / "ground.png")), dtype=np.uint8)
        tinted = np.clip(np.rint(ground[..., ::-1] * self._style.ground_tint), 0, 255).astype(np.uint8)
        self._ground = np.tile(tinted, (3, 3, 1))

    def take(self, uav: int, time: float, camera: Camera, pose: Pose) -> Rendered:
        """The frame that a UAV's camera delivers at a time [s]: the view with the camera's own faults."""
        view = self.render(camera, pose)
        return Rendered(self._style.develop(view.image, uav, time), view.people)

    def render(self, camera: Camera, pose: Pose) -> Rendered:
        """The view of a camera at a pose."""
        if not self._world.opengl:  # which cannot hide single bodies
            self._show(self.in_view(camera, pose))
        image, _, bodies = capture(self._world.client, camera, pose, light=self._light, opengl=self._world.opengl)
        background = _background(self._ground, self._style.ground_place, camera, pose)
        cv2.copyTo(image, (bodies >= 0).astype(np.uint8), background)
        return Rendered(background, np.take(self._people, bodies, mode="wrap"))

    def in_view(self, camera: Camera, pose: Pose) -> NDArray[np.bool_]:
        """Which of the world's bodies may show in the image (B,)."""
        centres, position = self._world.centres, pose.position
        seen = in_frustum(centres, self._radii, position, pose.rotation, camera.fov)
        trees, people = len(self._trees), np.max(self._people) + 1
        seen[trees : 2 * trees] &= ~trunks_hidden(self._trees, position, camera.fov)
        everyone = slice(2 * trees, 2 * trees + people)
        seen[everyone] &= ~people_hidden(centres[everyone, :2], self._trees, position, camera.fov)
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


def _background(texture: NDArray[np.uint8], place: Array, camera: Camera, pose: Pose) -> NDArray[np.uint8]:
    """Ground plane and sky (P, P, 3) alone; place (2, 3) maps the ground to the texture, both in m."""
    n, focal, position = camera.pixels, camera.focal, pose.position
    # Rows: world components of the ray through the pixel of index (column, row, 1).
    offset = 0.5 - n / 2
    rays = product(pose.rotation, np.array([[1.0, 0.0, offset], [0.0, -1.0, -offset], [0.0, 0.0, -focal]])) / focal
    plane = np.stack(
        [position[0] * rays[2] - position[2] * rays[0], position[1] * rays[2] - position[2] * rays[1], rays[2]]
    )
    plane[:2] = _TEXELS * (product(place[:, :2], plane[:2]) + np.outer(place[:, 2], plane[2]))
    # The texture is three tiles wide: shift by whole tiles until the camera stands over the middle one, because
    # wrapping round its border is slow.
    tile, over = len(texture) // 3, applied(place[:, :2], position[:2]) + place[:, 2]
    plane[:2] -= np.outer(tile * (np.floor(over * _TEXELS / tile) - 1), plane[2])
    ground = cv2.warpPerspective(
        texture, plane, (n, n), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_WRAP
    )
    rise = rays[2, 2] + rays[2, 0] * np.array([0, n, 0, n]) + rays[2, 1] * np.array([0, 0, n, n])
    if np.max(rise) > -_HAZE:
        pixel = np.arange(n)
        ground[rays[2, 2] + rays[2, 0] * pixel + rays[2, 1] * pixel[:, None] > -_HAZE] = _SKY
    return np.asarray(ground, dtype=np.uint8)
