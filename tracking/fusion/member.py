"""Trackers as members of a fleet: their interface, and the trackers by name."""

from typing import Protocol

from tracking.fusion.message import Message
from tracking.plugins.registry import Registry
from tracking.track import Scan, Track

# Each tracker is made with uav, camera, forest, parameters and initial tracks, as is `tracking.tracker.Tracker`.
TRACKERS = Registry(
    "tracking.tracker",
    {"jpda": "tracking.tracker:Tracker"},
    ("step(scan)", "coast(time)", "message(degree)", "accept(message)"),
)


class Member(Protocol):
    """Tracker of one UAV in a fleet; at each scan `step` or `coast` is called, then `message`, then `accept`.

    In a network that takes time copies of trackers take scans again.
    A tracker from outside needs only the four methods and `tracks`, as any sequence. `CheckedTracker` wraps it and adds
    the rest. `tracking.fusion.exchange.TrackExchange` makes messages from tracks, and tracks from messages.
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
