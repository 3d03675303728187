"""One event of a mission: its kind, times and text, and the person, track and UAVs that it concerns.

A scan stands for the time from its instant until that of the next, the last scan for as long as the one before it. So a
state that a person or a track has at the scans k to m lasts m - k + 1 scans, from the instant of scan k to that of
scan m + 1. Timeline, page, `understory explain`, tables and Rerun tell and draw it so, and the film shows it so.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tracking.numerics.arrays import Array

KINDS = (
    "breakdown",
    "fault",
    "contact",
    "link lost",
    "link restored",
    "messages lost",  # all of a scan, from one UAV to another
    "messages heard",
    "track born",  # recorded tracks are confirmed ones, or known at the start
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
    # s, of the end: `time` for what takes no time, infinite for a state that lasts to the end; of contacts and faults
    # that of the last one
    until: float
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
        return when_text(self.time, self.until)


def ends(times: Array, first: int, last: int) -> tuple[float, float]:
    """Beginning and end [s] of the time that scans stand for, from one to another, both included; times (K,) s.

    The only scan of a mission stands for a second.
    """
    if last + 1 < len(times):
        return float(times[first]), float(times[last + 1])
    return float(times[first]), float(times[-1] + (times[-1] - times[-2] if len(times) > 1 else 1.0))


def lasting(times: Array, first: int, last: int) -> tuple[float, float]:
    """The same for words: a state at the last scan of a mission has no end, which is infinite."""
    begin, end = ends(times, first, last)
    return begin, math.inf if last == len(times) - 1 else end


def when_text(begin: float, end: float) -> str:
    """Times [s] in words; an infinite end is that of the mission."""
    if math.isinf(end):
        return f"from {begin:.1f} s to the end"
    return f"at {begin:.1f} s" if begin == end else f"{begin:.1f} to {end:.1f} s"


def lanes(events: Sequence[Event]) -> list[tuple[Event, int]]:
    """Events of tracks that stand for no person, each with the first lane that is free, so that none covers another."""
    ends: list[int] = []
    found = []
    for event in (event for event in events if event.kind in UNMATCHED):
        lane = next((n for n, end in enumerate(ends) if end < event.first), len(ends))
        ends[lane : lane + 1] = [event.last]
        found.append((event, lane))
    return found
