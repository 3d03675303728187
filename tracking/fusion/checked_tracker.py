"""Checks of the tracks and messages that trackers from outside give, before the fleet uses them."""

import math
from collections.abc import Collection, Sequence
from contextlib import AbstractContextManager
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from tracking.fusion.member import TRACKERS
from tracking.fusion.message import INFORMATION, Message, Partition, check_novel
from tracking.numerics.arrays import Array, Indices
from tracking.plugins.array_checks import check_array, check_numbers, check_positive_definite, check_whole_numbers
from tracking.plugins.plugin_error import Unusable
from tracking.track import Scan, Track, tracks_of

_MOST = 10_000  # tracks of one UAV
_LARGEST_ID = 2**62


class CheckedTracker:
    """A tracker from outside; InputError if it fails, or gives unusable tracks or messages."""

    def __init__(self, name: str, made: Any, uav: int, max_speed: float) -> None:  # noqa: ANN401 - not ours
        self.uav, self.max_speed = uav, max_speed
        self._name, self._made = name, made
        self._scans, self._time = 0, -math.inf  # number of scans, and time of the last [s]
        with self._errors("give its tracks", "tracks"):
            self.tracks = checked_tracks(made.tracks)  # after the last call but `message`, by ascending id

    def step(self, scan: Scan) -> None:
        """As `Member.step`."""
        self._scans, self._time = self._scans + 1, scan.time
        self._call("take a scan", "step", deepcopy(scan))

    def coast(self, time: float) -> None:
        """As `Member.coast`."""
        self._scans, self._time = self._scans + 1, time
        self._call("coast", "coast", time)

    def message(self, degree: int) -> Message:
        """As `Member.message`."""
        with self._errors("give a message", "message"):
            given = checked_message(self._made.message(degree))
            if (given.scan, given.time) != (self._scans, self._time):
                here = f"scan {self._scans} at {self._time} s"
                raise Unusable(f"it is of scan {given.scan} at {given.time} s, not of {here}")
            return replace(given, uav=self.uav, degree=degree)

    def accept(self, message: Message) -> None:
        """As `Member.accept`."""
        self._call("accept a message", "accept", deepcopy(message))

    def _call(self, what: str, method: str, given: object) -> None:
        """Call a method, and check the tracks at once, so that an error names the method that caused it."""
        with self._errors(what, method):
            getattr(self._made, method)(given)
        with self._errors(f"give its tracks after {method}", method):
            self.tracks = checked_tracks(self._made.tracks)

    def _errors(self, what: str, method: str) -> AbstractContextManager[None]:
        return TRACKERS.errors(self._name, what, self._made, method)


def checked_tracks(given: Collection[Any]) -> tuple[Track, ...]:
    """Copies of tracks from outside by ascending id; `Unusable` if they are no tracks."""
    ids, tracks = np.sort(track_ids(given)), sorted(given, key=lambda track: int(track.id))
    means, covariances, existence = track_beliefs(tracks)
    check_positive_definite("covariances of tracks", covariances)
    return tracks_of(ids, means, covariances, existence, _sightings(tracks))


def _sightings(tracks: Sequence[Any]) -> Array:
    """Sightings (T, 3) of tracks, NaN for a track without one; `Unusable` unless they are numbers."""
    nowhere = np.full(3, np.nan)
    given = [getattr(track, "sighting", nowhere) for track in tracks] or np.zeros((0, 3))
    found = check_numbers("sightings of tracks", given)
    if found.shape != (len(tracks), 3):
        raise Unusable(f"sightings of tracks are no table ({len(tracks)}, 3) of numbers")
    found[~np.isfinite(found).all(axis=1)] = np.nan
    return found


