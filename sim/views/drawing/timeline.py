"""The timeline of a mission: states of each person in the cameras and to the tracks, above the error of the fleet."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sim.facts.event import IDENTITIES, Event, assign_lanes, find_ends
from sim.facts.metrics.holding import GRADES, HOLDS, find_episodes
from sim.facts.people import BROKEN, PeopleFacts, tell_losses
from sim.facts.sightings import STATES
from sim.views import palette
from sim.views.drawing.plots import draw_mean, open_figure, order_by_rows, rgb
from sim.views.palette import FAINT, HIDDEN, INK, ORANGE, OUT_OF_VIEW, UAV_COLOURS, Colour, pale, uav_colour
from tracking.numerics.arrays import Array, Indices

_WIDTH = 11.0  # inches
_BAR, _GAP = 1.0, 0.8  # lanes, height of the bar of the tracks, and of the gap to the next person
_MOST_LANES, _FOLDED = 100.0, 6.0  # lanes, largest height of all people, and that of those who are folded
_MOST_DEEP = 12.0  # lanes, largest height of the tracks that stand for no person
_MOST_NAMED = 5  # largest number of UAVs that are named beside a person's lanes
_VEIL: Colour = (250, 214, 212)
_SWITCHED: Any = {"marker": "D", "ms": 6, "color": rgb(ORANGE), "mec": rgb(INK), "mew": 0.8, "ls": ""}  # a track
HOLD_SHADES = {hold: colour for hold, colour in reversed(palette.HOLD_COLOURS.items()) if hold != "absent"}
UNMATCHED_SHADES = {"false track": palette.FALSE, "duplicate track": pale(palette.FALSE)}
WORST_FIRST = (*GRADES, "held by some", "held")
_MEANT = {
    "held": "held by all",
    "held by some": "held by some UAVs",
    "off the track": "off the track, in its ellipse",
}

Shade = tuple[float, float, float]


class PersonRow(NamedTuple):
    """A person in the timeline, and the UAVs that have a lane there."""

    person: int
    uavs: Sequence[int]

    @property
    def height(self) -> float:
        """Height [lanes] with the bar of the tracks and the gap to the next row."""
        return len(self.uavs) + _BAR + _GAP


class Stretch(NamedTuple):
    """Scans with one state of a person, both included, and its colour."""

    first: int
    last: int
    colour: Colour
    top: float = 0.0  # of 1, where it is drawn in its lane
    height: float = 1.0


class Bar(NamedTuple):
    """A rectangle of one colour."""

    start: float  # s
    end: float
    top: float  # lanes
    height: float
    shade: Shade


def choose_rows(facts: PeopleFacts) -> tuple[list[PersonRow], list[int]]:
    """The rows of people, and the people without one because there are too many.

    If some have none, those whom no UAV held for the longest come first. Of a fleet with more UAVs than colours, only
    those that had the person in a frame have a lane.
    """
    _, uavs, people = facts.tracks.shape
    had = (facts.camera_states >= STATES.index("hidden")).any(axis=0) | (uavs <= len(UAV_COLOURS))
    rows = [PersonRow(m, np.flatnonzero(had[:, m]).tolist()) for m in range(people)]
    if sum(row.height for row in rows) <= _MOST_LANES:
        return rows, []
    lost = np.isin(facts.hold_states, [HOLDS.index(hold) for hold in ("lost", "not found yet")]).sum(axis=0)
    rows = [rows[m] for m in np.argsort(-lost, kind="stable").tolist()]
    fit = int(np.searchsorted(np.cumsum([row.height for row in rows]), _MOST_LANES - _FOLDED - _GAP, side="right"))
    return rows[: max(fit, 1)], sorted(row.person for row in rows[max(fit, 1) :])


def draw_timeline(facts: PeopleFacts, ospa: Array, events: Sequence[Event]) -> Figure:
    """The timeline: a lane per UAV and a bar for the fleet's tracks for each person, and below them mean OSPA.

    ospa (K, n, 3) m, as recorded. Lanes show the state in each camera, and bars the state to the tracks. People without
    a row of their own have one together, with shares of their states to the tracks. The last row shows the tracks that
    stand for no person, if there are any; simultaneous ones are below one another.
    """
    uavs = facts.tracks.shape[1]
    places = _Places(facts, events)
    widest = max((len(row.uavs) for row in places.rows), default=uavs)
    lane = float(np.clip(0.5 / (widest + 1), 0.06, 0.12)) * (1.0 if len(places.rows) <= 8 else 0.75)  # inches
    height = places.bottom * lane
    with open_figure(_WIDTH, height + 3.1, letters=10) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[max(height, 0.5), 1.5])
        shades = _draw_people(above, facts, events, places)
        _name_rows(above, facts, places)
        above.set_ylim(places.bottom - _GAP / 2, -_GAP / 2)
        above.set_title(_write_title(facts), loc="left", fontsize=12, fontweight="bold")
        draw_mean(below, facts.recording.times, ospa)
        below.set_xlim(*find_ends(facts.recording.times, 0, len(facts.recording.times) - 1))
        for axes in (above, below):
            _mark_breakdowns(axes, facts, events, named=axes is below)
        handles = _make_legend(uavs, shades, switched=any(event.kind in IDENTITIES for event in events))
        columns = 6 if uavs <= len(UAV_COLOURS) else 4
        ordered = order_by_rows(handles, columns)
        figure.legend(handles=ordered, loc="outside lower center", ncols=columns, frameon=False, fontsize=9)
    return figure


class _Places:
    """The rows from the top down, with their places [lanes]."""

    def __init__(self, facts: PeopleFacts, events: Sequence[Event]) -> None:
        self.rows, self.folded = choose_rows(facts)
        self.unmatched = assign_lanes(events)
        edges = np.cumsum([0.0, *(row.height for row in self.rows)]).tolist()
        self.tops = dict(zip((row.person for row in self.rows), edges, strict=False))
        self.fold_top = float(edges[-1])
        empty = 0.0 if self.rows else 1 + _BAR + _GAP
        self.unmatched_top = self.fold_top + (_FOLDED + _GAP) * bool(self.folded) + empty
        deep = 1 + max((lane for _, lane in self.unmatched), default=-1)
        self.thin = min(_BAR, _MOST_DEEP / max(deep, 1))  # height of a track that stands for no person
        self.bottom = self.unmatched_top + (deep * self.thin + _GAP) * bool(deep)

    def bar_of(self, person: int) -> float:
        """Middle [lanes] of the bar of a person's tracks, or of the row of the folded people."""
        for row in self.rows:
            if row.person == person:
                return float(self.tops[person] + len(row.uavs) + _BAR / 2)
        return self.fold_top + _FOLDED / 2


