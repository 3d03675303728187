"""Evidence of heights from the parallax between frames of one camera, gathered on a grid over the ground."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracking.detection.detector import Frame
from tracking.geometry.lens import Lens, pixel_ray, plane_pixel
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined

STEEPEST = 3.0  # metres along the ground per metre of height of rays that count
FINEST = 128  # pixels; larger images are reduced to about as many along their longer edge
_STRIDE = 2  # reduced pixels from one that is compared to the next
_MOST = 30  # grey levels; larger differences count as these
_UNIT = 16.0  # of sums of evidence per grey level

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


@inlined
def find_cell(e: Evidence, x: float, y: float) -> tuple[int, int]:
    """Row and column of a place, perhaps beyond the grid."""
    return math.floor((y - e.corner[1]) / e.cell), math.floor((x - e.corner[0]) / e.cell)


@inlined
def level_of(e: Evidence, k: int, row: int, column: int) -> float:
    """Mean evidence [grey level] for a height in a cell; NaN if it is not known."""
    _, rows, columns = e.counts.shape
    if not (0 <= row < rows and 0 <= column < columns) or e.counts[k, row, column] < 4:
        return math.nan
    return e.sums[k, row, column] / (_UNIT * e.counts[k, row, column])


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
def _sample(view: View, right: float, above: float, depth: float) -> int:
    """Grey level, times 256, of a point in the axes of a view's camera, by bilinear interpolation; -1 outside of it."""
    if not depth > 0.0:
        return -1
    u, v = plane_pixel(view.lens.optics, right / depth, -above / depth)
    u, v = u / view.block - 0.5, v / view.block - 0.5
    rows, columns = view.grey.shape
    if not (0.0 <= u < columns - 1 and 0.0 <= v < rows - 1):
        return -1
    i, j, grey = int(v), int(u), view.grey
    a, b = int(16.0 * (u - j)), int(16.0 * (v - i))
    upper = (16 - a) * np.int64(grey[i, j]) + a * np.int64(grey[i, j + 1])
    lower = (16 - a) * np.int64(grey[i + 1, j]) + a * np.int64(grey[i + 1, j + 1])
    return (16 - b) * upper + b * lower


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
    rows, columns = middle.grey.shape
    high, wide, K = rows // _STRIDE, columns // _STRIDE, len(e.heights)
    costs, twice = np.full((K, high, wide), -1, dtype=np.int32), np.zeros((K, high, wide), dtype=np.bool_)
    slopes = np.full((high, wide, 2), math.nan)
    eye, one, two = middle.lens.eye, before.lens, after.lens
    a = _turn(one, eye[0] - one.eye[0], eye[1] - one.eye[1], eye[2] - one.eye[2])
    b = _turn(two, eye[0] - two.eye[0], eye[1] - two.eye[1], eye[2] - two.eye[2])
    for i in range(high):
        for j in range(wide):
            u, v = (_STRIDE * j + 0.5) * middle.block, (_STRIDE * i + 0.5) * middle.block
            x, y, z = pixel_ray(middle.lens, u, v)
            x, y = x / -z, y / -z
            if not (z < 0.0 and x * x + y * y <= STEEPEST * STEEPEST):
                continue
            slopes[i, j] = x, y
            p, q = _turn(one, x, y, -1.0), _turn(two, x, y, -1.0)
            own = 256 * np.int64(middle.grey[_STRIDE * i, _STRIDE * j])
            for k in range(K):
                s = eye[2] - e.heights[k]
                if not s > 0.0:
                    continue
                first = _sample(before, a[0] + s * p[0], a[1] + s * p[1], a[2] + s * p[2])
                second = _sample(after, b[0] + s * q[0], b[1] + s * q[1], b[2] + s * q[2])
                if first >= 0 and second >= 0:
                    costs[k, i, j], twice[k, i, j] = min(abs(first - own), abs(second - own)), True
                elif first >= 0 or second >= 0:
                    costs[k, i, j] = abs(max(first, second) - own)
    for i in range(high):
        for j in range(wide):
            ground = _mean(costs[0], i, j)
            for k in range(K):
                cost = _mean(costs[k], i, j) if ground >= 0 else -1
                if cost >= 0:
                    s = eye[2] - e.heights[k]
                    row, column = find_cell(e, eye[0] + s * slopes[i, j, 0], eye[1] + s * slopes[i, j, 1])
                    gain = (ground - cost if k > 0 else cost) >> 4
                    weight = 1 + int(twice[k, i, j] and twice[0, i, j])
                    if not (0 <= row < e.counts.shape[1] and 0 <= column < e.counts.shape[2]):
                        continue
                    e.sums[k, row, column] += weight * max(-16 * _MOST, min(16 * _MOST, gain))
                    e.counts[k, row, column] += weight


@inlined
def _mean(costs: Sums, i: int, j: int) -> int:
    """Mean of the known costs (rows, columns) of a pixel and its neighbours; -1 if its own is unknown."""
    if costs[i, j] < 0:
        return -1
    total, count = 0, 0
    for row in range(max(i - 1, 0), min(i + 2, costs.shape[0])):
        for column in range(max(j - 1, 0), min(j + 2, costs.shape[1])):
            if costs[row, column] >= 0:
                total += costs[row, column]
                count += 1
    return total // count
