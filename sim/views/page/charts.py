"""The charts and the table of a mission's page: bars of the timeline, and people in words."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.facts.event import IDENTITIES, assign_lanes
from sim.facts.flight import Flight
from sim.facts.metrics.holding import HOLDS
from sim.mission.recording import Recording
from sim.views.drawing.timeline import (
    UNMATCHED_SHADES,
    WORST_FIRST,
    Stretch,
    choose_rows,
    list_holds,
    list_in_brackets,
    list_shares,
    list_views,
    name_shades,
)
from sim.views.palette import HELD, ORANGE, UAV_COLOURS, format_css
from tracking.errors import list_numbers
from tracking.numerics.arrays import Indices

MOST_SCANS = 1500  # shown on a page
_LIST_CLASSES = {"lost": "lost", "not found yet": "unfound"}


@dataclass(frozen=True)
class Shown:
    """The scans on a page: each `stride`-th of a long mission."""

    stride: int
    count: int

    @property
    def every(self) -> slice:
        """Index of the scans in an array over all scans."""
        return slice(None, None, self.stride)

    def span(self, first: int, last: int) -> tuple[int, int]:
        """The first and the last shown scan, by their places on the page, of a span of scans; at least one."""
        begin = min(-(-first // self.stride), self.count - 1)
        return begin, max(begin, last // self.stride)


class Table(dict[Hashable, int]):
    """Distinct values, each with its index in the order of appearance."""

    def index_of(self, value: Hashable) -> int:
        """The index of a value, which is added if it is new."""
        return self.setdefault(value, len(self))


def choose_shown(recording: Recording) -> Shown:
    """All scans of a recording, or at most `MOST_SCANS` of them, evenly spread."""
    scans = len(recording.times)
    stride = -(-scans // MOST_SCANS)
    return Shown(stride, -(-scans // stride))


def list_people_now(flight: Flight, shown: Shown, looks: Table) -> list[list[int]]:
    """Rows of people at each shown scan, the worst off first, and of the lost those who are lost for longer.

    A row has the person, the trouble, and in words who sees them and who holds them.
    """
    recording, facts = flight.recording, flight.people
    worst = [*map(HOLDS.index, WORST_FIRST), HOLDS.index("absent")]
    holds = facts.hold_states
    scans = np.arange(len(recording.times))[:, None]
    began = np.maximum.accumulate(np.where(np.diff(holds, axis=0, prepend=-1) != 0, scans, 0), axis=0)
    views = [facts.view_texts(m) for m in range(recording.person_count)]
    tracks = recording.numbers_of(facts.tracks.ravel()).reshape(facts.tracks.shape)
    found = []
    for k in range(0, len(scans), shown.stride):
        fleet = int(np.count_nonzero(recording.working[k]))
        ranked = []
        for m, hold in enumerate(HOLDS[value] for value in holds[k]):
            words = views[m][k] or "not there", _tell_holders(tracks[k, :, m], hold, fleet)
            row = looks.index_of((m, _LIST_CLASSES.get(hold, ""), *words))
            ranked.append((worst.index(holds[k, m]), int(began[k, m]) if hold == "lost" else 0, m, row))
        found.append([row for *_, row in sorted(ranked)])
    return found


def _tell_holders(tracks: Indices, hold: str, fleet: int) -> str:
    """The UAVs that hold a person, by the numbers (n,) of the tracks, in words."""
    if hold == "absent":
        return ""
    holding: dict[int, list[int]] = {}
    for i in np.flatnonzero(tracks >= 0).tolist():
        holding.setdefault(int(tracks[i]), []).append(i)
    if not holding:
        return hold
    whose = {track: "all" if fleet > 1 and len(own) == fleet else list_numbers("UAV", own)
             for track, own in holding.items()}  # fmt: skip
    return ", ".join(f"track {track} of {owners}" for track, owners in whose.items())


def make_timeline(flight: Flight, shown: Shown) -> dict[str, Any]:
    """Rows of people with bars (shade, first and last scan) of lanes and holds, bars of all others and of tracks."""
    facts, recording = flight.people, flight.recording
    cameras, holds = facts.camera_states[shown.every], facts.hold_states[shown.every]
    rows, folded = choose_rows(facts)
    places = {row.person: n for n, row in enumerate(rows)}
    bracketed = recording.uav_count > len(UAV_COLOURS)
    shades = Table()
    colours = {**UNMATCHED_SHADES, "track held": HELD}

    def bars(stretches: Sequence[Stretch]) -> list[list[float]]:
        return [
            [shades.index_of(format_css(s.colour)), s.first, s.last, *np.round((s.top, s.height), 4).tolist()]
            for s in stretches
        ]

    return {
        "bracketed": bracketed,
        "rows": [
            {
                "name": f"person {m}{list_in_brackets(uavs) * bracketed}",
                "lanes": [bars(list_views(cameras[:, i, m], i)) for i in uavs],
                "holds": bars(list_holds(holds[:, m])),
            }
            for m, uavs in rows
        ],
        "folded": {"name": f"{len(folded)} others", "bars": bars(list_shares(holds[:, folded]))} if folded else None,
        "unmatched": {
            "name": "no person" if recording.labelled else "tracks",
            "bars": [
                [shades.index_of(format_css(colours[e.kind])), *shown.span(e.first, e.last), row]
                for e, row in assign_lanes(flight.events)
            ],
        },
        "switches": [
            [shown.span(e.first, e.first)[0], places.get(e.person, -1)]
            for e in flight.events
            if e.kind in IDENTITIES and e.person is not None
        ],
        "shades": list(shades),
    }


def make_chart_legend(flight: Flight, shades: Sequence[str]) -> list[list[str]]:
    """What the charts show: text, kind of the mark, and its colour; shades: colours of the timeline."""
    uavs = flight.recording.uav_count
    if not flight.recording.labelled:
        return [["track held", "box", format_css(HELD)]] * bool(shades)
    found = []
    for text, colours in name_shades(uavs).items():
        # A UAV that sees nobody has a curve.
        curve = text.removeprefix("seen by ") if text.startswith("seen by ") else ""
        drawn = not {format_css(colour) for colour in colours}.isdisjoint(shades)
        if drawn or curve:
            kind = "thin" if text == "out of view" else "box"
            found.append([text if drawn else curve, kind, format_css(colours[0])])
    switched = any(event.kind in IDENTITIES for event in flight.events)
    return found + [["track switched", "diamond", format_css(ORANGE)]] * switched
