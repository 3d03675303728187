"""Figures of the OSPA of scans: its distribution, and its course over time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis.cells import Group
from sim.analysis.distributions import bands, ecdf
from sim.drawing.palette import FAINT
from sim.drawing.plots import rgb
from sim.report.figures.canvas import WIDTH, drawing, legend, line
from sim.report.figures.panels import Curve, Sheet

AT = np.geomspace(0.1, 50.0, 300)  # m, where distributions are drawn
_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50)
_FEW = 4  # curves with bands in one panel


def ecdf_figure(sheet: Sheet) -> Figure:
    """Share of scans with an OSPA of no more than x, scans and maps pooled, over a logarithmic axis, as in [Li22]."""

    def draw(axes: Axes, curve: Curve) -> None:
        axes.plot(AT, 100 * ecdf(curve.group.ospa, AT), **line(curve.style))

    def dress(axes: Axes) -> None:
        axes.set_xscale("log")
        axes.set_xlim(AT[0], AT[-1])
        axes.set_xticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
        axes.set_xticks([], minor=True)
        axes.set_ylim(0, 102)
        axes.axvline(1.0, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)

    return _grid(sheet, draw, dress, ("OSPA [m], logarithmic", "share of scans [%]"))


def time_figure(sheet: Sheet) -> Figure:
    """Median OSPA of the trials at each scan; with few curves in a panel, shaded from lower to upper quartile."""
    few = all(len(panel.curves) <= _FEW for panel in sheet.panels)
    longest = max((_group_end(c.group) for panel in sheet.panels for c in panel.curves), default=0.0)

    def draw(axes: Axes, curve: Curve) -> None:
        times, errors = curve.group.curves
        low, median, high = bands(errors)
        if few:
            axes.fill_between(times, low, high, color=rgb(curve.style.colour), alpha=0.16, lw=0)
        axes.plot(times, median, **line(curve.style))

    def dress(axes: Axes) -> None:
        axes.set_yscale("symlog", linthresh=1.0, linscale=1.2)
        axes.set_ylim(bottom=0)
        top = axes.get_ylim()[1]
        ticks = [tick for tick in (0, 0.5, 1, 2, 5, 10, 20, 50) if tick <= max(top, 1)]
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_yticks([], minor=True)
        axes.set_xlim(0, max(longest, 1e-3))
        axes.axhline(1.0, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)

    return _grid(sheet, draw, dress, ("time [s]", "OSPA [m], logarithmic above 1"))


def _group_end(group: Group) -> float:
    """The last scan's time [s]."""
    times, _ = group.curves
    return float(times[-1]) if len(times) else 0.0


def _grid(
    sheet: Sheet, draw: Callable[[Axes, Curve], None], dress: Callable[[Axes], None], labels: tuple[str, str]
) -> Figure:
    rows = -(-len(sheet.panels) // sheet.columns)
    width = WIDTH if sheet.columns > 1 else 0.6 * WIDTH
    with drawing(0.8 + 2.15 * rows + 0.22 * -(-len(sheet.legend) // 3), width=width) as figure:
        every = figure.subplots(rows, sheet.columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, panel in zip(every, sheet.panels, strict=False):
            for curve in panel.curves:
                draw(axes, curve)
            axes.set_title(panel.title, fontsize=10, loc="left", fontweight="bold")
            axes.grid(lw=0.5, alpha=0.4)
            axes.spines[["top", "right"]].set_visible(False)
        for axes in every[: len(sheet.panels)]:
            dress(axes)
        for axes in every[len(sheet.panels) :]:
            axes.set_visible(False)
        for axes in every[max(0, len(sheet.panels) - sheet.columns) : len(sheet.panels)]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(labels[0])  # the figure's own would meet the legend
        figure.supylabel(labels[1], fontsize=10)
        legend(figure, sheet.legend)
    return figure
