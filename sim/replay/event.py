"""One event of a mission: its kind, times and text, and the person, track and UAVs that it concerns."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

KINDS = (
    "breakdown",
    "fault",
    "contact",
    "link lost",
    "link restored",
    "messages lost",  # all of a scan, from one UAV to another
    "messages heard",
    "track born",  # recorded tracks are confirmed ones
    "track taken up",
    "track dropped",
    "track deleted",
    "identity switch",  # a person has another track than before, as CLEAR MOT counts
    "identity transfer",  # a track passes to a person that had none before
    "person not found yet",
    "person lost",
    "person found",
    "false track",
    "duplicate track",
)
UNHELD = ("person not found yet", "person lost")  # people
UNMATCHED = ("false track", "duplicate track")  # tracks
IDENTITIES = ("identity switch", "identity transfer")
INCIDENTS = ("breakdown", "fault", "contact")


@dataclass(frozen=True)
class Event:
    """One event, from one scan to another, both included."""

    kind: str  # one of `KINDS`
    text: str  # tracks under their numbers
    first: int
    last: int
    time: float  # s, of the beginning; a breakdown has its own, which may lie between two scans
    until: float  # s, of the last scan; infinite for an event of several scans that lasts to the end
    why: str = ""
    person: int | None = None
    former: int | None = None  # the person for whom the track stood before
    track: int | None = None  # number
    uavs: tuple[int, ...] = ()  # the one with the most telling frames comes first

    @property
    def sentence(self) -> str:
        """The text and its reason."""
        return f"{self.text}: {self.why}" if self.why else self.text

    @property
    def when(self) -> str:
        """The time or times in words."""
        if self.first == self.last:
            return f"at {self.time:.1f} s"
        if math.isinf(self.until):
            return f"from {self.time:.1f} s to the end"
        return f"{self.time:.1f} to {self.until:.1f} s"


def lanes(events: Sequence[Event]) -> list[tuple[Event, int]]:
    """Events of tracks that stand for no person, each with the first lane that is free, so that none covers another."""
    ends: list[int] = []
    found = []
    for event in (event for event in events if event.kind in UNMATCHED):
        lane = next((n for n, end in enumerate(ends) if end < event.first), len(ends))
        ends[lane : lane + 1] = [event.last]
        found.append((event, lane))
    return found
