"""The timeline of a mission: who saw, missed and held each person when, over the error of the fleet's tracks."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sim.drawing.palette import ALARM, CANOPY, FAINT, INK, LINE, ORANGE, Colour, uav_colour
from sim.drawing.plots import fleet_mean, rgb, scale_errors
from sim.evaluation.score import HELD
from sim.mission.snapshot import Ints
from sim.replay.episodes import BROKEN, HOLDS, episodes, holds, lanes, switches
from sim.replay.history import STATES, History
from tracking.numerics.compiled import Array

_WIDTH = 11.0  # inches
_BAR, _GAP = 1.0, 0.8  # of a person's rows: the bar that tells who holds them, and the gap to the next, in lanes
_TINT = 0.45  # of lanes in which a person is shown but not detected
_NAMED = 4  # UAVs that have colours of their own
_HELD: dict[str, Colour] = {
    "held": INK,
    "held by some": FAINT,
    "lost": ALARM,
    "not found yet": (238, 170, 160),
}
_MEANT = {"held": f"held within {HELD:g} m by all", "held by some": "held by some UAVs"}

Shade = tuple[float, float, float]
Box = tuple[float, float, float, float]  # left, right [s], top, height [lanes]


def timeline_figure(history: History, ospa: Array) -> Figure:
    """For each person a lane for each UAV and a bar for the fleet, and beneath them the mean OSPA.

    ospa (K, n, 3) m, as recorded. Lanes tell what each camera made of the person, bars who held them.
    """
    uavs, people = history.tracks.shape[1:]
    rows = max(people, 1) * (uavs + _BAR + _GAP)
    lane = float(np.clip(0.5 / (uavs + 1), 0.06, 0.12)) * (1.0 if people <= 8 else 0.75)  # inches
    height = rows * lane
    with matplotlib.rc_context({"font.family": "DejaVu Sans", "font.size": 10}):
        figure = Figure(figsize=(_WIDTH, height + 3.1), layout="constrained")
        FigureCanvasAgg(figure)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[max(height, 0.5), 1.5])
        _draw_people(above, history)
        _draw_error(below, history.times, ospa)
        for axes in (above, below):
            _mark_breakdowns(axes, history, named=axes is below)
        start, end = _span(history.times)
        below.set_xlim(start, end)
        figure.legend(handles=_legend(uavs), loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    return figure


def _draw_people(axes: Axes, history: History) -> None:
    uavs, people = history.tracks.shape[1:]
    pitch = uavs + _BAR + _GAP
    boxes: list[tuple[Box, Shade]] = []
    seen, held = lanes(history), holds(history)
    for m in range(people):
        top = m * pitch
        boxes += _bar(history.times, held[:, m], top + uavs, uavs)
        for i in range(uavs):
            boxes += _lane(history.times, seen[:, i, m], top + i, i)
        _draw_switches(axes, history.times[switches(history, m)], top + uavs + _BAR / 2)
    corners = [[(a, t), (b, t), (b, t + h), (a, t + h)] for (a, b, t, h), _ in boxes]
    axes.add_collection(PolyCollection(corners, facecolors=[shade for _, shade in boxes], lw=0))
    axes.set_ylim(max(people, 1) * pitch - _GAP / 2, -_GAP / 2)
    middles = [m * pitch + (uavs + _BAR) / 2 for m in range(people)]
    axes.set_yticks(middles, [f"person {m}" for m in range(people)])
    axes.tick_params(axis="both", length=0, labelbottom=False)
    shares = axes.secondary_yaxis("right")
    shares.set_yticks(middles, [_share(history, m) for m in range(people)])
    shares.tick_params(axis="y", length=0)
    for spines in (axes.spines, shares.spines):
        spines[:].set_visible(False)
    if not people:
        axes.text(0.5, 0.5, "nobody walks here", transform=axes.transAxes, ha="center", va="center", color=rgb(FAINT))
    axes.set_title(_title(history), loc="left", fontsize=12, fontweight="bold")


def _lane(times: Array, states: Ints, top: float, uav: int) -> list[tuple[Box, Shade]]:
    """What one camera made of one person (K,)."""
    colour, boxes = uav_colour(uav), []
    shades = {"out of view": rgb(LINE), "hidden": rgb(CANOPY), "missed": _pale(colour), "seen": rgb(colour)}
    for first, last, value in episodes(states):
        if value != BROKEN and STATES[value] in shades:
            inset = 0.35 if STATES[value] == "out of view" else 0.06
            boxes.append(((*_ends(times, first, last), top + inset, 1 - 2 * inset), shades[STATES[value]]))
    return boxes


def _pale(colour: Colour) -> Shade:
    red, green, blue = (1 - _TINT * (1 - channel) for channel in rgb(colour))
    return red, green, blue


def _bar(times: Array, states: Ints, top: float, uavs: int) -> list[tuple[Box, Shade]]:
    """Who held one person (K,), and a veil over the lanes while nobody did any more."""
    boxes: list[tuple[Box, Shade]] = []
    for first, last, value in episodes(states):
        ends, name = _ends(times, first, last), HOLDS[value]
        if name in _HELD:
            boxes.append(((*ends, top + 0.2, _BAR - 0.2), rgb(_HELD[name])))
        if name == "lost":
            boxes.insert(0, ((*ends, top - uavs - 0.15, uavs + _BAR + 0.3), (0.98, 0.84, 0.83)))
    return boxes


def _draw_switches(axes: Axes, times: Array, height: float) -> None:
    axes.plot(times, np.full(len(times), height), "D", ms=6, color=rgb(ORANGE), mec=rgb(INK), mew=0.8, ls="")


def _draw_error(axes: Axes, times: Array, ospa: Array) -> None:
    mean = fleet_mean(ospa)[:, 0]
    axes.plot(times, mean, color=rgb(INK), lw=1.5, marker="." if len(times) == 1 else "")
    axes.axhline(1.0, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)
    scale_errors(axes, float(np.max(mean[~np.isnan(mean)], initial=0.0)))
    axes.set_xlabel("time [s]")
    axes.set_ylabel("mean OSPA [m]")


def _mark_breakdowns(axes: Axes, history: History, *, named: bool) -> None:
    for i, works in enumerate(history.working.T):
        if works.all():
            continue
        start = _ends(history.times, int(np.argmin(works)), 0)[0]
        axes.axvline(start, color=rgb(uav_colour(i)), lw=1.4, ls=":", zorder=3)
        if named:
            late = start > sum(_span(history.times)) / 2
            axes.text(
                start,
                1.0,
                f"  UAV {i} broke down  ",
                transform=axes.get_xaxis_transform(),
                ha="right" if late else "left",
                va="top",
                fontsize=9,
            )


def _legend(uavs: int) -> list[Patch | Line2D]:
    """What each mark means."""
    if uavs <= _NAMED:
        seen = [Patch(color=rgb(uav_colour(i)), label=f"seen by UAV {i}") for i in range(uavs)]
    else:
        seen = [Patch(color=rgb(uav_colour(0)), label="seen: lanes are UAVs, the first on top")]
    pale = Patch(color=_pale(uav_colour(0)), label="shown, not detected")
    switch = Line2D([], [], marker="D", ms=6, color=rgb(ORANGE), mec=rgb(INK), mew=0.8, ls="", label="track switched")
    return [
        *seen,
        pale,
        Patch(color=rgb(CANOPY), label="in the frame, hidden"),
        Patch(color=rgb(LINE), label="out of view"),
        *(Patch(color=rgb(colour), label=_MEANT.get(name, name)) for name, colour in _HELD.items()),
        switch,
    ]


def _title(history: History) -> str:
    """How much of the time people were held, and the longest loss."""
    present = np.count_nonzero(history.present)
    if not present:
        return "Nobody to track"
    share = np.count_nonzero(history.held[history.present]) / present
    lost = [loss for loss in history.losses if loss.found]
    text = f"People held {100 * share:.0f} % of the time, {_times(len(lost))}"
    if lost:
        worst = max(lost, key=lambda loss: loss.last - loss.first)
        start, end = _ends(history.times, worst.first, worst.last)
        text += f", longest: person {worst.person} for {end - start:.1f} s from {history.times[worst.first]:.1f} s"
    return text


def _times(count: int) -> str:
    return {0: "never lost", 1: "lost once", 2: "lost twice"}.get(count, f"lost {count} times")


def _share(history: History, person: int) -> str:
    present = history.present[:, person]
    return f"held {100 * np.mean(history.held[present, person] > 0):.0f} %" if present.any() else "absent"


def _span(times: Array) -> tuple[float, float]:
    """Where the first scan's share of the time axis begins and the last one's ends [s]."""
    return _ends(times, 0, len(times) - 1)


def _ends(times: Array, first: int, last: int) -> tuple[float, float]:
    """What stands for scans on the time axis [s]: each has the time until the next."""
    step = float(times[1] - times[0]) if len(times) > 1 else 1.0
    return float(times[first]), float(times[last]) + step
