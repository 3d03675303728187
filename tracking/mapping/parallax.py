"""Evidence of heights from the parallax between frames of one camera, gathered on a grid over the ground."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracking.detection.detector import Frame
from tracking.geometry.lens import Lens, Optics, pixel_ray, plane_pixel
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, inlined

STEEPEST = 3.0  # metres along the ground per metre of height of rays that count
FINEST = 128  # pixels; larger images are reduced to about as many along their longer edge
_STRIDE = 2  # reduced pixels from one that is compared to the next
_MOST = 30  # grey levels; larger differences count as these
_ONE = 1 << 20  # added to each known difference, so that a sum of nine also counts them
KNOWN = 4  # comparisons from which on the evidence in a cell counts
UNIT = 16.0  # of sums of evidence per grey level

Grey = NDArray[np.uint8]
Sums = NDArray[np.int32]


class View(NamedTuple):
    """A frame for compiled code: smoothed grey levels (H, W) of blocks of pixels, and the camera at its pose."""

    grey: Grey
    block: int  # edge of a block [pixel]
    lens: Lens


class Evidence(NamedTuple):
    """Sums (K, rows, columns) of evidence for K heights over cells of the ground, and numbers of comparisons.

    Evidence for a height is what pixels that show the cell's middle at that height, if it is there, differ less between
    frames than if they showed the ground. The first height is the ground's. There, it is the difference itself.
    """

    sums: Sums  # in 1/16 grey level
    counts: Sums  # those in which both other frames show the point count twice
    heights: Array  # (K,) m
    corner: tuple[float, float]  # m, the south-western one
    cell: float  # m, edge of a cell
    high: Flags  # (rows, columns): cells that were taken to be high when edges were looked for last


@inlined
def find_cell(e: Evidence, x: float, y: float) -> tuple[int, int]:
    """Row and column of a place, perhaps beyond the grid."""
    return math.floor((y - e.corner[1]) / e.cell), math.floor((x - e.corner[0]) / e.cell)


@inlined
def level_of(sums: Sums, counts: Sums, k: int, row: int, column: int) -> float:
    """Mean evidence [grey level] for a height in a cell; NaN if it is not known."""
    if not (0 <= row < counts.shape[1] and 0 <= column < counts.shape[2]):
        return math.nan
    count = counts[k, row, column]
    return float(sums[k, row, column] / (UNIT * count)) if count >= KNOWN else math.nan


def view_of(frame: Frame) -> View:
    """The view of a frame, whose image is grey (H, W) or RGB (H, W, 3)."""
    image = frame.image if frame.image.ndim == 3 else frame.image[..., None]
    block = max(1, round(max(image.shape[:2]) / FINEST))
    return View(_reduce(np.ascontiguousarray(image), block), block, frame.camera.lens(frame.pose))


@compiled
def _reduce(image: NDArray[np.uint8], block: int) -> Grey:
    """Mean grey levels of the blocks of an image (H, W, 1 or 3), smoothed by (1, 2, 1) / 4 both ways."""
    rows, columns, channels = image.shape[0] // block, image.shape[1] // block, image.shape[2]
    sums = np.zeros((rows, columns), dtype=np.int64)
    for i in range(rows * block):
        for j in range(columns * block):
            green = np.int64(image[i, j, channels // 2])
            sums[i // block, j // block] += np.int64(image[i, j, 0]) + 2 * green + np.int64(image[i, j, channels - 1])
    across = np.empty_like(sums)
    for i in range(rows):
        for j in range(columns):
            across[i, j] = sums[i, max(j - 1, 0)] + 2 * sums[i, j] + sums[i, min(j + 1, columns - 1)]
    grey, whole = np.empty((rows, columns), dtype=np.uint8), 64 * block * block
    for i in range(rows):
        for j in range(columns):
            total = across[max(i - 1, 0), j] + 2 * across[i, j] + across[min(i + 1, rows - 1), j]
            grey[i, j] = (total + whole // 2) // whole
    return grey


@inlined
def _sample(grey: Grey, optics: Optics, block: int, right: float, above: float, depth: float) -> int:
    """Grey level, times 256, of a point in a camera's axes, by bilinear interpolation; -1 outside of the image."""
    if not depth > 0.0:
        return -1
    near, share = 1.0 / depth, 1.0 / block
    u, v = optics.cx + optics.fx * near * right, optics.cy - optics.fy * near * above
    if optics.reach > 0.0:
        u, v = plane_pixel(optics, near * right, -near * above)
    u, v = share * u - 0.5, share * v - 0.5
    if not (0.0 <= u < grey.shape[1] - 1 and 0.0 <= v < grey.shape[0] - 1):
        return -1
    i, j = int(v), int(u)
    a, b = int(16.0 * (u - j)), int(16.0 * (v - i))
    upper = (16 - a) * np.int64(grey[i, j]) + a * np.int64(grey[i, j + 1])
    lower = (16 - a) * np.int64(grey[i + 1, j]) + a * np.int64(grey[i + 1, j + 1])
    return int((16 - b) * upper + b * lower)


