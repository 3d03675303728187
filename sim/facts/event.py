"""One event of a mission: its kind, times and text, and the person, track and UAVs that it concerns.

A scan represents the time until the next scan; the last scan lasts as long as the previous
one. A state at the scans k to m therefore lasts m - k + 1 scans, from the instant of scan k to that of scan m + 1.
Timeline, page, `understory explain`, tables, Rerun and film all follow this rule.
"""

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from tracking.numerics.arrays import Array

KINDS = (
    "breakdown",
    "fault",
    "contact",
    "link lost",
    "link restored",
    "messages lost",  # all messages of a scan from one UAV to another
    "messages heard",
    "track born",  # only tracks that are confirmed or known at the start are recorded
    "track received",  # by a UAV, of a track that others have or had
    "track dropped",  # by a UAV, while others have it
    "track deleted",  # by the last UAVs that have it
    "identity switch",  # a person has a different track than before, as counted by CLEAR MOT
    "identity transfer",  # a track passes to a person who had none before
    "person not found yet",
    "person lost",
    "person off",  # more than `loss_distance`, inside the track's 95 % ellipse
    "person found",
    "hand-off",  # another UAV detects a person than the one that did last
    "track held",  # by any UAV, where people are unknown
    "false track",
    "duplicate track",
)
UNHELD = ("person lost", "person not found yet", "person off")  # states of `HOLDS` in which no UAV holds people
UNMATCHED = ("false track", "duplicate track")  # tracks
IDENTITIES = ("identity switch", "identity transfer")
INCIDENTS = ("breakdown", "fault", "contact")
_CAUSES = "too far, cut or not there"
_MOST_OUTAGES = 10  # lines about links that are lost
_MOST_PAIRS = 6  # pairs of UAVs named in one line
_Pair = tuple[int, int]
_Span = tuple[int, int]  # first and last scan


@dataclass(frozen=True)
class Event:
    """One event, from a first to a last scan, both included."""

    kind: str  # one of `KINDS`
    text: str  # description, with numbered tracks
    first: int
    last: int
    time: float  # s, beginning; that of a breakdown may lie between two scans
    # s, of the end: `time` for what takes no time, infinite for a state that lasts to the end; of contacts and faults
    # that of the last one
    until: float
    why: str = ""
    person: int | None = None
    former: int | None = None  # person for whom the track stood before
    track: int | None = None  # number
    uavs: tuple[int, ...] = ()  # the one with the most informative frames comes first
    scans: tuple[int, ...] = ()  # of `UNHELD` kinds, as `people.Unheld` has them

    @property
    def sentence(self) -> str:
        """The text together with its reason."""
        return f"{self.text}: {self.why}" if self.why else self.text

    @property
    def when(self) -> str:
        """The time or times in words."""
        return format_times(self.time, self.until)


def find_ends(times: Array, first: int, last: int) -> tuple[float, float]:
    """Beginning and end [s] of the time that a first to a last scan represent, both included; times (K,) s.

    If a mission has a single scan, it represents one second.
    """
    if last + 1 < len(times):
        return float(times[first]), float(times[last + 1])
    return float(times[first]), float(times[-1] + (times[-1] - times[-2] if len(times) > 1 else 1.0))


def make_lasting_event(times: Array, span: tuple[int, int], kind: str, text: str, **concerned: Any) -> Event:  # noqa: ANN401 - fields of Event
    """An event that lasts from a first to a last scan, both included; times (K,) s."""
    return Event(kind, text, *span, *find_lasting_ends(times, *span), **concerned)


def find_lasting_ends(times: Array, first: int, last: int) -> tuple[float, float]:
    """Beginning and end [s] as for texts: the end is infinite if the last scan is the last of the mission."""
    begin, end = find_ends(times, first, last)
    return begin, math.inf if last == len(times) - 1 else end


def format_times(begin: float, end: float) -> str:
    """Times [s] in words; an infinite end means the mission's end."""
    if math.isinf(end):
        return f"from {begin:.1f} s to the end"
    first, last = f"{begin:.1f}", f"{end:.1f}"
    return f"at {first} s" if first == last else f"{first} to {last} s"