def _draw_people(axes: Axes, facts: PeopleFacts, events: Sequence[Event], places: _Places) -> set[Shade]:
    """Draw the rows and return the colours in them."""
    times = facts.recording.times
    bars = []
    for event, lane in places.unmatched:
        top = places.unmatched_top + (lane + 0.2) * places.thin
        shade = rgb(UNMATCHED_SHADES[event.kind])
        bars.append(Bar(*find_ends(times, event.first, event.last), top, 0.8 * places.thin, shade))
    for event in events:
        if event.kind in IDENTITIES and event.person is not None:
            axes.plot([times[event.first]], [places.bar_of(event.person)], **_SWITCHED)
    for m, uavs in places.rows:
        top = places.tops[m]
        holds = list_holds(facts.hold_states[:, m])
        lost = [Stretch(s.first, s.last, _VEIL) for s in holds if s.colour == palette.LOST]
        bars += _make_bars(times, lost, top - 0.15, len(uavs) + _BAR + 0.3)  # over all lanes
        bars += _make_bars(times, holds, top + len(uavs) + 0.2, _BAR - 0.2)
        for lane, i in enumerate(uavs):
            bars += _make_bars(times, list_views(facts.camera_states[:, i, m], i), top + lane, 1.0)
    if places.folded:
        bars += _make_bars(times, list_shares(facts.hold_states[:, places.folded]), places.fold_top, _FOLDED)
    corners = [
        [(bar.start, bar.top), (bar.end, bar.top), (bar.end, bar.top + bar.height), (bar.start, bar.top + bar.height)]
        for bar in bars
    ]
    axes.add_collection(PolyCollection(corners, facecolors=[bar.shade for bar in bars], lw=0))
    return {bar.shade for bar in bars}


def _name_rows(axes: Axes, facts: PeopleFacts, places: _Places) -> None:
    named = facts.tracks.shape[1] > len(UAV_COLOURS)
    middles = [places.tops[row.person] + (row.height - _GAP) / 2 for row in places.rows]
    names = [f"person {row.person}{list_in_brackets(row.uavs) if named else ''}" for row in places.rows]
    shares = [_format_share(facts, row.person) for row in places.rows]
    if places.folded:
        middles.append(places.fold_top + _FOLDED / 2)
        names.append(f"{len(places.folded)} others")
        shares.append(f"held {100 * _compute_held_share(facts, places.folded):.1f} %")
    if count := len(places.unmatched):
        middles.append((places.unmatched_top + places.bottom - _GAP) / 2)
        names.append("no person")
        shares.append(f"{count} track{'s' * (count > 1)}")
    axes.set_yticks(middles, names)
    axes.tick_params(axis="both", length=0, labelbottom=False)
    right = axes.secondary_yaxis("right")
    right.set_yticks(middles, shares)
    right.tick_params(axis="y", length=0)
    for spines in (axes.spines, right.spines):
        spines[:].set_visible(False)
    if not places.rows:
        axes.text(0.5, 0.5, "no people", transform=axes.transAxes, ha="center", va="center", color=rgb(FAINT))