@inlined
def _turn(lens: Lens, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector of the world in the axes of a camera: right, above and depth."""
    r = lens.rotation
    right, above = r[0, 0] * x + r[1, 0] * y + r[2, 0] * z, r[0, 1] * x + r[1, 1] * y + r[2, 1] * z
    return right, above, -(r[0, 2] * x + r[1, 2] * y + r[2, 2] * z)


@compiled
def compare(middle: View, before: View, after: View, e: Evidence) -> None:
    """Add to the evidence what the parallax of three views tells.

    A pixel of the middle view is compared with those where the other two show the point at each height on its ray. The
    smaller difference counts, because one of the two may show something else in front.
    """
    rays = _list_rays(middle, before.lens, after.lens)
    ground = np.zeros(rays.shape[:2], dtype=np.int64)
    known = np.zeros(rays.shape[:2], dtype=np.int64)
    for k in range(len(e.heights)):
        if middle.lens.eye[2] > e.heights[k]:
            costs, views = _find_costs(middle, before, after, rays, e.heights[k])
            if k == 0:
                ground, known = costs, views
            _add(e, k, middle.lens.eye, rays, (ground, known), (costs, views))


@compiled
def _list_rays(middle: View, one: Lens, two: Lens) -> Array:
    """Rays (rows, columns, 8) that fall by 1 m: east and north, and the ray in the axes of two other cameras."""
    rows, columns = middle.grey.shape
    rays = np.full((rows // _STRIDE, columns // _STRIDE, 8), math.nan)
    for i in range(rows // _STRIDE):
        for j in range(columns // _STRIDE):
            u, v = (_STRIDE * j + 0.5) * middle.block, (_STRIDE * i + 0.5) * middle.block
            x, y, z = pixel_ray(middle.lens, u, v)
            x, y = x / -z, y / -z
            if z < 0.0 and x * x + y * y <= STEEPEST * STEEPEST:
                ray = rays[i, j]
                ray[0], ray[1] = x, y
                ray[2], ray[3], ray[4] = _turn(one, x, y, -1.0)
                ray[5], ray[6], ray[7] = _turn(two, x, y, -1.0)
    return rays


@compiled
def _find_costs(middle: View, before: View, after: View, rays: Array, height: float) -> tuple[Indices, Indices]:
    """Mean differences, times 256, and numbers of views compared (rows, columns) at a height [m]; 0 views if unknown.

    The mean is that of a pixel and its eight neighbours, as far as they are known.
    """
    rows, columns, _ = rays.shape
    costs, views = np.zeros((rows + 2, columns + 2), dtype=np.int64), np.zeros((rows, columns), dtype=np.int64)
    eye = middle.lens.eye
    x, y, z = before.lens.eye
    a = _turn(before.lens, eye[0] - x, eye[1] - y, eye[2] - z)
    x, y, z = after.lens.eye
    b = _turn(after.lens, eye[0] - x, eye[1] - y, eye[2] - z)
    s, grey, one, two = eye[2] - height, middle.grey, before.grey, after.grey
    for i in range(rows):
        for j in range(columns):
            if math.isnan(rays[i, j, 0]):
                continue
            first = _sample(
                one,
                before.lens.optics,
                before.block,
                a[0] + s * rays[i, j, 2],
                a[1] + s * rays[i, j, 3],
                a[2] + s * rays[i, j, 4],
            )
            second = _sample(
                two,
                after.lens.optics,
                after.block,
                b[0] + s * rays[i, j, 5],
                b[1] + s * rays[i, j, 6],
                b[2] + s * rays[i, j, 7],
            )
            own = 256 * np.int64(grey[_STRIDE * i, _STRIDE * j])
            views[i, j] = int(first >= 0) + int(second >= 0)
            cost = abs((second if first < 0 else first) - own)
            if views[i, j] == 2:
                cost = min(cost, abs(second - own))
            if views[i, j] > 0:
                costs[i + 1, j + 1] = _ONE + cost
    return _find_means(costs, views), views


@compiled
def _find_means(costs: Indices, views: Indices) -> Indices:
    """Means (rows, columns) of the known costs (rows + 2, columns + 2) of pixels and their neighbours."""
    rows, columns = views.shape
    sums = np.zeros((rows + 2, columns), dtype=np.int64)
    for i in range(rows + 2):
        for j in range(columns):
            sums[i, j] = costs[i, j] + costs[i, j + 1] + costs[i, j + 2]
    means = np.zeros((rows, columns), dtype=np.int64)
    for i in range(rows):
        for j in range(columns):
            total = sums[i, j] + sums[i + 1, j] + sums[i + 2, j]
            if views[i, j] > 0:
                means[i, j] = (total % _ONE) // (total // _ONE)
    return means


@compiled
def _add(
    e: Evidence,
    k: int,
    eye: tuple[float, float, float],
    rays: Array,
    ground: tuple[Indices, Indices],
    own: tuple[Indices, Indices],
) -> None:
    """Add the evidence for one height: its own costs and numbers of views, against those of the ground."""
    s, limit = eye[2] - e.heights[k], int(UNIT) * _MOST
    _, rows, columns = e.counts.shape
    for i in range(rays.shape[0]):
        for j in range(rays.shape[1]):
            if own[1][i, j] == 0 or ground[1][i, j] == 0:
                continue
            row, column = find_cell(e, eye[0] + s * rays[i, j, 0], eye[1] + s * rays[i, j, 1])
            if 0 <= row < rows and 0 <= column < columns:
                gain = (ground[0][i, j] - own[0][i, j] if k > 0 else own[0][i, j]) >> 4
                weight = min(own[1][i, j], ground[1][i, j])
                e.sums[k, row, column] += weight * max(-limit, min(limit, gain))
                e.counts[k, row, column] += weight
