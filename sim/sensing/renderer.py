"""Rendered images of the world: bodies by one of PyBullet's renderers, and the ground drawn behind them."""

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.installation import ASSETS
from sim.sensing.culling import FAR, NEAR, in_frustum, people_hidden, trunks_hidden
from sim.world.appearance import AMBIENT, DIFFUSE, LIGHT
from sim.world.engine import pybullet
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.matrices import applied, product
from tracking.numerics.trigonometry import tan

_TEXELS = 10.0  # per m
_SKY = (186, 208, 226)
_HAZE = 0.02  # slope of a downward ray below which the ground is lost in the sky
# A texel's colours stand in one word, far enough apart for sums of weights that add up to 1024.
_GREEN, _BLUE, _COLOUR = np.uint64(21), np.uint64(42), np.uint64(255)
_HALF = np.uint64(512 | 512 << 21 | 512 << 42)
_NEXT = np.uint64(1)
_FARTHEST = 1e9  # a texture's coordinate beyond which it no longer matters which texel it is


class Ground:
    """A textured plane z = 0 without end; place (2, 3) maps its points to the texture, both in m."""

    def __init__(self, tint: Array, place: Array) -> None:
        """Read the texture; tint (3,) multiplies its red, green and blue."""
        texture = np.asarray(cv2.imread(str(ASSETS / "meshes" / "ground.png")), dtype=np.uint8)[..., ::-1]
        red, green, blue = np.moveaxis(np.clip(np.rint(texture * tint), 0, 255).astype(np.uint64), -1, 0)
        # The first row and column once more at the end: every texel has neighbours below and beside.
        self._texels = np.pad(red | green << _GREEN | blue << _BLUE, (0, 1), mode="wrap")
        self._place = place

    def draw(self, image: NDArray[np.uint8], bodies: NDArray[np.int32], camera: Camera, pose: Pose) -> None:
        """Draw ground and sky into an image (P, P, 3) wherever there is no body: `bodies` (P, P) is negative there."""
        n, focal, position = camera.pixels, camera.focal, pose.position
        # Rows: world components of the ray through the pixel of index (column, row, 1).
        offset = 0.5 - n / 2
        rays = product(pose.rotation, np.array([[1.0, 0.0, offset], [0.0, -1.0, -offset], [0.0, 0.0, -focal]])) / focal
        plane = np.stack(
            [position[0] * rays[2] - position[2] * rays[0], position[1] * rays[2] - position[2] * rays[1], rays[2]]
        )
        plane[:2] = _TEXELS * (product(self._place[:, :2], plane[:2]) + np.outer(self._place[:, 2], plane[2]))
        # Shift by whole tiles until the camera stands over the first: most texels are then found without a division.
        tile, over = len(self._texels) - 1, applied(self._place[:, :2], position[:2]) + self._place[:, 2]
        plane[:2] -= np.outer(tile * np.floor(over * _TEXELS / tile), plane[2])
        _draw(image, bodies, self._texels, plane)


@compiled
def _draw(image: NDArray[np.uint8], bodies: NDArray[np.int32], texels: NDArray[np.uint64], plane: Array) -> None:
    """Interpolate bilinearly with whole weights out of 32 x 32; plane (3, 3) maps pixels to texels, homogeneously."""
    tile, width = len(texels) - 1, image.shape[1]
    ys, xs = np.empty(width, dtype=np.int32), np.empty(width, dtype=np.int32)
    for row in range(image.shape[0]):
        for column in range(width):  # a loop by itself, which is vectorised; right where the ground is seen
            scale = 32.0 / (plane[2, 0] * column + plane[2, 1] * row + plane[2, 2])
            right = (plane[0, 0] * column + plane[0, 1] * row + plane[0, 2]) * scale + 0.5
            down = (plane[1, 0] * column + plane[1, 1] * row + plane[1, 2]) * scale + 0.5
            ys[column] = np.int32(np.floor(min(max(down, -_FARTHEST), _FARTHEST)))
            xs[column] = np.int32(np.floor(min(max(right, -_FARTHEST), _FARTHEST)))
        for column in range(width):
            if bodies[row, column] >= 0:
                continue
            if plane[2, 0] * column + plane[2, 1] * row + plane[2, 2] > -_HAZE:
                image[row, column, 0], image[row, column, 1], image[row, column, 2] = _SKY
                continue
            y, x = np.int64(ys[column]), np.int64(xs[column])
            a, b = np.uint64(y & 31), np.uint64(x & 31)
            i, j = _wrapped(y >> 5, tile), _wrapped(x >> 5, tile)
            # Words wrap round where a difference is negative; the sum is right all the same.
            upper = texels[i, j] * np.uint64(32) + b * (texels[i, j + _NEXT] - texels[i, j])
            lower = texels[i + _NEXT, j] * np.uint64(32) + b * (texels[i + _NEXT, j + _NEXT] - texels[i + _NEXT, j])
            colour = upper * np.uint64(32) + a * (lower - upper) + _HALF
            image[row, column, 0] = colour >> np.uint64(10) & _COLOUR
            image[row, column, 1] = colour >> _GREEN + np.uint64(10) & _COLOUR
            image[row, column, 2] = colour >> _BLUE + np.uint64(10) & _COLOUR


