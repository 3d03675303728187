"""The timeline of a mission: states of each person in the cameras and to the tracks, above the error of the fleet."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sim.drawing import palette
from sim.drawing.palette import FAINT, HIDDEN, INK, ORANGE, OUT_OF_VIEW, UAV_COLOURS, pale, uav_colour
from sim.drawing.plots import by_rows, draw_mean, new_figure, rgb
from sim.evaluation.holding import HOLDS, episodes
from sim.evaluation.score import HELD
from sim.replay.event import IDENTITIES, Event, ends, lanes
from sim.replay.history import BROKEN, STATES, History
from tracking.numerics.arrays import Array, Indices

_WIDTH = 11.0  # inches
_BAR, _GAP = 1.0, 0.8  # lanes, height of the bar of the tracks, and of the gap to the next person
_VEIL = rgb((250, 214, 212))
_SWITCHED: Any = {"marker": "D", "ms": 6, "color": rgb(ORANGE), "mec": rgb(INK), "mew": 0.8, "ls": ""}  # a track
_HOLDS = {hold: colour for hold, colour in reversed(palette.HOLD_COLOURS.items()) if hold != "absent"}
_UNMATCHED = {"false track": palette.FALSE, "duplicate track": pale(palette.FALSE)}
_MEANT = {"held": f"held within {HELD:g} m by all", "held by some": "held by some UAVs"}

Shade = tuple[float, float, float]


class Bar(NamedTuple):
    """A rectangle of one colour."""

    start: float  # s
    end: float
    top: float  # lanes
    height: float
    shade: Shade


def timeline_figure(history: History, ospa: Array, events: Sequence[Event]) -> Figure:
    """The timeline: a lane per UAV and a bar for the fleet's tracks for each person, and below them mean OSPA.

    ospa (K, n, 3) m, as recorded. Lanes show the state in each camera, and bars the state to the tracks. The last row
    shows the tracks that stand for no person, if there are any; simultaneous ones are below one another.
    """
    uavs, people = history.tracks.shape[1:]
    unmatched = lanes(events)
    deep = 1 + max((lane for _, lane in unmatched), default=-1)
    rows = max(people, 1) * (uavs + _BAR + _GAP) + (deep * _BAR + _GAP) * bool(deep)
    lane = float(np.clip(0.5 / (uavs + 1), 0.06, 0.12)) * (1.0 if people <= 8 else 0.75)  # inches
    height = rows * lane
    with new_figure(_WIDTH, height + 3.1, letters=10) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[max(height, 0.5), 1.5])
        shades = _draw_people(above, history, events, unmatched)
        _name_rows(above, history, len(unmatched), deep)
        above.set_ylim(rows - _GAP / 2, -_GAP / 2)
        above.set_title(_title(history), loc="left", fontsize=12, fontweight="bold")
        draw_mean(below, history.times, ospa, width=1.5)
        below.set_xlim(*ends(history.times, 0, len(history.times) - 1))
        for axes in (above, below):
            _mark_breakdowns(axes, history, events, named=axes is below)
        handles = _legend(uavs, shades, switched=any(event.kind in IDENTITIES for event in events))
        figure.legend(handles=by_rows(handles, 6), loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    return figure


def _draw_people(
    axes: Axes, history: History, events: Sequence[Event], unmatched: Sequence[tuple[Event, int]]
) -> set[Shade]:
    """Draw the rows and return the colours in them."""
    uavs, people = history.tracks.shape[1:]
    pitch = uavs + _BAR + _GAP
    times = history.times
    bars = []
    for event, lane in unmatched:
        top = max(people, 1) * pitch + lane * _BAR + 0.2
        shade = rgb(_UNMATCHED[event.kind])
        bars.append(Bar(*ends(times, event.first, event.last), top, _BAR - 0.2, shade))
    for event in events:
        if event.kind in IDENTITIES and event.person is not None:
            axes.plot([times[event.first]], [event.person * pitch + uavs + _BAR / 2], **_SWITCHED)
    for m in range(people):
        bars += _hold_bars(times, history.hold_states[:, m], m * pitch, uavs)
        for i in range(uavs):
            bars += _lane_bars(times, history.camera_states[:, i, m], m * pitch + i, i)
    corners = [
        [(bar.start, bar.top), (bar.end, bar.top), (bar.end, bar.top + bar.height), (bar.start, bar.top + bar.height)]
        for bar in bars
    ]
    axes.add_collection(PolyCollection(corners, facecolors=[bar.shade for bar in bars], lw=0))
    return {bar.shade for bar in bars}


def _name_rows(axes: Axes, history: History, unmatched: int, deep: int) -> None:
    uavs, people = history.tracks.shape[1:]
    pitch = uavs + _BAR + _GAP
    middles = [m * pitch + (pitch - _GAP) / 2 for m in range(people)]
    names, shares = [f"person {m}" for m in range(people)], [_share(history, m) for m in range(people)]
    if unmatched:
        middles.append(max(people, 1) * pitch + deep * _BAR / 2)
        names.append("no person")
        shares.append(f"{unmatched} track{'s' * (unmatched > 1)}")
    axes.set_yticks(middles, names)
    axes.tick_params(axis="both", length=0, labelbottom=False)
    right = axes.secondary_yaxis("right")
    right.set_yticks(middles, shares)
    right.tick_params(axis="y", length=0)
    for spines in (axes.spines, right.spines):
        spines[:].set_visible(False)
    if not people:
        axes.text(0.5, 0.5, "no people", transform=axes.transAxes, ha="center", va="center", color=rgb(FAINT))


def _lane_bars(times: Array, states: Indices, top: float, uav: int) -> list[Bar]:
    """The states of a person in a camera."""
    colour = uav_colour(uav)
    bars = []
    shades = {"out of view": OUT_OF_VIEW, "hidden": HIDDEN, "missed": pale(colour), "seen": colour}
    for first, last, value in episodes(states):
        if value != BROKEN and STATES[value] in shades:
            inset = 0.35 if STATES[value] == "out of view" else 0.06
            shade = rgb(shades[STATES[value]])
            bars.append(Bar(*ends(times, first, last), top + inset, 1 - 2 * inset, shade))
    return bars


def _hold_bars(times: Array, states: Indices, top: float, uavs: int) -> list[Bar]:
    """A person's states to the tracks, below the lanes of `uavs` UAVs, with a veil over all lanes while lost."""
    bars: list[Bar] = []
    for first, last, value in episodes(states):
        start, end = ends(times, first, last)
        hold = HOLDS[value]
        if hold == "lost":
            bars.append(Bar(start, end, top - 0.15, uavs + _BAR + 0.3, _VEIL))
        if hold in _HOLDS:
            bars.append(Bar(start, end, top + uavs + 0.2, _BAR - 0.2, rgb(_HOLDS[hold])))
    return bars


