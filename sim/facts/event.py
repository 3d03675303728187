"""One event of a mission: its kind, times and text, and the person, track and UAVs that it concerns.

A scan represents the time until the next scan, and the last one none: the mission ends with it. A state at the scans
k to m therefore lasts from the instant of scan k to that of scan m + 1, or to the end.
Timeline, page, `understory explain`, tables, Rerun and film all follow this rule.
"""

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sim.facts.metrics.holding import GRADES
from tracking.numerics.arrays import Array

UNHELD = tuple(f"person {grade}" for grade in GRADES)
KINDS = (
    "breakdown",
    "fault",
    "contact",
    "link lost",
    "link restored",
    "messages lost",  # all messages of scans from one UAV to another, over a link
    "messages heard",
    "track born",  # only tracks that are confirmed or known at the start are recorded
    "track received",  # by a UAV, of a track that others have or had
    "track dropped",  # by a UAV, while others have it
    "track deleted",  # by the last UAVs that have it
    "identity switch",  # a person has a different track than before, as counted by CLEAR MOT
    "identity transfer",  # a track passes to a person who had none before
    *UNHELD,
    "person found",
    "person left",  # the area
    "person came",  # into the area, perhaps again
    "hand-off",  # another UAV detects a person than the one that did last
    "tree met",  # by a UAV that has it on its map from others
    "track held",  # by any UAV, where people are unknown
    "false track",
    "duplicate track",
)
UNMATCHED = ("false track", "duplicate track")  # tracks
IDENTITIES = ("identity switch", "identity transfer")
INCIDENTS = ("breakdown", "fault", "contact")
_MOST_OUTAGES = 10  # lines about links that are lost
_MOST_PAIRS = 6  # pairs of UAVs named in one line
_OUTAGES = {
    "link lost": ("no link between UAVs ", "{} and {}"),
    "messages lost": ("", "UAV {} hears nothing of UAV {}"),
}


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
    scans: tuple[int, ...] = ()  # of `UNHELD` kinds, as `holding.Unheld` has them

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
    return float(times[first]), float(times[min(last + 1, len(times) - 1)] + (len(times) == 1))


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
    """Events of all times without a link or a message, sorted by time; pairs of UAVs with the same times share one.

    Of more than ten such events the nine with the longest times are kept, and others are about all other pairs. events:
    those of a mission, of which the kinds `also` are added; times (K,) s.
    """
    of_pair: defaultdict[tuple[str, tuple[int, ...]], list[Event]] = defaultdict(list)
    for event in (event for event in events if event.kind in _OUTAGES):
        of_pair[event.kind, event.uavs].append(event)
    alike: defaultdict[tuple[Any, ...], list[list[Event]]] = defaultdict(list)
    for (kind, _), own in of_pair.items():
        alike[(kind, *((event.first, event.last, event.why) for event in own))].append(own)
    longest = sorted(alike.values(), key=lambda pairs: _sum_seconds(pairs[0], times), reverse=True)
    named = len(longest) if len(longest) <= _MOST_OUTAGES else _MOST_OUTAGES - 1
    found = [event for event in events if event.kind in also]
    found += [_join_outages([one for one, *_ in pairs], pairs[0], times) for pairs in longest[:named]]
    for kind in _OUTAGES:
        rest = [own for pairs in longest[named:] for own in pairs if own[0].kind == kind]
        if rest:
            outages = sorted((event for own in rest for event in own), key=lambda event: event.first)
            what = "no link at times between" if kind == "link lost" else "at times nothing is heard between"
            text = f"{what} {len(rest)} more pair{'s' * (len(rest) > 1)} of UAVs"
            found.append(_note_outages(text, outages, times))
    return sorted(found, key=lambda event: event.time)


def list_outages_at(events: Sequence[Event], times: Array, k: int) -> list[Event]:
    """Events of UAVs without a link or a message at scan k, and from when to when, the longest first."""
    now = defaultdict(list)
    for event in events:
        if event.kind in _OUTAGES and event.first <= k <= event.last:
            now[event.first, -event.last, event.kind, event.why].append(event)
    return [_join_outages(now[key], now[key][:1], times) for key in sorted(now)]


def _join_outages(pairs: Sequence[Event], own: Sequence[Event], times: Array) -> Event:
    """One event for pairs of UAVs with the same outages; pairs: one outage of each; own: all outages of one pair."""
    begin, form = _OUTAGES[own[0].kind]
    more = len(pairs) - _MOST_PAIRS
    named = ", ".join(form.format(*event.uavs) for event in pairs[:_MOST_PAIRS])
    return _note_outages(begin + named + (f", and {more} more pair{'s' * (more > 1)}" if more > 0 else ""), own, times)


def _note_outages(text: str, outages: Sequence[Event], times: Array) -> Event:
    """An event from the first to the last of some outages, with their number, sum and reasons."""
    if len(outages) > 1:
        text += f", {len(outages)} times, {_sum_seconds(outages, times):.1f} s in all"
    why = ", ".join(dict.fromkeys(event.why for event in outages if event.why))
    span = outages[0].first, max(event.last for event in outages)
    return make_lasting_event(times, span, outages[0].kind, text, why=why)


def _sum_seconds(outages: Iterable[Event], times: Array) -> float:
    return math.fsum(end - begin for begin, end in (find_ends(times, e.first, e.last) for e in outages))