def track_ids(tracks: Collection[Any]) -> Indices:
    """Ids (T,) of tracks; `Unusable` unless all are tracks, with different ids that are whole numbers of at least 0."""
    if not isinstance(tracks, Collection):
        raise Unusable(f"tracks are no sequence but {type(tracks).__name__}")
    for track in tracks:
        if lacking := [part for part in ("id", "belief", "existence") if not hasattr(track, part)]:
            needed = "a track is an object with id, belief and existence, as tracking.track.Track"
            raise Unusable(f"among tracks is a {type(track).__name__} without {lacking[0]}; {needed}")
    if len(tracks) > _MOST:
        raise Unusable(f"{len(tracks)} tracks are more than {_MOST}")
    ids = [track.id for track in tracks]
    if not all(isinstance(id, int | np.integer) and 0 <= id < _LARGEST_ID for id in ids):
        raise Unusable(f"ids of tracks are not whole numbers of at least 0: {ids[:10]}")
    twice = sorted({int(id) for id in ids if ids.count(id) > 1})
    if twice:
        raise Unusable(f"ids of tracks are there twice: {twice[:10]}")
    return np.array(ids, dtype=np.int64)


def track_beliefs(tracks: Sequence[Any]) -> tuple[Array, Array, Array]:
    """Means (T, 4), covariances (T, 4, 4) and existence (T,) of tracks; `Unusable` unless they are finite numbers."""
    count = len(tracks)
    means = check_array("means of tracks", [t.belief.mean for t in tracks] or np.zeros((0, 4)), (count, 4))
    spreads = [t.belief.covariance for t in tracks] or np.zeros((0, 4, 4))
    covariances = check_array("covariances of tracks", spreads, (count, 4, 4))
    existence = check_array("existence of tracks", [t.existence for t in tracks], (count,))
    if not np.all((existence > 0.0) & (existence <= 1.0)):
        raise Unusable("existence of tracks is not in (0, 1]")
    return means, covariances, existence


def checked_message(given: object) -> Message:
    """A message from outside with arrays of the right shapes; `Unusable` if it is no such message."""
    if not isinstance(given, Message):
        raise Unusable(f"it is no tracking.fusion.message.Message but {type(given).__name__}")
    count = len(given.ids)
    check_whole_numbers("scan", given.scan, ())
    _instants("time", given.time, ())
    sent = replace(
        given,
        partition=Partition(*_numbered("partition", [given.partition])[0]),
        deleted=_numbered("deleted", given.deleted),
        ids=check_whole_numbers("ids", given.ids, (count,)),
        keys=check_whole_numbers("keys", given.keys, (count, 2)),
        shares=check_array("shares", given.shares, (count, INFORMATION + 2)),
        times=_instants("times", given.times, (count, 4)),
        views=check_whole_numbers("views", given.views, (count, 2)),
        misses=check_whole_numbers("misses", given.misses, (count,)),
        sightings=_instants("sightings", given.sightings, (count, 3)),
        novel=check_novel("novel", given.novel, count),
    )
    if np.any(np.diff(sent.ids) <= 0):
        raise Unusable("ids are not ascending")
    if count and sent.shares[:, 0].min() <= 0.0:
        raise Unusable("weights, the first column of shares, are not positive")
    means, covariances = sent.beliefs
    check_array("beliefs", means, (count, 4))
    check_positive_definite("covariances of beliefs", covariances)
    return sent


def _numbered(name: str, given: Sequence[Any]) -> tuple[tuple[int, float], ...]:
    """Pairs of the number of a UAV or track, whole and at least 0, and a time [s]; `Unusable` if they are others."""
    if not len(given):
        return ()
    _instants(name, given, (len(given), 2))
    if any(not 0 <= number < _LARGEST_ID or number != int(number) for number, _ in given):
        raise Unusable(f"{name} are of other numbers than whole ones of at least 0")
    return tuple((int(number), float(time)) for number, time in given)


def _instants(name: str, given: object, shape: tuple[int, ...]) -> Array:
    """Times, or positions and times, which are -inf if there are none yet; `Unusable` if they have another form."""
    found = check_numbers(name, given)
    if found.shape != shape or np.isnan(found).any() or np.any(found == np.inf):
        raise Unusable(f"{name} are no table {shape} of numbers")
    return found
