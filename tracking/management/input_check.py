"""Check of what a tracker is given: scans, and tracks from outside."""

import math
from collections.abc import Collection
from typing import Any

import numpy as np

from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.plugins.plugin_error import Unusable
from tracking.plugins.result_check import COVARIANCES, WHOLE, Form, read_numbers
from tracking.track import Scan, Track, make_tracks

_PARTS = ("id", "belief", "existence")
# Largest difference of a covariance's off-diagonal elements, by rounding, as a share of its trace.
_ASYMMETRY = 1e-9
_TOLERANCE = 1e-6  # largest difference of a quaternion's norm from one


def check_tracks(given: Collection[Any]) -> tuple[Track, ...]:
    """Copies of tracks by ascending id; `Unusable`, a ValueError, if they are no tracks."""
    if not isinstance(given, Collection):
        raise Unusable(f"tracks are no sequence but {type(given).__name__}")
    for track in given:
        if lacking := [part for part in _PARTS if not hasattr(track, part)]:
            needed = "a track is an object with id, belief and existence, as tracking.track.Track"
            raise Unusable(f"among tracks is a {type(track).__name__} without {lacking[0]}; {needed}")
    count, ids = len(given), [track.id for track in given]
    numbers = WHOLE.check("ids of tracks", ids, count)
    if numbers.min(initial=0) < 0:
        raise Unusable(f"ids of tracks are below 0: {ids[:10]}")
    if twice := sorted({id for id in ids if ids.count(id) > 1}):
        raise Unusable(f"ids of tracks are there twice: {twice[:10]}")
    tracks = sorted(given, key=lambda track: int(track.id))
    means = Form((4,)).check("means of tracks", [t.belief.mean for t in tracks] or np.zeros((0, 4)), count)
    spreads = [t.belief.covariance for t in tracks] or np.zeros((0, 4, 4))
    covariances = COVARIANCES.check("covariances of tracks", spreads, count)
    existence = Form().check("existence of tracks", [t.existence for t in tracks], count)
    if not np.all((existence > 0.0) & (existence <= 1.0)):
        raise Unusable("existence of tracks is not in (0, 1]")
    unknown = np.full(3, np.nan)
    seen = read_numbers("sightings of tracks", [getattr(t, "sighting", unknown) for t in tracks] or np.zeros((0, 3)))
    if seen.shape != (count, 3):
        raise Unusable(f"sightings of tracks of shape {seen.shape}, not ({count}, 3)")
    seen[~np.isfinite(seen).all(axis=1)] = np.nan
    return make_tracks(np.sort(numbers), means, covariances, existence, seen)


def check_scan(scan: Scan) -> tuple[Array, Array]:
    """Measurements (N, 2) and covariances (N, 2, 2) of a scan as contiguous floats, after its validation.

    Raises ValueError for invalid values, which would lead to tracks that are NaN.
    """
    z, R = _read_floats("measurements", scan.measurements), _read_floats("covariances", scan.covariances)
    if not math.isfinite(scan.time):
        raise ValueError(f"time of a scan must be finite, is {scan.time}")
    _check_pose(scan.pose)
    if z.ndim != 2 or z.shape[1] != 2:
        raise ValueError(f"measurements of a scan must be (N, 2), are {z.shape}")
    if R.shape != (len(z), 2, 2):
        raise ValueError(f"covariances of a scan of {len(z)} measurements must be ({len(z)}, 2, 2), are {R.shape}")
    wrong = _find_first_wrong(z, R)
    if wrong < 0:
        return z, R
    if not np.isfinite(z[wrong]).all():
        raise ValueError(f"measurements[{wrong}] must be finite, is {z[wrong].tolist()}")
    raise ValueError(f"covariances[{wrong}] must be finite, symmetric and positive definite, is {R[wrong].tolist()}")


def _check_pose(pose: Pose) -> None:
    position = _read_floats("pose.position", pose.position)
    quaternion = _read_floats("pose.quaternion", pose.quaternion)
    if position.shape != (3,) or not all(map(math.isfinite, position.tolist())):
        raise ValueError(f"pose.position of a scan must be three finite numbers, is {position.tolist()}")
    if (
        quaternion.shape != (4,)
        or not abs(math.sqrt(math.fsum(q * q for q in quaternion.tolist())) - 1.0) <= _TOLERANCE
    ):
        raise ValueError(f"pose.quaternion of a scan must be four numbers of norm 1, is {quaternion.tolist()}")


def _read_floats(name: str, values: Array) -> Array:
    try:
        return np.ascontiguousarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} of a scan must be an array of numbers, are {values!r}") from error


@compiled
def _find_first_wrong(z: Array, R: Array) -> int:
    """Index of the first invalid measurement or covariance, -1 for none."""
    for j in range(len(z)):
        xx, xy, yx, yy = R[j, 0, 0], R[j, 0, 1], R[j, 1, 0], R[j, 1, 1]
        definite = xx > 0.0 and xx * yy - xy * yx > 0.0 and xx + yy < np.inf
        if not (definite and abs(xy - yx) <= _ASYMMETRY * (xx + yy) and abs(z[j, 0]) + abs(z[j, 1]) < np.inf):
            return j
    return -1
