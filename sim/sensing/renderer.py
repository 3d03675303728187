"""Rendered images of the world: one of PyBullet's renderers draws bodies, and this module the ground behind them."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.installation import ASSETS
from sim.sensing.culling import (
    find_hidden,
    find_in_frustum,
    select_covers,
    select_standing,
)
from sim.sensing.rasteriser import Rasteriser, make_projection, make_view
from sim.sensing.rolling_shutter import Sweep
from sim.sensing.sensor_mode import Rendered
from sim.world.appearance import AMBIENT, DIFFUSE, LIGHT
from sim.world.engine import pybullet
from sim.world.lens_images import StraightView, cut_rows, straighten
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import ENCLOSING_CYLINDER
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.matrices import products

_TEXELS = 10.0  # per m
_SKY = (186, 208, 226)
_HAZE = 0.02  # slope of a downward ray below which it shows sky, not ground
# A texel's three colours are packed into one word, far enough apart for weighted sums with weights of 1024 in total.
_GREEN, _BLUE, _COLOUR = np.uint64(21), np.uint64(42), np.uint64(255)
_HALF = np.uint64(512 | 512 << 21 | 512 << 42)
_NEXT = np.uint64(1)
_FARTHEST = 1e9  # largest texture coordinate, which prevents overflow; such texels are too far away to matter


class Ground:
    """An infinite textured plane z = 0; place (2, 3) maps its points (x, y, 1) to the texture, both in m."""

    def __init__(self, tint: Array, place: Array) -> None:
        """Read the texture; tint (3,) multiplies its red, green and blue."""
        self._texels = _pack_texture(*tint.tolist())
        self._place = np.array(place, dtype=float)

    def draw(self, image: NDArray[np.uint8], bodies: NDArray[np.int32], view: StraightView, pose: Pose) -> None:
        """Draw ground and sky into an image (H, W, 3) where there is no body, that is where `bodies` (H, W) is < 0."""
        optics = view.straight.optics
        calibration = float(optics.fx), float(optics.fy), float(optics.cx), float(optics.cy)
        position = np.array(pose.position, dtype=float)
        plane = _find_plane(pose.rotation, position, self._place, calibration, len(self._texels) - 1)
        _draw(image, bodies, self._texels, plane, view.places)


@lru_cache(maxsize=1)  # most worlds have the same
def _pack_texture(*tint: float) -> NDArray[np.uint64]:
    """The texture's colours, multiplied by red, green and blue, in one word for each texel."""
    texture = np.asarray(cv2.imread(str(ASSETS / "meshes" / "ground.png")), dtype=np.uint8)[..., ::-1]
    red, green, blue = np.moveaxis(np.clip(np.rint(texture * np.array(tint)), 0, 255).astype(np.uint64), -1, 0)
    # The first row and column are repeated at the end, so that every texel has neighbours below and to the right.
    return np.pad(red | green << _GREEN | blue << _BLUE, (0, 1), mode="wrap")


@compiled
def _find_plane(
    rotation: Array, position: Array, place: Array, calibration: tuple[float, float, float, float], tile: int
) -> Array:
    """Matrix (3, 3) that maps homogeneous pixels to texels, of a camera at a pose; place (2, 3) as in `Ground`.

    calibration: focal lengths and principal point in pixels; tile: number of texels along an edge of the texture.
    """
    fx, fy, cx, cy = calibration
    aspect = fx / fy
    # The product of `rays` and (column, row, 1) is the ray through that pixel in world coordinates.
    pixels = np.zeros((1, 3, 3))
    pixels[0, 0, 0], pixels[0, 0, 2] = 1.0, 0.5 - cx
    pixels[0, 1, 1], pixels[0, 1, 2], pixels[0, 2, 2] = -aspect, -(aspect * (0.5 - cy)), -fx
    rays = products(rotation.reshape(1, 3, 3), pixels)[0] / fx
    plane = np.empty((3, 3))
    for k in range(3):
        east = position[0] * rays[2, k] - position[2] * rays[0, k]
        north = position[1] * rays[2, k] - position[2] * rays[1, k]
        for i in range(2):
            turned = 0.0 + place[i, 0] * east + place[i, 1] * north
            plane[i, k] = _TEXELS * (turned + place[i, 2] * rays[2, k])
        plane[2, k] = rays[2, k]
    # Shifted by whole tiles until the camera is above the first, so that most texels are found without a division.
    for i in range(2):
        over = 0.0 + place[i, 0] * position[0] + place[i, 1] * position[1] + place[i, 2]
        for k in range(3):
            plane[i, k] -= tile * np.floor(over * _TEXELS / tile) * plane[2, k]
    return plane


