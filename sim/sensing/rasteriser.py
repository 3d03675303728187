"""Images of the world's bodies, bit for bit as PyBullet's TinyRenderer draws them, in a fraction of its time.

Numbers are 32-bit floats but for places of pixels in triangles, and sums begin with the last term, as in the C++ code.
"""

from functools import cache, lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.installation import ASSETS
from sim.sensing.culling import LEAST_FAR_PLANE, NEAR_PLANE
from sim.world.appearance import DIFFUSE
from sim.world.bodies import list_triangles, mesh_file, paint_of
from sim.world.leaves import Leaves
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.quaternions import engine_rotation
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled, inlined, merged
from tracking.numerics.matrices import apply

Floats = NDArray[np.float32]
Real = NDArray[np.floating[Any]]
_F = np.float32
_LEAST = 1e-2  # twice the area [pixel²] of a triangle that is drawn
_ZERO, _ONE = np.float32(0), np.float32(1)


class Mesh(NamedTuple):
    """Triangles of a body and the texture that they show."""

    corners: Floats  # (F, 3, 8): position, normal of unit length, and place in the texture
    texture: NDArray[np.uint8]  # (H, W, 3), from bottom to top


class Brush(NamedTuple):
    """How a body is painted."""

    body: int  # its number
    texture: NDArray[np.uint8]  # as in `Mesh`
    colour: Floats  # (3,), multiplies the texture


class Stage(NamedTuple):
    """Where a camera is, and the light."""

    camera: Floats  # (4, 4), from the world to the camera
    back: Floats  # (4, 4), its inverse, transposed
    projection: Floats  # (4, 4), to clip coordinates
    light: Floats  # (3,) of unit length, to the light
    ambient: np.float32
    diffuse: np.float32


class Canvas(NamedTuple):
    """What has been drawn."""

    image: NDArray[np.uint8]  # (H, W, 3) RGB
    bodies: NDArray[np.int32]  # (H, W) number of the body that each pixel shows, -1 for none
    heights: Floats  # (H, W) m, the negative depth of what it shows


