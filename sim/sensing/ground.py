"""The ground and the sky behind the bodies in an image: a texture sampled with the same result on every processor."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.installation import ASSETS
from tracking.geometry.camera import Camera, Pose
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.matrices import applied, product

_TEXELS = 10.0  # per m
_SKY = (186, 208, 226)
_HAZE = 0.02  # slope of a downward ray below which the ground is lost in the sky
# A texel's colours stand in one word, far enough apart for sums of weights that add up to 1024.
_GREEN, _BLUE, _COLOUR = np.uint64(21), np.uint64(42), np.uint64(255)
_HALF = np.uint64(512 | 512 << 21 | 512 << 42)
_FARTHEST = 1e9  # a texture's coordinate beyond which it no longer matters which texel it is


class Ground:
    """A textured plane z = 0 without end; place (2, 3) maps its points to the texture, both in m."""

    def __init__(self, tint: Array, place: Array) -> None:
        """Read the texture; tint (3,) multiplies its red, green and blue."""
        texture = np.asarray(cv2.imread(str(ASSETS / "meshes" / "ground.png")), dtype=np.uint8)[..., ::-1]
        red, green, blue = np.moveaxis(np.clip(np.rint(texture * tint), 0, 255).astype(np.uint64), -1, 0)
        self._texels = red | green << _GREEN | blue << _BLUE
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
        tile, over = len(self._texels), applied(self._place[:, :2], position[:2]) + self._place[:, 2]
        plane[:2] -= np.outer(tile * np.floor(over * _TEXELS / tile), plane[2])
        _draw(image, bodies, self._texels, plane)


@compiled
def _draw(image: NDArray[np.uint8], bodies: NDArray[np.int32], texels: NDArray[np.uint64], plane: Array) -> None:
    """Interpolate bilinearly with whole weights out of 32 x 32; plane (3, 3) maps pixels to texels, homogeneously."""
    tile = len(texels)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            if bodies[row, column] >= 0:
                continue
            slope = plane[2, 0] * column + plane[2, 1] * row + plane[2, 2]
            if slope > -_HAZE:
                image[row, column, 0], image[row, column, 1], image[row, column, 2] = _SKY
                continue
            right = (plane[0, 0] * column + plane[0, 1] * row + plane[0, 2]) * (32.0 / slope) + 0.5
            down = (plane[1, 0] * column + plane[1, 1] * row + plane[1, 2]) * (32.0 / slope) + 0.5
            i = int(np.floor(min(max(down, -_FARTHEST), _FARTHEST)))
            j = int(np.floor(min(max(right, -_FARTHEST), _FARTHEST)))
            a, b = np.uint64(i & 31), np.uint64(j & 31)
            i, j = (i >> 5) % tile, (j >> 5) % tile
            below, beside = (i + 1) % tile, (j + 1) % tile
            # Words wrap round where a difference is negative; the sum is right all the same.
            upper = texels[i, j] * np.uint64(32) + b * (texels[i, beside] - texels[i, j])
            lower = texels[below, j] * np.uint64(32) + b * (texels[below, beside] - texels[below, j])
            colour = upper * np.uint64(32) + a * (lower - upper) + _HALF
            image[row, column, 0] = colour >> np.uint64(10) & _COLOUR
            image[row, column, 1] = colour >> _GREEN + np.uint64(10) & _COLOUR
            image[row, column, 2] = colour >> _BLUE + np.uint64(10) & _COLOUR