@compiled
def _draw(
    image: NDArray[np.uint8], bodies: NDArray[np.int32], texels: NDArray[np.uint64], plane: Array, places: Array
) -> None:
    """Interpolate with integer bilinear weights out of 32 x 32; plane (3, 3) maps homogeneous pixels to texels.

    places (2, H, W): column and row of each pixel, if not its own, else (2, 0, 0).
    """
    tile, width = len(texels) - 1, image.shape[1]
    ys, xs, slopes = np.empty(width, dtype=np.int32), np.empty(width, dtype=np.int32), np.empty(width)
    us, vs = np.arange(width) * 1.0, np.empty(width)
    for row in range(image.shape[0]):
        if places.size:
            us, vs = places[0, row], places[1, row]
        else:
            vs[:] = row
        for column in range(width):  # a separate loop, which is vectorised; results are used only where ground shows
            u, v = us[column], vs[column]
            slopes[column] = plane[2, 0] * u + plane[2, 1] * v + plane[2, 2]
            scale = 32.0 / slopes[column]
            right = (plane[0, 0] * u + plane[0, 1] * v + plane[0, 2]) * scale + 0.5
            down = (plane[1, 0] * u + plane[1, 1] * v + plane[1, 2]) * scale + 0.5
            ys[column] = np.int32(np.floor(min(max(down, -_FARTHEST), _FARTHEST)))
            xs[column] = np.int32(np.floor(min(max(right, -_FARTHEST), _FARTHEST)))
        for column in range(width):
            if bodies[row, column] >= 0:
                continue
            if slopes[column] > -_HAZE:
                image[row, column, 0], image[row, column, 1], image[row, column, 2] = _SKY
                continue
            y, x = np.int64(ys[column]), np.int64(xs[column])
            a, b = np.uint64(y & 31), np.uint64(x & 31)
            i, j = _wrap(y >> 5, tile), _wrap(x >> 5, tile)
            # Negative differences wrap around, but the sum is still correct.
            upper = texels[i, j] * np.uint64(32) + b * (texels[i, j + _NEXT] - texels[i, j])
            lower = texels[i + _NEXT, j] * np.uint64(32) + b * (texels[i + _NEXT, j + _NEXT] - texels[i + _NEXT, j])
            colour = upper * np.uint64(32) + a * (lower - upper) + _HALF
            image[row, column, 0] = colour >> np.uint64(10) & _COLOUR
            image[row, column, 1] = colour >> _GREEN + np.uint64(10) & _COLOUR
            image[row, column, 2] = colour >> _BLUE + np.uint64(10) & _COLOUR


@compiled
def _wrap(index: np.int64, tile: int) -> np.uint64:
    """Index modulo tile. Most indices are in range and need no division; unsigned ones spare NumPy's check of sign."""
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