class Rasteriser:
    """Draws the bodies of a world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._colours = [np.array(paint_of(model), dtype=np.float32) for model in world.models]
        light = np.array(world.style.light, dtype=np.float32).astype(float)
        length = np.sqrt(light[0] * light[0] + light[1] * light[1] + light[2] * light[2])
        self._light = (light * (1.0 / length)).astype(np.float32), _F(world.style.ambient), _F(DIFFUSE)

    def draw(self, camera: Camera, pose: Pose, seen: Flags) -> Canvas:
        """Draw bodies (B,) in white surroundings; the far plane is as in `make_projection`."""
        size = camera.size[::-1]
        view, projection = make_view(pose).astype(_F), make_projection(camera, pose, shift=0.5).astype(_F)
        stage = Stage(view, _invert(view), projection, *self._light)
        far = projection[2, 3] / (projection[2, 2] + _ONE)
        canvas = Canvas(np.full((*size, 3), 255, np.uint8), np.full(size, -1, np.int32), np.full(size, -far, _F))
        for k in np.flatnonzero(seen).tolist():
            model = self._world.models[k]
            mesh = _make_leaves(model.leaves) if model.leaves else _read_mesh(mesh_file(model.kind), model.scale)
            place, attitude = self._world.find_place(k)
            brush = Brush(k, mesh.texture, self._colours[k])
            _draw(canvas, brush, mesh.corners, np.array([*place, *attitude], dtype=float), stage)
        return canvas


def make_view(pose: Pose) -> Array:
    """Matrix (4, 4) from the world to a camera."""
    rotation, view = pose.rotation, np.eye(4)
    view[:3, :3] = rotation.T
    view[:3, 3] = -apply(rotation.T, pose.position)
    return view


def make_projection(camera: Camera, pose: Pose, shift: float) -> Array:
    """OpenGL projection (4, 4); the far plane is ten times the camera's height away, but at least `LEAST_FAR_PLANE`.

    shift: 0.5 pixels for TinyRenderer, which samples pixels at their corners.
    """
    o, projection, far = camera.optics, np.zeros((4, 4)), max(LEAST_FAR_PLANE, 10.0 * float(pose.position[2]))
    projection[0, 0], projection[1, 1] = 2.0 * o.fx / o.width, 2.0 * o.fy / o.height
    projection[0, 2] = 1.0 - 2.0 * o.cx / o.width + 2.0 * shift / o.width
    projection[1, 2] = 2.0 * o.cy / o.height - 1.0 + 2.0 * shift / o.height
    projection[2, 2] = -(far + NEAR_PLANE) / (far - NEAR_PLANE)
    projection[2, 3] = -2 * far * NEAR_PLANE / (far - NEAR_PLANE)
    projection[3, 2] = -1.0
    return projection


@cache
def _read_mesh(name: str, scale: tuple[float, float, float]) -> Mesh:
    """The mesh of a file among the assets, with the texture of the material that it names."""
    rows: dict[str, list[list[str]]] = {"v": [], "vt": [], "vn": [], "f": [], "usemtl": []}
    for line in (ASSETS / "meshes" / name).read_text(encoding="utf-8").splitlines():
        kind, *words = line.split() or [""]
        if kind in rows:
            rows[kind].append(words)
    places, texels, normals = (np.array(rows[kind], dtype=np.float32) for kind in ("v", "vt", "vn"))
    faces = np.array([[corner.split("/") for corner in words] for words in rows["f"]], dtype=np.int64) - 1
    image = cv2.imread(str(ASSETS / "meshes" / f"{rows['usemtl'][0][0]}.png"))
    texture = np.ascontiguousarray(np.asarray(image, dtype=np.uint8)[::-1, :, ::-1])
    places = (places * np.array(scale)).astype(np.float32)
    return _make_mesh(places[faces[..., 0]], normals[faces[..., 2]], texels[faces[..., 1]], texture)


@lru_cache(256)  # a crown's may take megabytes
def _make_leaves(leaves: Leaves) -> Mesh:
    corners, faces, normals = list_triangles(leaves)
    texels = np.full((*faces.shape, 2), 0.5)
    return _make_mesh(corners[faces], normals[faces], texels, np.full((1, 1, 3), 255, np.uint8))


def _make_mesh(places: Real, normals: Real, texels: Real, texture: NDArray[np.uint8]) -> Mesh:
    corners = np.concatenate([places, normals, texels], axis=-1).astype(np.float32)
    n = corners[..., 3:6]
    squares = n[..., 0] * n[..., 0] + n[..., 1] * n[..., 1] + n[..., 2] * n[..., 2]
    n *= (_ONE / np.sqrt(np.maximum(squares, np.finfo(np.float32).tiny)))[..., None]
    return Mesh(corners, texture)


@compiled
def _draw(canvas: Canvas, brush: Brush, corners: Floats, place: Array, stage: Stage) -> None:
    """Draw the triangles (F, 3, 8) of a body; place (7,) has its position and quaternion."""
    model = _find_model(place)
    whole, turned = _multiply(stage.projection, _multiply(stage.camera, model)), _invert(model)
    clip, face = np.empty((3, 4), _F), np.empty((3, 8), _F)
    for f in range(len(corners)):
        if not _is_front(corners[f], model, stage.back):
            continue
        behind = _turn(corners[f], whole, turned, clip, face)
        if behind == 0:
            _fill(canvas, brush, clip, clip, False, face, stage)
        elif behind < 3:
            cut = _cut(clip)
            for n in range(1, len(cut) - 1):
                part = np.empty((3, 4), _F)
                for i in range(4):
                    part[0, i], part[1, i], part[2, i] = cut[0, i], cut[n, i], cut[n + 1, i]
                _fill(canvas, brush, part, clip, True, face, stage)


@merged
def _find_model(place: Array) -> Floats:
    """Matrix (4, 4) from a mesh to the world."""
    model, turn = np.zeros((4, 4), _F), engine_rotation(place[3], place[4], place[5], place[6])
    for i in range(3):
        for j in range(3):
            model[i, j] = _F(turn[i, j])
        model[i, 3] = _F(place[i])
    model[3, 3] = _ONE
    return model


@merged
def _turn(corners: Floats, whole: Floats, turned: Floats, clip: Floats, face: Floats) -> int:
    """Find clip coordinates (3, 4) and turned corners (3, 8) of a triangle; return how many are behind the camera."""
    behind = 0
    for k in range(3):
        c = corners[k]
        for i in range(4):
            clip[k, i] = _apply(whole, i, c[0], c[1], c[2], _ONE)
        for i in range(8):
            face[k, i] = c[i]
        for i in range(3):
            face[k, 3 + i] = _apply(turned, i, c[3], c[4], c[5], _ZERO)
        behind += clip[k, 3] < _ZERO
    return behind


@compiled
def _fill(canvas: Canvas, brush: Brush, part: Floats, clip: Floats, is_cut: bool, face: Floats, stage: Stage) -> None:
    """Draw a triangle, or what the near plane leaves of it, where it is nearer than what has been drawn.

    part (3, 4): clip coordinates of what is left; clip (3, 4): those of the triangle, by which it is shaded.
    """
    height, width = canvas.bodies.shape
    p = stage.projection
    near, far = p[2, 3] / (p[2, 2] - _ONE), p[2, 3] / (p[2, 2] + _ONE)
    screen, own = _find_pixels(part, width, height), _find_pixels(clip, width, height)
    left, right = max(screen[:, 0].min(), 0.0), min(screen[:, 0].max(), width - 1.0)
    low, high = max(screen[:, 1].min(), 0.0), min(screen[:, 1].max(), height - 1.0)
    if not (left <= right and low <= high):
        return
    for y in range(int(low), int(high) + 1):
        row = height - 1 - y
        for x in range(int(left), int(right) + 1):
            inside, a, b, c = _weigh(screen, part, x, y, True)
            if not inside:
                continue
            depth = -((part[2, 2] * c + part[1, 2] * b) + part[0, 2] * a)
            if canvas.heights[row, x] > depth:
                continue
            if is_cut:
                _, a, b, c = _weigh(own, clip, x, y, False)
            elif depth < -far or depth > near:
                continue
            shares = _F(a), _F(b), _F(c)
            light = stage.ambient, stage.diffuse * _find_light(face, shares, stage.light)
            u = _texel(_mix(face[:, 6], shares), brush.texture.shape[1])
            v = _texel(_mix(face[:, 7], shares), brush.texture.shape[0])
            for i in range(3):
                tint = _F(np.uint8(int(_F(brush.texture[v, u, i]) * brush.colour[i])))
                canvas.image[row, x, i] = np.uint8(min(int(light[0] * tint + light[1] * tint), 255))
            canvas.heights[row, x], canvas.bodies[row, x] = _F(depth), brush.body


@compiled
def _find_pixels(clip: Floats, width: int, height: int) -> Array:
    """Places (3, 2) of clip coordinates in an image, from its lower left corner."""
    out, w, h = np.empty((3, 2)), _F(width) / _F(2), _F(height) / _F(2)
    for k in range(3):
        out[k, 0] = (w * clip[k, 3] + w * clip[k, 0]) / clip[k, 3]
        out[k, 1] = (h * clip[k, 3] + h * clip[k, 1]) / clip[k, 3]
    return out


@inlined
def _weigh(screen: Array, clip: Floats, x: int, y: int, inside: bool) -> tuple[bool, float, float, float]:
    """Whether a triangle has a pixel, and the weights of its corners there, in perspective, by need only `inside`."""
    ax, ay = screen[0, 0], screen[0, 1]
    bx, by, cx, cy, dx, dy = screen[1, 0] - ax, screen[1, 1] - ay, screen[2, 0] - ax, screen[2, 1] - ay, ax - x, ay - y
    second, third, area = dx * cy - cx * dy, bx * dy - dx * by, cx * by - bx * cy
    a, b, c = -1.0, 1.0, 1.0
    if abs(area) > _LEAST:
        if inside and (second * area < 0.0 or third * area < 0.0):
            return False, a, b, c
        a, b, c = 1.0 - (third + second) / area, second / area, third / area
    inside = a >= 0.0 and b >= 0.0 and c >= 0.0
    a, b, c = a / clip[0, 3], b / clip[1, 3], c / clip[2, 3]
    total = (a + b) + c
    return inside, a / total, b / total, c / total


@inlined
def _find_light(face: Floats, shares: tuple[np.float32, np.float32, np.float32], light: Floats) -> np.float32:
    """Cosine of the angle between a pixel's normal and the light, at least 0."""
    x, y, z = _mix(face[:, 3], shares), _mix(face[:, 4], shares), _mix(face[:, 5], shares)
    scale = _ONE / np.sqrt((x * x + y * y) + z * z)
    return max(_ZERO, (z * scale * light[2] + y * scale * light[1]) + x * scale * light[0])


