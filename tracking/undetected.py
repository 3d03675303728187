"""Intensity of undetected people: a Poisson process thinned by negative information of cameras."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import ALL_ROUND, Look
from tracking.geometry.lens import Lens, pixel_ray
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import SAMPLES, Forest, Occluders, see_samples
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.exponential import exp
from tracking.numerics.normal import normal_cdf_each
from tracking.track import Track

_CELL = 5.0  # m, approximate edge of a cell
_SAME = 3.0  # m: a track that ends within this distance of another track was its duplicate


@dataclass(frozen=True, eq=False)
class Intensity:
    """Expected number of undetected people in each cell of a raster over the area."""

    people: Array  # (rows, columns), from south to north and from west to east
    low: tuple[float, float]  # m: the south-west corner
    cell: tuple[float, float]  # m: width and height of a cell

    def centres(self) -> Array:
        """Middles of the cells (rows, columns, 2) m."""
        counts = self.people.shape[::-1]
        x, y = (low + size * (np.arange(n) + 0.5) for low, size, n in zip(self.low, self.cell, counts, strict=True))
        return np.stack(np.meshgrid(x, y), axis=-1)


def raster_shape(area: tuple[float, float]) -> tuple[int, int]:
    """Rows and columns of the raster over an area of width and height [m]."""
    width, height = area
    return math.ceil(height / _CELL), math.ceil(width / _CELL)


class UndetectedIntensity:
    """One UAV's filter of the intensity of undetected people: a Poisson process, predicted and thinned.

    At first `people` are expected evenly over the area; then they spread as walkers do. Each frame thins the intensity
    where the line of sight is free. A track that ends is recycled: its person is added to the intensity.
    Source: [Williams15], the Poisson part.
    Note: a track adds one person, and all people survive. In the source it adds its existence probability, and people
    survive with a probability.
    """

    def __init__(self, area: tuple[float, float], people: float, detection: float, pace: float) -> None:
        """`detection`: probability in plain view; in t s people spread by `pace` sqrt(t) m along each axis."""
        width, height = area
        rows, columns = raster_shape(area)
        even = np.full((rows, columns), people / (rows * columns))
        self.belief = Intensity(even, (-width / 2, -height / 2), (width / columns, height / rows))
        self._detection = detection
        self._pace = pace
        self._time = 0.0
        self._tracks: dict[int, Gaussian] = {}

    def step(self, time: float, frames: Sequence[Look], tracks: Sequence[Track], forest: Forest) -> None:
        """Predict to a time [s] and thin by frames (camera and pose each); tracks contain the frames' detections."""
        elapsed, self._time = time - self._time, time
        people = self.belief.people
        if elapsed > 0.0 and people.any():
            sigma = self._pace * math.sqrt(elapsed)
            width, height = self.belief.cell
            people = np.ascontiguousarray(_blur(people, sigma / height).T)
            people = _blur(people, sigma / width).T  # reflection keeps all people in the area
        people = people + self._recycle(tracks)
        for camera, pose in frames if people.any() else ():
            outline = camera.outline if camera.fov < ALL_ROUND else np.zeros((0, 2))
            thinned, raster = people.copy(), (self.belief.low, self.belief.cell)
            if _thin(thinned, *raster, outline, camera.lens(pose), self._detection, forest.occluders):
                people = thinned
        self.belief = Intensity(people, self.belief.low, self.belief.cell)
        self._tracks = {track.id: track.belief for track in tracks}

    def _recycle(self, tracks: Sequence[Track]) -> Array | float:
        """Expected people (rows, columns) of tracks that have ended since the last step."""
        held = {track.id for track in tracks}
        places = np.array([track.belief.mean[:2] for track in tracks]).reshape(-1, 2)
        back: Array | float = 0.0
        for id, belief in self._tracks.items():
            if id not in held and not (length(places - belief.mean[:2]) <= _SAME).any():
                back = back + self._spread(belief)
        return back

    def _spread(self, belief: Gaussian) -> Array:
        """Probabilities (rows, columns) of cells for a person with a belief, without correlation; their sum is one."""
        rows, columns = self.belief.people.shape
        shares = []
        for axis, count in ((1, rows), (0, columns)):
            edges = self.belief.low[axis] + self.belief.cell[axis] * np.arange(count + 1)
            deviation = math.sqrt(belief.covariance[axis, axis]) + 1e-9
            place = min(max(float(belief.mean[axis]), edges[0]), edges[-1])
            share = np.diff(normal_cdf_each((edges - place) / deviation))
            share = share if share.any() else np.ones(count)  # so wide that the cells are nothing in it
            shares.append(share / share.sum())
        return np.outer(*shares)