def list_in_brackets(uavs: Sequence[int]) -> str:
    """The UAVs with a lane, in words after a person's name; "" for none."""
    more = ", ..." if len(uavs) > _MOST_NAMED else ""
    return f" ({', '.join(map(str, uavs[:_MOST_NAMED]))}{more})" if uavs else ""


def list_shares(states: Indices) -> list[Stretch]:
    """Shares of people (K, F) with each state to the tracks, from the worst down."""
    found: list[Stretch] = []
    for first, last, _ in find_episodes(np.unique(np.sort(states, axis=1), axis=0, return_inverse=True)[1].ravel()):
        top = 0.0
        for hold in WORST_FIRST:
            height = float(np.mean(states[first] == HOLDS.index(hold)))
            if height:
                found.append(Stretch(first, last, HOLD_SHADES[hold], top, height))
            top += height
    return found


def list_views(states: Indices, uav: int) -> list[Stretch]:
    """The states (K,) of a person in a UAV's camera; nothing while one of both is not there."""
    colour = uav_colour(uav)
    shades = {"out of view": OUT_OF_VIEW, "hidden": HIDDEN, "missed": pale(colour), "seen": colour}
    found = []
    for first, last, value in find_episodes(states):
        if value != BROKEN and (state := STATES[value]) in shades:
            slim = (0.35, 0.3) if state == "out of view" else (0.06, 0.88)
            found.append(Stretch(first, last, shades[state], *slim))
    return found


def list_holds(states: Indices) -> list[Stretch]:
    """A person's states (K,) to the tracks."""
    spans = find_episodes(states)
    return [Stretch(a, b, HOLD_SHADES[HOLDS[value]]) for a, b, value in spans if HOLDS[value] in HOLD_SHADES]


def _make_bars(times: Array, stretches: Sequence[Stretch], top: float, height: float) -> list[Bar]:
    """Stretches in a lane that begins at `top`."""
    return [Bar(*find_ends(times, s.first, s.last), top + height * s.top, height * s.height, rgb(s.colour))
            for s in stretches]  # fmt: skip


def _mark_breakdowns(axes: Axes, facts: PeopleFacts, events: Sequence[Event], *, named: bool) -> None:
    for n, event in enumerate(event for event in events if event.kind == "breakdown"):
        start = float(facts.recording.times[event.first])
        axes.axvline(start, color=rgb(uav_colour(event.uavs[0])), lw=1.4, ls=":", zorder=3)
        if named:
            late = start > sum(axes.get_xlim()) / 2
            axes.text(
                start,
                1.0 - 0.14 * (n % 6),
                f"  {event.text}  ",
                transform=axes.get_xaxis_transform(),
                ha="right" if late else "left",
                va="top",
                fontsize=9,
                bbox={"color": "white", "alpha": 0.8, "lw": 0, "pad": 1},
            )


def _make_legend(uavs: int, shades: set[Shade], *, switched: bool) -> list[Patch | Line2D]:
    """Handles of the legend for the drawn shades, and for marks of switched tracks."""
    known = name_shades(uavs).items()
    drawn = {label: colours[0] for label, colours in known if shades.intersection(map(rgb, colours))}
    marks = [Line2D([], [], **_SWITCHED, label="track switched")] * switched
    return [*(Patch(color=rgb(colour), label=label) for label, colour in drawn.items()), *marks]


def name_shades(uavs: int) -> dict[str, list[Colour]]:
    """What colours stand for in the lanes and bars of a fleet's timeline."""
    if uavs <= len(UAV_COLOURS):
        known = {f"seen by UAV {i}": [uav_colour(i)] for i in range(uavs)}
    else:
        known = {"seen: lanes are the UAVs in brackets": [*UAV_COLOURS]}
    known |= {"missed": [*map(pale, UAV_COLOURS)], "hidden": [HIDDEN], "out of view": [OUT_OF_VIEW]}
    return known | {_MEANT.get(kind, kind): [colour] for kind, colour in (HOLD_SHADES | UNMATCHED_SHADES).items()}


def _write_title(facts: PeopleFacts) -> str:
    if not facts.recording.present.any():
        return "No people"
    share = _compute_held_share(facts, slice(None))
    return f"People held {100 * share:.1f} % of the time, {tell_losses(facts)}"


def _format_share(facts: PeopleFacts, person: int) -> str:
    here = facts.recording.present[:, person].any()
    return f"held {100 * _compute_held_share(facts, [person]):.1f} %" if here else "absent"


def _compute_held_share(facts: PeopleFacts, people: slice | Sequence[int]) -> float:
    """Share of scans and working UAVs at which present people are held, as in the summary."""
    working = np.count_nonzero(facts.recording.working, axis=1)[:, None]
    pairs = (working * facts.recording.present[:, people]).sum()
    return float(facts.held[:, people].sum() / max(pairs, 1))
