"""Times without a link between UAVs, in few sentences even for a large fleet or links that are lost again and again."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence

from sim.facts.event import Event, find_ends, make_lasting_event
from tracking.numerics.arrays import Array

_CAUSES = "too far, cut or not there"
_MOST_LINES, _MOST_PAIRS = 10, 6  # lines, and pairs of UAVs named in one
_Pair = tuple[int, int]
_Span = tuple[int, int]  # first and last scan


def summarise_outages(events: Sequence[Event], times: Array, also: Collection[str] = ()) -> list[Event]:
    """Events, sorted by time, that tell all times without a link; pairs of UAVs with the same times share one.

    Of more than ten such events the nine with the longest times are kept, and one is about all other pairs. events:
    those of a mission, of which the kinds `also` are added; times (K,) s.
    """
    alike = defaultdict(list)
    for pair, outages in _find_outages(events, times).items():
        alike[tuple(outages)].append(pair)
    longest = sorted(alike, key=lambda outages: sum(last + 1 - first for first, last in outages), reverse=True)
    named = len(longest) if len(longest) <= _MOST_LINES else _MOST_LINES - 1
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
    """Events that tell which UAVs have no link at scan k, and from when to when, the longest first."""
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