@compiled
def _wrapped(index: np.int64, tile: int) -> np.uint64:
    """Index modulo tile, without a division where it already is; unsigned, which NumPy need not wrap round."""
    return np.uint64(index if 0 <= index < tile else index % tile)


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

    def __getstate__(self) -> dict[str, Any]:
        """State of a copy: its world, a new one, shows all bodies."""
        return {**vars(self), "_shown": np.ones_like(self._shown)}

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

    def in_view(self, camera: Camera, pose: Pose) -> Flags:
        """Mask (B,) of the world's bodies that may show in the image."""
        centres, position = self._world.centres, pose.position
        seen = in_frustum(centres, self._radii, position, pose.rotation, camera.fov)
        trees, people = len(self._trees), np.max(self._people) + 1
        seen[trees : 2 * trees] &= ~trunks_hidden(self._trees, position, camera.fov)
        of_people = slice(2 * trees, 2 * trees + people)
        seen[of_people] &= ~people_hidden(centres[of_people, :2], self._trees, position, camera.fov)
        return seen

    def _show(self, wanted: Flags) -> None:
        """Show or hide bodies; the rasteriser skips, before any work, what is wholly transparent."""
        for k in np.flatnonzero(wanted != self._shown).tolist():
            body = self._world.bodies[k]
            colour = (*body.tint, float(wanted[k]))
            self._world.engine.changeVisualShape(body.id, -1, rgbaColor=colour)
        self._shown = wanted


def capture(
    client: int, camera: Camera, pose: Pose, *, light: Mapping[str, Any] = _LIGHT, opengl: bool = False
) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
    """Raw view of a client: RGB (P, P, 3), depth buffer (P, P) and body ids (P, P), -1 for the background.

    The depth buffer b belongs to the depth far NEAR / (far - (far - NEAR) b) along the optical axis; far is `FAR`, or
    ten times the camera's height above ground if that is more.
    """
    rotation, position = pose.rotation, pose.position
    view = np.eye(4)
    view[:3, :3] = rotation.T
    view[:3, 3] = -applied(rotation.T, position)
    projection = _projection(camera, 0.0 if opengl else 0.5, max(FAR, 10.0 * float(position[2])))
    _, _, rgba, depth, bodies = pybullet.getCameraImage(
        camera.pixels,
        camera.pixels,
        viewMatrix=view.ravel(order="F").tolist(),
        projectionMatrix=projection.ravel(order="F").tolist(),
        renderer=pybullet.ER_BULLET_HARDWARE_OPENGL if opengl else pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
        **light,
    )
    # Where pip compiled PyBullet without NumPy, these are flat tuples.
    size = camera.pixels, camera.pixels
    colours = np.asarray(rgba, dtype=np.uint8).reshape(*size, 4)
    return (
        np.asarray(cv2.cvtColor(colours, cv2.COLOR_RGBA2RGB), dtype=np.uint8),
        np.asarray(depth, dtype=np.float32).reshape(size),
        np.asarray(bodies, dtype=np.int32).reshape(size),
    )


def _projection(camera: Camera, shift: float, far: float) -> Array:
    """OpenGL projection (4, 4) up to the depth `far` m, shifted by half a pixel for TinyRenderer.

    That one samples pixels at their corners.
    """
    scale = 1.0 / tan(camera.fov / 2)
    projection = np.zeros((4, 4))
    projection[0, 0] = projection[1, 1] = scale
    projection[0, 2] = projection[1, 2] = 2.0 * shift / camera.pixels
    projection[2, 2] = -(far + NEAR) / (far - NEAR)
    projection[2, 3] = -2 * far * NEAR / (far - NEAR)
    projection[3, 2] = -1.0
    return projection
