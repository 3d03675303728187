"""Figures of a mission."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sim.facts.metrics.fleet_facts import average_ospa
from sim.mission.atomic_files import write_whole
from sim.views.palette import FAINT, INK, ORANGE, SKY, Colour, uav_colour, uav_dashes
from tracking.numerics.arrays import Array

_TICKS = (0, 0.25, 0.5, 0.75, 1, 2, 5, 10, 20, 50)


def draw_ospa_figure(times: Array, ospa: Array) -> Figure:
    """OSPA of each UAV and their mean over time, on an axis that is linear below 1 m and logarithmic above.

    times (K,) s; ospa (K, n, 3) m: distance, localisation, cardinality. The area below the mean is divided into the
    part of localisation alone and the rest due to a wrong number of tracks. After a UAV has broken down its OSPA is
    NaN, which ends its line and is left out of the mean. The legend has no lines that the mean's hides.
    """
    with open_figure(9, 4.5, letters=11) as figure:
        axes = figure.add_subplot()
        mean = average_ospa(ospa)
        marker = _choose_marker(times)
        broken: str | None = "broke down"  # only once in the legend
        parts = (("localisation", 0, mean[:, 1], SKY), ("added by cardinality", mean[:, 1], mean[:, 0], ORANGE))
        for name, low, high, part_colour in parts:
            axes.fill_between(times, low, high, color=rgb(part_colour), alpha=0.45, lw=0, label=name)
        apart = [i for i in range(ospa.shape[1]) if _differs(ospa[:, i, 0], mean[:, 0])]
        names = {i: f"UAV {i}" for i in apart} if ospa.shape[1] <= 4 else dict.fromkeys(apart[:1], "each UAV")
        for i in range(ospa.shape[1]):
            errors = ospa[:, i, 0]
            colour = rgb(uav_colour(i))
            style = (0, uav_dashes(i)) if uav_dashes(i) else "-"
            axes.plot(times, errors, color=colour, ls=style, lw=0.9, alpha=0.8, marker=marker, label=names.get(i))
            works = np.flatnonzero(~np.isnan(errors))
            if 0 < len(works) < len(times):
                place = times[works[-1]], errors[works[-1]]
                axes.scatter(*place, marker="x", s=50, color=colour, lw=2.0, zorder=3, label=broken)
                broken = None
        axes.plot(times, mean[:, 0], color=rgb(INK), lw=1.8, marker=marker, label="mean of UAVs")
        distances = ospa[:, :, 0][~np.isnan(ospa[:, :, 0])]
        _scale_errors(axes, float(distances.max(initial=0.0)))
        axes.set_xlim(times[0], max(times[-1], times[0] + 1e-3))
        axes.set_ylabel("OSPA [m], logarithmic above 1")
        axes.set_title(
            f"OSPA: mean {distances.mean():.2f} m, median {np.median(distances):.2f} m, "
            f"under 1 m {100 * np.mean(distances < 1.0):.1f} %",
            loc="left",
            fontsize=12,
            fontweight="bold",
        )
        rows = order_by_rows(axes.get_legend_handles_labels()[0], 6)
        axes.legend(handles=rows, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=6, frameon=False, fontsize=10)
    return figure


def _differs(errors: Array, mean: Array) -> bool:
    """True if the line of one UAV's errors (K,) m can be told from that of the mean (K,)."""
    heights = [
        np.where(values < 1.0, 1.2 * values, 1.2 + np.log10(np.maximum(values, 1.0))) for values in (errors, mean)
    ]
    gaps = np.abs(heights[0] - heights[1])
    return bool(np.max(gaps[~np.isnan(gaps)], initial=0.0) > 0.01 * np.nanmax([*heights[1], 1.2]))


class ShownFigure(Figure):
    """A figure that notebooks show by themselves, without an import of pyplot."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.savefig(content, format="png", dpi=self.dpi)
        return content.getvalue()


@contextmanager
def open_figure(width: float, height: float, *, letters: int) -> Iterator[Figure]:
    """Yield a figure with this size in inches, and letters in points, to be drawn in the block."""
    with matplotlib.rc_context({"font.family": "DejaVu Sans", "font.size": letters}):
        figure = ShownFigure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)  # a canvas whose pixels can be read
        yield figure


def order_by_rows(entries: Sequence[Artist], columns: int) -> list[Artist]:
    """Entries of a legend in the order that Matplotlib, which fills its columns one by one, shows row by row."""
    return [entry for column in range(columns) for entry in entries[column::columns]]


def draw_mean(axes: Axes, times: Array, ospa: Array) -> None:
    """Draw the mean OSPA of the working UAVs over time and a line at 1 m."""
    mean = average_ospa(ospa)[:, 0]
    axes.plot(times, mean, color=rgb(INK), lw=1.5, marker=_choose_marker(times))
    _scale_errors(axes, float(np.max(mean[~np.isnan(mean)], initial=0.0)))
    axes.set_ylabel("mean OSPA [m],\nlogarithmic above 1")


def _choose_marker(times: Array) -> str:
    """The marker of a curve, which replaces the line if there is a single scan."""
    return "." if len(times) == 1 else ""


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, completely or not at all."""
    with write_whole(path) as part:
        # Without the version of matplotlib, equal figures are equal files.
        figure.savefig(part, format="png", dpi=150, metadata={"Software": None})


def _scale_errors(axes: Axes, largest: float) -> None:
    """Set axes for time and errors of up to `largest` m, linear below a line at 1 m and logarithmic above."""
    axes.axhline(1.0, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)
    axes.set_xlabel("time [s]")
    top = max(1.5, 1.15 * largest)
    axes.set_yscale("symlog", linthresh=1.0, linscale=1.2)
    axes.set_ylim(0, top)
    # An additional tick shows that a short axis is logarithmic there.
    more = (1.5,) if top < 2.5 else (3,) if top < 8 else ()
    ticks = [tick for tick in (*_TICKS, *more) if tick <= top]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", lw=0.5, alpha=0.4)


def rgb(colour: Colour) -> tuple[float, float, float]:
    """A colour in the form that matplotlib takes."""
    red, green, blue = (channel / 255 for channel in colour)
    return red, green, blue