def _mark_breakdowns(axes: Axes, history: History, events: Sequence[Event], *, named: bool) -> None:
    for n, event in enumerate(event for event in events if event.kind == "breakdown"):
        start = float(history.times[event.first])
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


def _legend(uavs: int, shades: set[Shade], *, switched: bool) -> list[Patch | Line2D]:
    """Handles of the legend for the drawn shades, and for marks of switched tracks."""
    if uavs <= len(UAV_COLOURS):
        known = {f"seen by UAV {i}": [uav_colour(i)] for i in range(uavs)}
    else:
        known = {"seen: lanes are UAVs, the first on top": [*UAV_COLOURS]}
    known["shown, not detected"] = [*map(pale, UAV_COLOURS)]
    known |= {"in the frame, hidden": [HIDDEN], "out of view": [OUT_OF_VIEW]}
    known |= {_MEANT.get(kind, kind): [colour] for kind, colour in (_HOLDS | _UNMATCHED).items()}
    drawn = {label: colours[0] for label, colours in known.items() if shades.intersection(map(rgb, colours))}
    marks = [Line2D([], [], **_SWITCHED, label="track switched")] * switched
    return [*(Patch(color=rgb(colour), label=label) for label, colour in drawn.items()), *marks]


def _title(history: History) -> str:
    if not history.present.any():
        return "No people"
    share = _held_share(history, slice(None))
    lost = [loss for loss in history.losses if loss.found]
    times = {0: "never lost", 1: "lost once", 2: "lost twice"}.get(len(lost), f"lost {len(lost)} times")
    text = f"People held {100 * share:.1f} % of the time, {times}"
    if lost:
        worst = max(lost, key=lambda loss: loss.last - loss.first)
        start, end = ends(history.times, worst.first, worst.last)
        text += f", longest: person {worst.person} for {end - start:.1f} s from {history.times[worst.first]:.1f} s"
    return text


def _share(history: History, person: int) -> str:
    here = history.present[:, person].any()
    return f"held {100 * _held_share(history, slice(person, person + 1)):.1f} %" if here else "absent"


def _held_share(history: History, people: slice) -> float:
    """Share of scans and working UAVs at which present people are held, as in the summary."""
    working = np.count_nonzero(history.working, axis=1)[:, None]
    pairs = (working * history.present[:, people]).sum()
    return float(history.held[:, people].sum() / max(pairs, 1))
