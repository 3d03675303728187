"""Connected components of a person's colour in an image."""

import numpy as np
from numpy.typing import NDArray

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled

# Hi-vis orange in any light: red is above 1.5 times green and twice blue. Noise in dark places has such ratios, but
# smaller differences. So red exceeds green by `_FAINT` grey levels in all of a component, and by `_SURE` in some of it.
_FAINT, _SURE = 20, 40


def find_components(image: NDArray[np.uint8]) -> list[Array]:
    """Pixel centres (K, 2), row after row, of each 8-connected component in a person's colour.

    The image (H, W, 3) is RGB. Components are in the order of a search from the top by cells of two by two pixels.
    """
    pixels, ends = _find_components(np.ascontiguousarray(image))
    return [pixels[start:end] for start, end in zip([0, *ends], ends, strict=False)]


@compiled
def _find_components(image: NDArray[np.uint8]) -> tuple[Array, list[int]]:
    """Pixel centres (M, 2) of all components, and the end of each."""
    mask, left = _mark_colour(image)
    todo, found = np.empty(left, dtype=np.int64), np.empty(left, dtype=np.int64)
    width = mask.shape[1]
    flat = mask.ravel()
    ends = [0 for _ in range(0)]
    end = 0
    for row in range(2, mask.shape[0] - 2, 2):
        if left == 0:
            break
        for cell in range(row * width + 2, (row + 1) * width - 2, 2):
            for seed in (cell, cell + 1, cell + width, cell + width + 1):
                if flat[seed] > 0:
                    size, sure = _take_component(flat, (seed, width), todo, found[end:])
                    left -= size
                    if sure:
                        end += size
                        ends.append(end)
    pixels = np.empty((end, 2))
    for k in range(end):
        pixels[k, 0], pixels[k, 1] = found[k] % width - 1.5, found[k] // width - 1.5
    return pixels, ends


@compiled
def _mark_colour(image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int]:
    """Mask of a person's colour (1, or 2 if sure) in an image (H, W, 3), with a border of 2 pixels; and its count."""
    rows, columns, _ = image.shape
    mask = np.zeros((rows + 4, columns + 4), dtype=np.uint8)
    count = 0
    for i in range(rows):
        for j in range(columns):
            red, green = np.int64(image[i, j, 0]), np.int64(image[i, j, 1])
            if red - green >= _FAINT and 2 * red > 3 * green and red > 2 * np.int64(image[i, j, 2]):
                mask[i + 2, j + 2] = 2 if red - green >= _SURE else 1
                count += 1
    return mask, count


@compiled
def _take_component(mask: NDArray[np.uint8], start: tuple[int, int], todo: Indices, out: Indices) -> tuple[int, bool]:
    """Move the component at start (index, width of a row) from a flat mask to `out`; its size, and if it is sure."""
    seed, width = start
    sure = mask[seed] == 2
    mask[seed] = 0
    todo[0], waiting, size = seed, 1, 0
    while waiting > 0:
        waiting -= 1
        at = todo[waiting]
        out[size] = at
        size += 1
        for row in (at - width, at, at + width):
            for next in range(row - 1, row + 2):
                if mask[next] > 0:
                    sure |= mask[next] == 2
                    mask[next] = 0
                    todo[waiting] = next
                    waiting += 1
    out[:size].sort()
    return size, sure