@inlined
def _mix(values: Floats, shares: tuple[np.float32, np.float32, np.float32]) -> np.float32:
    """A pixel's value, from those of three corners."""
    return _F((values[2] * shares[2] + values[1] * shares[1]) + values[0] * shares[0])


@inlined
def _texel(place: np.float32, count: int) -> int:
    """Column or row of the texel at a place in a texture that repeats itself."""
    part = place - np.trunc(place)
    part = part + _ONE if part < _ZERO else part
    return min(int(part * _F(count)), count - 1)


@merged
def _cut(clip: Floats) -> Floats:
    """Corners (N, 4) of the part of a triangle (3, 4) in front of the near plane; some come twice."""
    out, count = np.empty((6, 4), _F), 0
    for k in range(3):
        one, other = clip[k], clip[(k + 1) % 3]
        starts, ends = one[3] > _ZERO and one[2] > -one[3], other[3] > _ZERO and other[2] > -other[3]
        if starts or ends:
            d, e = one[2] + one[3], other[2] + other[3]
            factor = _F(1.0 / np.float64(e - d))
            for i in range(4):
                edge = (one[i] * e - other[i] * d) * factor
                out[count, i], out[count + 1, i] = one[i] if starts else edge, other[i] if ends else edge
            count += 2
    return out[:count]


