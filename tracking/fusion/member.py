"""Trackers as members of a fleet: their interface, the trackers by name, and the check of those from outside."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from copy import copy, deepcopy
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from tracking.fusion.message import LOG_ODDS, WEIGHT, EndedTrack, Message, Partition
from tracking.fusion.rule import check_novel
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import NO_TREES
from tracking.management.input_check import check_tracks
from tracking.parameters import TrackerParameters
from tracking.plugins.plugin_error import Unusable
from tracking.plugins.registry import Registry
from tracking.plugins.result_check import COVARIANCES, WHOLE, Form, check_fields
from tracking.track import Scan, Track

# Each tracker is made with uav, camera, parameters and initial tracks, as is `tracking.tracker.Tracker`.
TRACKERS = Registry(
    "tracking.tracker",
    {"jpda": "tracking.tracker:Tracker"},
    ("step(scan)", "coast(time)", "message(degree)", "accept(message)"),
)


class Member(Protocol):
    """Tracker of one UAV in a fleet; at each scan `step` or `coast` is called, then `message`, then `accept`.

    In a network that takes time copies of trackers take scans again.
    A tracker from outside needs only the four methods and `tracks`, as any sequence. `make_tracker` wraps it and adds
    the rest. `tracking.fusion.exchange.TrackExchange` makes messages from tracks, and tracks from messages.

    Example:
        ```python
        from understory import TrackExchange

        class Standing:
            def __init__(self, uav, camera, parameters, initial):
                self.tracks = tuple(initial)
                self.exchange = TrackExchange(uav, parameters, initial)

            def step(self, scan):
                self.time = scan.time

            def coast(self, time):
                self.time = time

            def message(self, degree):
                return self.exchange.message(degree, self.time, self.tracks, {})

            def accept(self, message):
                self.tracks = self.exchange.accept(message)
        ```
    """

    def copy(self) -> "Member":
        """A tracker in the same state that goes on by itself."""

    @property
    def uav(self) -> int:
        """Number of the UAV."""

    @property
    def max_speed(self) -> float:
        """Largest speed of people [m/s]."""

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Tracks after the last call, with different ids."""

    def step(self, scan: Scan) -> None:
        """Predict to the time of a scan, and update; an empty scan is a frame without a detection."""

    def coast(self, time: float) -> None:
        """Predict to the time of a scan for which this UAV's camera took no frame."""

    def message(self, degree: int) -> Message:
        """Message for the first round of consensus, to `degree` neighbours."""

    def accept(self, message: Message) -> None:
        """Take over the fleet's tracks from the message after the last round.

        This is the UAV's own message if it has no neighbours.
        """


def step_members(members: Sequence[Member], time: float, scans: Mapping[int, Scan]) -> None:
    """Take the scans at `time` s, by UAV, of those that took a frame; trackers of a kind do so together if they can."""
    if together := _find_together(members, "step_together"):
        together(members, time, scans)
        return
    for member in members:
        if member.uav in scans:
            member.step(scans[member.uav])
        else:
            member.coast(time)


def accept_messages(members: Sequence[Member], messages: Sequence[Message]) -> None:
    """Take over the fleet's tracks from the messages after the last round, likewise."""
    if together := _find_together(members, "accept_together"):
        together(members, messages)
        return
    for member, message in zip(members, messages, strict=True):
        member.accept(message)


def _find_together(members: Sequence[Member], name: str) -> Callable[..., None] | None:
    """The function of a class for several trackers; None if one is of another class, which may override something."""
    kinds = {type(member) for member in members}
    found: Callable[..., None] | None = vars(kinds.pop()).get(name) if len(kinds) == 1 else None
    return found


def make_tracker(
    name: str, uav: int, camera: Camera, parameters: TrackerParameters, initial: Sequence[Track] = ()
) -> Member:
    """The tracker of a UAV; InputError if there is none of that name, or later if its results are unusable.

    The arguments after the name or import string are those of `tracking.tracker.Tracker`.
    """
    made = TRACKERS.make(name, uav, camera, parameters, initial)
    if name in TRACKERS.built_in:
        ours: Member = made
        return ours
    return _CheckedTracker(name, made, uav, parameters.settings.max_speed)


class _CheckedTracker:
    """A tracker from outside; InputError if it fails, or gives unusable tracks or messages."""

    def __init__(self, name: str, made: Any, uav: int, max_speed: float) -> None:  # noqa: ANN401
        self.uav = uav
        self.max_speed = max_speed
        self._name = name
        self._made = made
        self._forest = NO_TREES  # of the last scan, which copies share
        self._scans = 0  # number of scans
        self._time = -math.inf  # s, of the last scan
        with self._errors("give its tracks", "tracks"):
            self.tracks = check_tracks(made.tracks)  # after the last call but `message`, by ascending id

    def copy(self) -> "_CheckedTracker":
        """As `Member.copy`; trackers from outside are copied by `copy.deepcopy`, apart from the last scan's forest."""
        made = copy(self)
        with self._errors("be copied", "__deepcopy__"):
            made._made = deepcopy(self._made, {id(self._forest): self._forest})
        return made

    def step(self, scan: Scan) -> None:
        """As `Member.step`."""
        self._scans += 1
        self._time = scan.time
        self._forest = scan.forest
        self._call("take a scan", "step", deepcopy(scan, {id(scan.forest): scan.forest}))

    def coast(self, time: float) -> None:
        """As `Member.coast`."""
        self._scans += 1
        self._time = time
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


_COLUMNS = {
    "ids": WHOLE,
    "keys": Form((2,), whole="iu"),
    "shares": Form((LOG_ODDS + 1,)),
    "times": Form((4,), unset=True),
    "views": Form((2,), whole="iu"),
    "misses": WHOLE,
    "sightings": Form((3,), unset=True),
}


def check_message(given: object) -> Message:
    """A message from outside with new arrays of the right shapes; `Unusable` if it is no message."""
    if not isinstance(given, Message):
        raise Unusable(f"it is no tracking.fusion.message.Message but {type(given).__name__}")
    count = len(given.ids)
    WHOLE.check("scan", given.scan)
    Form(unset=True).check("time", given.time)
    sent = replace(
        given,
        partition=Partition(*_check_pairs("partition", [given.partition])[0]),
        deleted=tuple(EndedTrack(*ended) for ended in _check_pairs("deleted", given.deleted)),
        novel=check_novel("novel", given.novel, count),
        **check_fields(given, _COLUMNS, count),
    )
    if np.any(np.diff(sent.ids) <= 0):
        raise Unusable("ids are not ascending")
    if count and sent.shares[:, WEIGHT].min() <= 0.0:
        raise Unusable("weights, the first column of shares, are not positive")
    means, covariances = sent.beliefs
    Form((4,)).check("beliefs", means, count)
    COVARIANCES.check("covariances of beliefs", covariances, count)
    return sent


def _check_pairs(name: str, given: Sequence[Any]) -> tuple[tuple[int, float], ...]:
    """Pairs of the number of a UAV or track, whole and at least 0, and a time [s]."""
    Form((2,), unset=True).check(name, [*given] or np.zeros((0, 2)), len(given))
    if any(number < 0 or number != int(number) for number, _ in given):
        raise Unusable(f"{name} are of other numbers than whole ones of at least 0")
    return tuple((int(number), float(time)) for number, time in given)
