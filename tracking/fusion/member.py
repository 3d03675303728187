"""Trackers as members of a fleet: their interface, and the trackers by name."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Protocol

from tracking.plugins.registry import Registry

if TYPE_CHECKING:  # checking a name needs no arithmetic
    from tracking.fusion.message import Message
    from tracking.geometry.camera import Camera
    from tracking.geometry.visibility import Forest
    from tracking.parameters import TrackerParameters
    from tracking.track import Scan, Track

# Each tracker is made with uav, camera, forest, parameters and initial tracks, as is `tracking.tracker.Tracker`.
TRACKERS = Registry(
    "tracking.tracker",
    {"jpda": "tracking.tracker:Tracker"},
    ("step(scan)", "coast(time)", "message(degree)", "accept(message)"),
)


class Member(Protocol):
    """Tracker of one UAV in a fleet; at each scan `step` or `coast` is called, then `message`, then `accept`.

    `tracking.fusion.exchange.TrackExchange` makes messages from tracks, and tracks from messages.
    """

    @property
    def uav(self) -> int:
        """Number of the UAV; trackers from outside need not have this attribute."""

    @property
    def max_speed(self) -> float:
        """Largest speed of people [m/s]; trackers from outside need not have this attribute."""

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Tracks after the last call, with different ids; trackers from outside may give any sequence of tracks."""

    def step(self, scan: Scan) -> None:
        """Predict to the time of a scan, and update; an empty scan is a frame without a detection."""

    def coast(self, time: float) -> None:
        """Predict to the time of a scan for which this UAV's camera took no frame."""

    def message(self, degree: int) -> Message:
        """Message for the first round of consensus, to `degree` neighbours."""

    def accept(self, message: Message) -> None:
        """Take over the fleet's tracks from the message after the last round, which without neighbours is the own."""


def tracker(
    name: str, uav: int, camera: Camera, forest: Forest, parameters: TrackerParameters, initial: Sequence[Track] = ()
) -> Member:
    """The tracker of that name or import string; InputError if there is none, or later if its results are unusable.

    A tracker from outside gets copies of camera and forest, so that its changes to them affect no other.
    """
    if name in TRACKERS.built_in:
        ours: Member = TRACKERS.make(name, uav, camera, forest, parameters, initial)
        return ours
    from tracking.fusion.checked_tracker import CheckedTracker

    made = TRACKERS.make(name, uav, *deepcopy((camera, forest)), parameters, initial)
    return CheckedTracker(name, made, uav, parameters.max_speed)