class Renderer:
    """Renderer of one world; no other object sets the visibility of the world's bodies.

    Cameras of different resolutions share it. The engine allocates memory at each change of size, which costs 2 % of a
    frame's time or less (docs/results/benchmarks.md), no more than a separate client for each would cost.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._style = world.style
        self._light = {**_LIGHT, "lightDirection": self._style.light, "lightAmbientCoeff": self._style.ambient}
        self._standing, self._covers = select_standing(world.solids), select_covers(world.solids)
        self._radii = np.array([model.radius for model in world.models])
        self._rasteriser = Rasteriser(world)
        self._people_by_body = np.full(len(world.models) + 1, -1, dtype=np.int32)  # the last one is the background
        self._people = len([model for model in world.models if model.kind == "person"])
        first = len(self._standing)
        self._people_by_body[first : first + self._people] = np.arange(self._people)
        self._ground = Ground(self._style.ground_tint, self._style.ground_place)

    def take(self, uav: int, time: float, camera: Camera, pose: Pose, sweep: Sweep | None = None) -> Rendered:
        """The frame that a UAV's camera delivers at a time [s]: the view with the camera's blur, exposure and noise."""
        view = self.render(camera, pose, sweep)
        return Rendered(self._style.develop(view.image, uav, time), view.people)

    def render(self, camera: Camera, pose: Pose, sweep: Sweep | None = None) -> Rendered:
        """The view of a camera at a pose, without blur, exposure and noise.

        sweep: the motion while it is read out, if its rows are not exposed at once.
        """
        images, masks = [], []
        for strip, at, seen in self._cut_strips(camera, pose, sweep):
            found, people = self._capture(strip, at, seen)
            self._ground.draw(found.image, found.bodies, strip, at)
            if strip.dark.size:
                found.image[strip.dark] = 0
            images.append(found.image)
            masks.append(people)
        return Rendered(np.vstack(images), np.vstack(masks))

    def find_people(self, camera: Camera, pose: Pose, sweep: Sweep | None = None) -> NDArray[np.int32]:
        """The mask of people (H, W) of that view, in a fraction of the time."""
        return np.vstack([self._capture(*strip)[1] for strip in self._cut_strips(camera, pose, sweep)])

    def _cut_strips(
        self, camera: Camera, pose: Pose, sweep: Sweep | None
    ) -> Iterator[tuple[StraightView, Pose, Flags]]:
        """Strips of rows of a view, each with the camera's pose at the time of its middle, and the bodies (B,) in view.

        People are where they are at that time until the next strip is asked for.
        """
        view = straighten(camera)
        if sweep is None:
            yield view, pose, self.in_view(camera, pose)
            return
        edges = sweep.edges(camera, float(pose.position[2]))
        middles = (np.array(edges[:-1]) + np.array(edges[1:])) / 2
        delays = sweep.delays(middles, camera.size[1]).tolist()
        seen = np.logical_or.reduce([self.in_view(camera, sweep.pose_at(pose, t)) for t in (delays[0], delays[-1])])
        positions, headings = self._world.people
        for (top, bottom), delay in zip(pairwise(edges), delays, strict=True):
            self._world.place_people(positions + delay * sweep.people, headings)
            yield cut_rows(view, top, bottom), sweep.pose_at(pose, delay), seen
        self._world.place_people(positions, headings)

    def _capture(self, view: StraightView, pose: Pose, seen: Flags) -> tuple["Capture", NDArray[np.int32]]:
        """The view before the ground is drawn, and its mask of people."""
        world = self._world
        if world.opengl:
            found = capture(world.client, view.straight, pose, light=self._light, opengl=True)
            people_by_id = world.people_by_id
        else:
            drawn = self._rasteriser.draw(view.straight, pose, seen)
            found, people_by_id = Capture(drawn.image, drawn.heights, drawn.bodies), self._people_by_body
        if view.sources.size:
            image, depth, bodies = found
            image = np.take(image.reshape(-1, 3), view.sources, axis=0)
            bodies = np.where(view.dark, -1, np.take(bodies, view.sources))
            found = Capture(image, np.take(depth, view.sources), bodies)
        return found, np.take(people_by_id, found.bodies, mode="wrap")

    def in_view(self, camera: Camera, pose: Pose) -> Flags:
        """Mask (B,) of the world's bodies that may show in the image."""
        centres, position = self._world.centres, pose.position
        seen = find_in_frustum(centres, self._radii, position, pose.rotation, camera.fov)
        solids = len(self._standing)
        standing = np.flatnonzero(seen[:solids] & ~np.isnan(self._standing[:, 0]))
        seen[standing] = ~find_hidden(self._standing[standing], self._covers, position, camera.fov)
        people = solids + np.flatnonzero(seen[solids : solids + self._people])
        upright = np.column_stack([centres[people, :2], np.tile(ENCLOSING_CYLINDER, (len(people), 1))])
        seen[people] = ~find_hidden(upright, self._covers, position, camera.fov)
        return seen


class Capture(NamedTuple):
    """A raw view.

    A value b of the depth buffer means the depth far near / (far - (far - near) b) along the optical axis.
    """

    image: NDArray[np.uint8]  # (H, W, 3) RGB
    depth: NDArray[np.float32]  # (H, W)
    bodies: NDArray[np.int32]  # (H, W) ids, -1 for the background


def capture(
    client: int, camera: Camera, pose: Pose, *, light: Mapping[str, Any] = _LIGHT, opengl: bool = False
) -> Capture:
    """Raw view of a client by one of PyBullet's renderers: OpenGL, or TinyRenderer, which tests compare with ours."""
    view, projection = make_view(pose), make_projection(camera, pose, 0.0 if opengl else 0.5)
    _, _, rgba, depth, bodies = pybullet.getCameraImage(
        *camera.size,
        viewMatrix=view.ravel(order="F").tolist(),
        projectionMatrix=projection.ravel(order="F").tolist(),
        renderer=pybullet.ER_BULLET_HARDWARE_OPENGL if opengl else pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
        **light,
    )
    # If PyBullet was compiled without NumPy, these are flat tuples.
    size = camera.size[::-1]
    colours = np.asarray(rgba, dtype=np.uint8).reshape(*size, 4)
    return Capture(
        np.asarray(cv2.cvtColor(colours, cv2.COLOR_RGBA2RGB), dtype=np.uint8),
        np.asarray(depth, dtype=np.float32).reshape(size),
        np.asarray(bodies, dtype=np.int32).reshape(size),
    )