def sort_by_severity(events: Iterable[Event]) -> list[Event]:
    """Events of `UNHELD` kinds in this order, those for longest without a track first; then other events by time."""
    order = {kind: n for n, kind in enumerate(UNHELD)}
    return sorted(events, key=lambda event: (order.get(event.kind, 3), [-n for n in event.scans], event.time))


def assign_lanes(events: Sequence[Event]) -> list[tuple[Event, int]]:
    """Events of tracks that stand for no person, or that are held where people are unknown, each with its lane.

    In a drawing no two overlap.
    """
    ends: list[int] = []
    found = []
    for event in (event for event in events if event.kind in (*UNMATCHED, "track held")):
        lane = next((n for n, end in enumerate(ends) if end < event.first), len(ends))
        ends[lane : lane + 1] = [event.last]
        found.append((event, lane))
    return found


def summarise_outages(events: Sequence[Event], times: Array, also: Collection[str] = ()) -> list[Event]:
    """Events of all times without a link, sorted by time; pairs of UAVs with the same times share one.

    Of more than ten such events the nine with the longest times are kept, and one is about all other pairs. events:
    those of a mission, of which the kinds `also` are added; times (K,) s.
    """
    alike = defaultdict(list)
    for pair, outages in _find_outages(events, times).items():
        alike[tuple(outages)].append(pair)
    longest = sorted(alike, key=lambda outages: sum(last + 1 - first for first, last in outages), reverse=True)
    named = len(longest) if len(longest) <= _MOST_OUTAGES else _MOST_OUTAGES - 1
    found = [event for event in events if event.kind in also]
    for own in longest[:named]:
        text = f"no link between {_name_pairs(alike[own])}"
        if len(own) > 1:
            seconds = sum(end - begin for begin, end in (find_ends(times, *outage) for outage in own))
            text += f", {len(own)} times, {seconds:.1f} s in all"
        found.append(_make_outage(times, (own[0][0], own[-1][1]), text))
    if rest := longest[named:]:
        pairs = sum(len(alike[own]) for own in rest)
        span = min(own[0][0] for own in rest), max(own[-1][1] for own in rest)
        found.append(_make_outage(times, span, f"no link at times between {pairs} more pairs of UAVs"))
    return sorted(found, key=lambda event: event.time)


def list_outages_at(events: Sequence[Event], times: Array, k: int) -> list[Event]:
    """Events of UAVs without a link at scan k, and from when to when, the longest first."""
    now = defaultdict(list)
    for pair, outages in _find_outages(events, times).items():
        for first, last in outages:
            if first <= k <= last:
                now[first, last].append(pair)
    most = sorted(now, key=lambda span: (span[0], -span[1]))
    return [_make_outage(times, span, f"no link between {_name_pairs(now[span])}") for span in most]


def _find_outages(events: Iterable[Event], times: Array) -> dict[_Pair, list[_Span]]:
    """The outages of each pair of UAVs that has any; that of a UAV which breaks down ends with it."""
    begun: dict[_Pair, int] = {}
    found = defaultdict(list)
    for event in sorted(events, key=lambda event: event.first):
        if event.kind == "link lost":
            begun[min(event.uavs), max(event.uavs)] = event.first
        elif event.kind in ("link restored", "breakdown"):
            for pair in [pair for pair in begun if set(event.uavs) <= set(pair)]:
                found[pair].append((begun.pop(pair), event.first - 1))
    for pair, first in begun.items():
        found[pair].append((first, len(times) - 1))
    return found


def _make_outage(times: Array, span: _Span, text: str) -> Event:
    return make_lasting_event(times, span, "link lost", text, why=_CAUSES)


def _name_pairs(pairs: Sequence[_Pair]) -> str:
    named = [f"{i} and {j}" for i, j in sorted(pairs)[:_MOST_PAIRS]]
    more = len(pairs) - len(named)
    return f"UAVs {', '.join(named)}" + (f", and {more} more pair{'s' * (more > 1)}" if more else "")
