"""Trackers by name; those from outside are checked whenever they give tracks or messages to the fleet."""

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from copy import copy, deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from tracking.fusion.member import TRACKERS, Member
from tracking.fusion.message import LOG_ODDS, WEIGHT, Message, Partition, check_novel
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import Forest
from tracking.management.track_check import check_tracks
from tracking.numerics.arrays import Array
from tracking.parameters import TrackerParameters
from tracking.plugins.array_checks import check_array, check_numbers, check_positive_definite, check_whole_numbers
from tracking.plugins.plugin_error import Unusable
from tracking.track import Scan, Track


def make_tracker(
    name: str, uav: int, camera: Camera, forest: Forest, parameters: TrackerParameters, initial: Sequence[Track] = ()
) -> Member:
    """The tracker of that name or import string; InputError if there is none, or later if its results are unusable."""
    made = TRACKERS.make(name, uav, camera, forest, parameters, initial)
    ours: Member = made if name in TRACKERS.built_in else CheckedTracker(name, made, uav, parameters.max_speed, forest)
    return ours


class CheckedTracker:
    """A tracker from outside; InputError if it fails, or gives unusable tracks or messages."""

    def __init__(self, name: str, made: Any, uav: int, max_speed: float, forest: Forest) -> None:  # noqa: ANN401
        self.uav, self.max_speed = uav, max_speed
        self._name, self._made, self._forest = name, made, forest
        self._scans, self._time = 0, -math.inf  # number of scans, and time of the last [s]
        with self._errors("give its tracks", "tracks"):
            self.tracks = check_tracks(made.tracks)  # after the last call but `message`, by ascending id

    def copy(self) -> "CheckedTracker":
        """As `Member.copy`; trackers from outside are copied by `copy.deepcopy`, apart from the map."""
        made = copy(self)
        with self._errors("be copied", "__deepcopy__"):
            made._made = deepcopy(self._made, {id(self._forest): self._forest})
        return made

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
            given = check_message(self._made.message(degree))
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
            self.tracks = check_tracks(self._made.tracks)

    def _errors(self, what: str, method: str) -> AbstractContextManager[None]:
        return TRACKERS.errors(self._name, what, self._made, method)


def check_message(given: object) -> Message:
    """Return a message from outside with new arrays of the right shapes; raise `Unusable` if it is no message."""
    if not isinstance(given, Message):
        raise Unusable(f"it is no tracking.fusion.message.Message but {type(given).__name__}")
    count = len(given.ids)
    check_whole_numbers("scan", given.scan, ())
    _check_instants("time", given.time, ())
    sent = replace(
        given,
        partition=Partition(*_check_pairs("partition", [given.partition])[0]),
        deleted=_check_pairs("deleted", given.deleted),
        ids=check_whole_numbers("ids", given.ids, (count,)),
        keys=check_whole_numbers("keys", given.keys, (count, 2)),
        shares=check_array("shares", given.shares, (count, LOG_ODDS + 1)),
        times=_check_instants("times", given.times, (count, 4)),
        views=check_whole_numbers("views", given.views, (count, 2)),
        misses=check_whole_numbers("misses", given.misses, (count,)),
        sightings=_check_instants("sightings", given.sightings, (count, 3)),
        novel=check_novel("novel", given.novel, count),
    )
    if np.any(np.diff(sent.ids) <= 0):
        raise Unusable("ids are not ascending")
    if count and sent.shares[:, WEIGHT].min() <= 0.0:
        raise Unusable("weights, the first column of shares, are not positive")
    means, covariances = sent.beliefs
    check_array("beliefs", means, (count, 4))
    check_positive_definite("covariances of beliefs", covariances)
    return sent


def _check_pairs(name: str, given: Sequence[Any]) -> tuple[tuple[int, float], ...]:
    """Return pairs of the number of a UAV or track, whole and at least 0, and a time [s]."""
    _check_instants(name, [*given] or np.zeros((0, 2)), (len(given), 2))
    if any(number < 0 or number != int(number) for number, _ in given):
        raise Unusable(f"{name} are of other numbers than whole ones of at least 0")
    return tuple((int(number), float(time)) for number, time in given)


def _check_instants(name: str, given: object, shape: tuple[int, ...]) -> Array:
    """Return times, or positions and times, which are -inf if there are none yet."""
    found = check_numbers(name, given)
    if found.shape != shape or np.isnan(found).any() or np.any(found == np.inf):
        raise Unusable(f"{name} are not numbers of shape {shape}")
    return found
