"""Intensity of undetected people: a Poisson process thinned by negative information of cameras."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import ALL_ROUND, Camera, Look, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, visible_samples
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
            people = self._thin(people, camera, pose, forest)
        self.belief = Intensity(people, self.belief.low, self.belief.cell)
        self._tracks = {track.id: track.belief for track in tracks}

    def _thin(self, people: Array, camera: Camera, pose: Pose, forest: Forest) -> Array:
        """Expected people (rows, columns) after a frame that shows no undetected person."""
        window, cell = self._find_window(camera, pose), np.array(self.belief.cell)
        if people[window].any():
            centres = self.belief.centres()[window]
            each = centres.reshape(-1, 2)
            # Variance of a uniform distribution over a cell.
            evenly = np.tile(np.diag(np.square(cell) / 12.0), (len(each), 1, 1))
            share = visible_samples(forest, each, evenly, camera.lens(pose))[:, 0].mean(axis=1)
            people = people.copy()
            people[window] *= 1.0 - self._detection * share.reshape(centres.shape[:2])
        return people

    def _find_window(self, camera: Camera, pose: Pose) -> tuple[slice, slice]:
        """Rows and columns of the cells that a camera may see."""
        shown = camera.footprint(pose, TARGET_HEIGHT) if camera.fov < ALL_ROUND else np.full((4, 2), np.nan)
        if np.isnan(shown).any():  # the view is all round or reaches above the horizon
            return slice(None), slice(None)
        low, cell = np.array(self.belief.low), np.array(self.belief.cell)
        first = np.maximum(((shown.min(axis=0) - low) // cell).astype(int), 0)
        last = np.maximum(((shown.max(axis=0) - low) // cell).astype(int) + 1, first)
        return slice(first[1], last[1]), slice(first[0], last[0])

    def _recycle(self, tracks: Sequence[Track]) -> Array | float:
        """Expected people (rows, columns) of tracks that have ended since the last step."""
        held = {track.id for track in tracks}
        places = np.array([track.belief.mean[:2] for track in tracks]).reshape(-1, 2)
        back: Array | float = 0.0
        for id, belief in self._tracks.items():
            near = length(places - belief.mean[:2]) <= _SAME
            if id not in held and not near.any():
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
