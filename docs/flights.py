"""Table and figure of docs/results/flights.md, from the study `flights` in runs/flights: `python docs/flights.py`.

If the study was flown in parts, `python docs/flights.py FOLDER...` takes all of them.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sim.study.analysis.intervals import Estimate, estimate_means
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.definition import read_study
from sim.study.store import read_rows
from sim.study.trials import TrialRow
from tracking.numerics.arrays import Array

PICTURE = Path(__file__).parent / "media" / "flights.png"
STUDY = read_study("flights")
FLIGHTS, TRACKERS = map(list, STUDY.factors.values())
METRICS = [find_shown_metric(name) for name in ("gospa.mean_m", "ospa.share_under_1m", "nees.position.mean")]
AXES = {
    "drift": "drift of positions [m]",
    "yaw": "bias of yaws [deg]",
    "clock": "clock offset [s]",
    "delay": "delay [s]",
}
COLOURS = ("#d55e00", "#0072b2", "#009e73")


def estimate(rows: Sequence[TrialRow]) -> dict[tuple[str, str], list[Estimate]]:
    """Mean of each metric over the maps, by flight and tracker, with its interval."""
    return {place: estimate_means(maps) for place, maps in list_values(rows).items()}


def list_values(rows: Sequence[TrialRow]) -> dict[tuple[str, str], Array]:
    """Values (maps, metrics) of each metric, by flight and tracker."""
    found: dict[tuple[str, str], dict[int, list[float]]] = {}
    for row in rows:
        place, values = dict(row.factors), [row.metrics.get(metric.name, math.nan) for metric in METRICS]
        found.setdefault((place["flight"], place["pose_errors"]), {})[row.seed] = values
    return {place: np.array(list(maps.values())) for place, maps in found.items()}


def write_table(values: dict[tuple[str, str], Array]) -> str:
    """A line a flight, a column a tracker: mean GOSPA [m], in brackets share of scans with OSPA under 1 m [%], NEES.

    Of NEES: mean over the maps, median and largest.
    """
    lines = [["flight", *(f"`{tracker}`" for tracker in TRACKERS)], ["---"] * (1 + len(TRACKERS))]
    for flight in FLIGHTS:
        cells = [values.get((flight, tracker)) for tracker in TRACKERS]
        lines.append([flight, *("" if maps is None else _write_cell(maps) for maps in cells)])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _write_cell(maps: Array) -> str:
    gospa, share, nees = (metric.text(e.value) for metric, e in zip(METRICS, estimate_means(maps), strict=True))
    known = maps[~np.isnan(maps[:, -1]), -1]
    tail = [METRICS[-1].text(float(of(known))) for of in (np.median, np.max)] if len(known) else [nees, nees]
    return f"{gospa} ({share}; {', '.join([nees, *tail])})"


def draw(found: dict[tuple[str, str], list[Estimate]]) -> Figure:
    """One panel an axis: mean GOSPA over the size of what errs, a line a tracker."""
    figure = Figure(figsize=(11.0, 3.2), layout="constrained")
    panels = figure.subplots(1, len(AXES), sharey=True)
    for axes, (axis, label) in zip(panels, AXES.items(), strict=True):
        sizes = {flight: float(flight.split()[1]) for flight in FLIGHTS if flight.startswith(f"{axis} ")}
        for tracker, colour in zip(TRACKERS, COLOURS, strict=True):
            places = [(0.0, ("none", "ignore")), *((size, (flight, tracker)) for flight, size in sizes.items())]
            line = [(size, found[place][0]) for size, place in places if place in found]
            if len(line) < 2:
                continue
            x, y = [size for size, _ in line], [gospa.value for _, gospa in line]
            axes.plot(x, y, "o-", color=colour, label=tracker)
            axes.fill_between(x, [g.low for _, g in line], [g.high for _, g in line], color=colour, alpha=0.15, lw=0)
        axes.set(xlabel=label, xlim=(0, None), ylim=(0, None))
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel(METRICS[0].title)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return figure


def main(folders: Sequence[str]) -> None:
    """Print the table and draw the figure."""
    rows = [row for folder in folders for row in read_rows(folder) if row.status == "done"]
    print(write_table(list_values(rows)))
    draw(estimate(rows)).savefig(PICTURE, dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main(sys.argv[1:] or ["runs/flights"])