@merged
def _is_front(corners: Floats, model: Floats, back: Floats) -> bool:
    """True if a triangle (3, 8) turns its front to the camera; back (4, 4) as in `Stage`."""
    w = np.empty((3, 3))
    for k in range(3):
        for i in range(3):
            w[k, i] = _apply(model, i, corners[k, 0], corners[k, 1], corners[k, 2], _ONE)
    a, b, c = w[1] - w[0], w[2] - w[0], w[0] - back[3, :3]
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return bool((c[0] * x + c[1] * y) + c[2] * z < 0.0)


@inlined
def _apply(matrix: Floats, i: int, x: np.float32, y: np.float32, z: np.float32, w: np.float32) -> np.float32:
    """Element i of the product of a matrix (4, 4) and a vector."""
    return _F(((matrix[i, 3] * w + matrix[i, 2] * z) + matrix[i, 1] * y) + matrix[i, 0] * x)


@compiled
def _multiply(one: Floats, other: Floats) -> Floats:
    out = np.empty((4, 4), _F)
    for i in range(4):
        for j in range(4):
            out[i, j] = _apply(one, i, other[0, j], other[1, j], other[2, j], other[3, j])
    return out


@compiled
def _invert(matrix: Floats) -> Floats:
    """The inverse of a matrix (4, 4), transposed."""
    out, minor = np.empty((4, 4), _F), np.empty((3, 3), _F)
    for row in range(4):
        for column in range(4):
            for i in range(3):
                for j in range(3):
                    minor[i, j] = matrix[i + (i >= row), j + (j >= column)]
            det = minor[0, 2] * _find_determinant(minor, 0, 1) + minor[0, 1] * -_find_determinant(minor, 0, 2)
            det = det + minor[0, 0] * _find_determinant(minor, 1, 2)
            out[row, column] = -det if (row + column) % 2 else det
    total = _apply(out, 0, matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[0, 3])
    for row in range(4):
        for column in range(4):
            out[row, column] = out[row, column] / total
    return out


@inlined
def _find_determinant(minor: Floats, j: int, k: int) -> np.float32:
    """Determinant of columns j and k of the last two rows."""
    return _F(minor[1, k] * -minor[2, j] + minor[1, j] * minor[2, k])