@compiled
def _thin(
    people: Array,
    low: tuple[float, float],
    cell: tuple[float, float],
    outline: Array,
    lens: Lens,
    detection: float,
    occluders: Occluders,
) -> bool:
    """Thin expected people (rows, columns), in place, by a frame that shows no undetected person; False if none may be.

    low and cell as in `Intensity`; outline (N, 2): pixels around the image, none of a view all round.
    """
    found = False
    first, last = _find_window(people.shape, low, cell, outline, lens)
    mean, spread = np.empty((1, 2)), np.zeros((1, 2, 2))
    for axis in range(2):
        spread[0, axis, axis] = cell[axis] * cell[axis] / 12.0  # variance of a uniform distribution over a cell
    for row in range(first[1], last[1]):
        for column in range(first[0], last[0]):
            if people[row, column] != 0.0:
                mean[0, 0], mean[0, 1] = low[0] + cell[0] * (column + 0.5), low[1] + cell[1] * (row + 0.5)
                share = np.sum(see_samples(mean, spread, lens, occluders)) / len(SAMPLES)
                people[row, column] *= 1.0 - detection * share
                found = True
    return found


@compiled
def _find_window(
    shape: tuple[int, int], low: tuple[float, float], cell: tuple[float, float], outline: Array, lens: Lens
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Column and row of the first cell that an image may show, and those after the last."""
    whole = (0, 0), (shape[1], shape[0])
    if len(outline) == 0:
        return whole
    west = south = math.inf
    east = north = -math.inf
    for k in range(len(outline)):
        ray = pixel_ray(lens, outline[k, 0], outline[k, 1])
        down = TARGET_HEIGHT - lens.eye[2]
        if not ray[2] * down > 0.0:  # above the horizon
            return whole
        x, y = lens.eye[0] + down / ray[2] * ray[0], lens.eye[1] + down / ray[2] * ray[1]
        west, east, south, north = min(west, x), max(east, x), min(south, y), max(north, y)
    columns = _find_cells(west, east, low[0], cell[0], shape[1])
    rows = _find_cells(south, north, low[1], cell[1], shape[0])
    return (columns[0], rows[0]), (columns[1], rows[1])


@compiled
def _find_cells(least: float, most: float, low: float, size: float, count: int) -> tuple[int, int]:
    """The first cell with places from `least` to `most`, and the one after the last."""
    first, last = (least - low) / size, (most - low) / size  # may be far away
    begin = math.floor(min(max(first, 0.0), count))
    return begin, min(max(math.floor(min(max(last, -1.0), count)) + 1, begin), count)


@compiled
def _blur(rows: Array, sigma: float) -> Array:
    """A raster (N, M) convolved along its first axis with a Gaussian of `sigma` rows, reflected at its edges."""
    if not sigma > 0.0:
        return rows.copy()
    reach = int(4.0 * sigma + 0.5)
    kernel = np.empty(2 * reach + 1)
    for k in range(len(kernel)):
        kernel[k] = exp(-0.5 * ((k - reach) / sigma) * ((k - reach) / sigma))
    kernel /= kernel.sum()
    out = np.zeros(rows.shape)
    for i in range(len(rows)):
        for k in range(len(kernel)):
            at = (i + k - reach) % (2 * len(rows))
            source = rows[at] if at < len(rows) else rows[2 * len(rows) - 1 - at]
            for j in range(rows.shape[1]):
                out[i, j] += kernel[k] * source[j]
    return out
