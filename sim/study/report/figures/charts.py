"""The figures of a study: distributions of OSPA, OSPA over time, scores, and planners compared by map."""

import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from sim.facts.metrics.metric import Metric
from sim.scenario.quantities import parse_number
from sim.study.analysis.answers import Answer
from sim.study.analysis.groups import Group
from sim.study.analysis.labels import SYMBOLS, cell_text
from sim.study.analysis.levels import LevelAnswer, Threshold
from sim.study.cells import Levels
from sim.study.report.figures.panels import COLOURS, COLUMNS, Curve, FigureLayout, Style, T
from sim.views.drawing.plots import open_figure, order_by_rows, rgb
from sim.views.palette import FAINT
from tracking.numerics.arrays import Array

_WIDTH = 11.0  # inches, width of a figure as wide as the report
_LETTERS = 10  # points
COLUMN = 85 / 25.4  # inches, width of a column of a paper
_COLUMN_LETTERS = 8  # points
_COLUMNS = {False: COLUMNS, True: 2}  # largest number of panels side by side, in a report and in a column
_TALLEST = 20  # letters in a line of upright text
LOOK: Any = {"font.family": "DejaVu Sans", "font.size": _LETTERS, "svg.fonttype": "path", "svg.hashsalt": "understory"}
AT = np.geomspace(0.1, 50.0, 300)  # m, values at which distributions are drawn
_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50)
_FEW = 4  # largest number of curves with bands in one panel
_SHAPES = "oD^s"  # shapes of dots, in turn, so that planners do not differ in colour only


class _Folder(textwrap.TextWrapper):
    """Folds texts at spaces, and import strings after their parts."""

    wordsep_simple_re = re.compile(r"(\s+|(?<=[:.(])(?=[A-Za-z]))")


def draw_ecdf_figure(layout: FigureLayout[Group]) -> Figure:
    """Share of scans, pooled over maps, with an OSPA of at most x, over a logarithmic axis, as in [Li22]."""

    def draw(axes: Axes, curve: Curve[Group]) -> None:
        axes.plot(AT, 100 * compute_ecdf(curve.shown.pool_ospa(), AT), **_style_line(curve.style))

    def dress(axes: Axes) -> None:
        if axes.get_xscale() != "log":  # else a panel that shares the axes has set them
            axes.set_xscale("log")
            axes.set_xlim(AT[0], AT[-1])
            axes.set_xticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
            axes.set_xticks([], minor=True)
            axes.set_ylim(0, 102)
        axes.axvline(1.0, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)

    return _draw_grid(layout, draw, dress, ("OSPA [m], logarithmic", "share of scans [%]"))


def draw_time_figure(layout: FigureLayout[Group]) -> Figure:
    """Median OSPA of the trials at each scan; quartiles are shaded if a panel has few curves."""
    few = all(len(curves) <= _FEW for curves in layout.panels.values())
    ends = [times[-1] for group in layout.shown if len(times := group.curves().times)]

    def draw(axes: Axes, curve: Curve[Group]) -> None:
        times, errors = curve.shown.curves()
        low, median, high = find_quartiles(errors)
        if few:
            axes.fill_between(times, low, high, color=rgb(curve.style.colour), alpha=0.16, lw=0)
        axes.plot(times, median, **_style_line(curve.style))

    def dress(axes: Axes) -> None:
        if axes.get_yscale() != "symlog":  # else a panel that shares the axes has set them
            axes.set_yscale("symlog", linthresh=1.0, linscale=1.2)
            axes.set_ylim(bottom=0)
            top = axes.get_ylim()[1]
            ticks = [tick for tick in (0, 0.5, 1, 2, 5, 10, 20, 50) if tick <= max(top, 1)]
            axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.set_yticks([], minor=True)
            axes.set_xlim(0, max([*ends, 1e-3]))
        axes.axhline(1.0, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)

    return _draw_grid(layout, draw, dress, ("time [s]", "OSPA [m], logarithmic above 1"))


def draw_levels_figure(
    layout: FigureLayout[list[LevelAnswer]], metric: Metric, threshold: Threshold | None, *, column: bool = False
) -> Figure:
    """Means with intervals over the levels of one factor, true to scale if they are numbers; a line at the threshold.

    column: True for a figure as wide as a column of a paper.
    """
    answers = [answer for line in layout.shown for answer in line]
    levels = list(dict.fromkeys(answer.level for answer in answers))
    numbers = np.array([parse_number(level) for level in levels])
    logarithmic = bool(np.all(numbers > 0) and max(numbers) > 30 * min(numbers))
    named = bool(np.isnan(numbers).any())
    places = dict(zip(levels, range(len(levels)) if named else numbers.tolist(), strict=True))
    planners = list(layout.legend)
    room = int((30 if column else 100) / min(_COLUMNS[column], layout.columns) / len(levels))  # letters of a level
    upright = named and max(map(len, levels)) > room
    names = [_Folder(_TALLEST, break_on_hyphens=False).fill(level) if upright else level for level in levels]
    reach = 0.0 if logarithmic else 0.012 * (max(places.values()) - min(places.values()))

    def draw(axes: Axes, curve: Curve[list[LevelAnswer]]) -> None:
        moved = reach * (planners.index(curve.label) - (len(planners) - 1) / 2)  # so that intervals stand side by side
        means = [answer.found.mean for answer in curve.shown]
        ends = metric.scale * np.array([[mean.value, mean.low, mean.high] for mean in means]).T
        axes.errorbar(
            [places[answer.level] + moved for answer in curve.shown],
            ends[0],
            yerr=np.abs(ends[1:] - ends[0]),
            **{**_style_line(curve.style), **({"ls": ""} if named else {})},
            marker=_SHAPES[planners.index(curve.label) % len(_SHAPES)],
            markersize=4,
            elinewidth=1.0,
            capsize=2,
        )

    def dress(axes: Axes) -> None:
        if logarithmic:
            axes.set_xscale("log")
        axes.set_xticks(list(places.values()), names, rotation=90 if upright else 0)
        axes.set_xticks([], minor=True)
        if threshold:
            axes.axhline(threshold.value * metric.scale, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)

    name = SYMBOLS.get(answers[0].factor, answers[0].factor)
    below = min(_TALLEST, max(map(len, levels))) if upright else 0
    return _draw_grid(layout, draw, dress, (name, metric.title), column=column, below=below)


def _draw_grid(
    layout: FigureLayout[T],
    draw: Callable[[Axes, Curve[T]], None],
    dress: Callable[[Axes], None],
    labels: tuple[str, str],
    *,
    column: bool = False,
    below: int = 0,
) -> Figure:
    """Panels with what `draw` and `dress` draw; below: letters of the upright names of levels, which need room."""
    columns = min(_COLUMNS[column], layout.columns)
    rows = -(-len(layout.panels) // columns)
    width = COLUMN if column else _WIDTH if columns > 1 else 0.6 * _WIDTH
    letters = _COLUMN_LETTERS if column else _LETTERS
    height = (0.4 + 1.6 * rows if column else 0.8 + 2.15 * rows) + 0.01 * letters * below * rows
    with _open_drawing(height, width, letters) as figure:
        every = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, (title, curves) in zip(every, layout.panels.items(), strict=False):
            for curve in curves:
                draw(axes, curve)
            _set_title(axes, title)
            axes.grid(lw=0.5, alpha=0.4)
            axes.spines[["top", "right"]].set_visible(False)
        for axes in every[: len(layout.panels)]:
            dress(axes)
        for axes in every[len(layout.panels) :]:
            axes.set_visible(False)
        last = max(0, len(layout.panels) - columns)
        for k, axes in enumerate(every):  # axes without numbers need no room, whose search takes long
            axes.xaxis.set_in_layout(k >= last)
            axes.yaxis.set_in_layout(k % columns == 0)
        for axes in every[last : len(layout.panels)]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(labels[0])  # a label of the whole figure would overlap the legend
        figure.supylabel(labels[1], fontsize="medium")
        _draw_legend(figure, {name: _style_line(style) for name, style in layout.legend.items()})
    return figure


def draw_score_figure(found: Sequence[Answer]) -> Figure:
    """Normalised scores with intervals: a line per cell, a colour and shape per planner."""
    cells = list(dict.fromkeys(score.cell for score in found))
    planners = list(dict.fromkeys(score.planner for score in found))
    looks = {p: (rgb(COLOURS[i % len(COLOURS)]), _SHAPES[i % 4]) for i, p in enumerate(planners)}
    each = max(0.3, 0.07 * len(planners))  # inches, height of a cell
    with _open_drawing(1.2 + each * len(cells)) as figure:
        axes = figure.add_subplot()
        for score in found:
            index = planners.index(score.planner)
            height = cells.index(score.cell) + 0.7 * (index + 0.5 - len(planners) / 2) / len(planners)
            colour, shape = looks[score.planner]
            ends = [100 * score.mean.low, 100 * score.mean.high]
            axes.plot(ends, [height, height], color=colour, lw=1.5, alpha=0.7)
            axes.plot(100 * score.mean.value, height, shape, color=colour, ms=5)
        for end in (0, 100):
            axes.axvline(end, color=rgb(FAINT), lw=1.0, ls="--", zorder=0.5)
        values = [100 * score.mean.value for score in found]
        axes.set_xlim(min(-10.0, *values) - 5, max(110.0, *values) + 5)  # long intervals are cut off
        axes.set_xlabel("normalised score: floor 0, bound 100 [%]")
        axes.set_yticks(range(len(cells)), [_Folder(40).fill(_format_row(cell)) for cell in cells])
        axes.set_ylim(len(cells) - 0.5, -0.5)
        axes.grid(axis="x", lw=0.5, alpha=0.4)
        axes.spines[["top", "right"]].set_visible(False)
        _draw_legend(figure, {p: {"color": colour, "marker": shape, "ls": ""} for p, (colour, shape) in looks.items()})
    return figure


def _format_row(cell: Levels | None) -> str:
    """Text of a cell beside a line of dots; only the scenario's name if the cell has no other factor."""
    named = cell is not None and [name for name, _ in cell] == ["scenario"]
    return cell[0][1] if cell and named else cell_text(cell) or "all missions"


def draw_scatter_figure(points: Mapping[str, Array], baseline: str, metric: Metric) -> Figure:
    """Values of each planner over those of the baseline: a panel per planner, a point (n, 2) per map, at least one."""
    low, high, log = _find_limits(np.concatenate([*points.values()]))
    columns = min(COLUMNS, len(points))
    rows = -(-len(points) // columns)
    with _open_drawing(3.3 * rows, width=0.4 + 3.05 * columns) as figure:
        for i, (other, pairs) in enumerate(points.items()):
            axes = figure.add_subplot(rows, columns, i + 1)
            axes.plot([low, high], [low, high], color=rgb(FAINT), lw=1.0, zorder=0.5)
            axes.plot(pairs[:, 0], pairs[:, 1], "o", color=rgb(COLOURS[0]), ms=4.5, alpha=0.6, mew=0)
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_locator(MaxNLocator(5))
            if log:
                axes.set(xscale="log", yscale="log")
            axes.set(xlim=(low, high), ylim=(low, high), aspect="equal")
            _set_title(axes, other)
            axes.grid(lw=0.5, alpha=0.4)
        figure.supxlabel(f"{baseline}: {metric.title}{', logarithmic' * log}", fontsize="medium")
        figure.supylabel(f"planner: {metric.title}", fontsize="medium")
    return figure


def _find_limits(values: Array) -> tuple[float, float, bool]:
    """Ends of both axes, and True if these are logarithmic because the values span more than a factor of 30."""
    low, high = float(values.min()), float(values.max())
    if low > 0 and high > 30 * low:
        return low / 1.15, high * 1.15, True
    margin = 0.05 * (high - low) or 0.5
    return low - margin, high + margin, False


@contextmanager
def _open_drawing(height: float, width: float = _WIDTH, letters: int = _LETTERS) -> Iterator[Figure]:
    """A figure of so many inches, with letters in points, to be drawn in the common style."""
    with open_figure(width, height, letters=letters) as figure:
        yield figure
        for text in figure.texts:
            _fold(text, 1.0)
        titles = [axes.get_title(loc="left").count("\n") for axes in figure.axes]
        rows = figure.axes[0].get_gridspec().nrows  # type: ignore[union-attr]
        lines = rows * max(titles) + sum(text.get_text().count("\n") for text in figure.texts)
        figure.set_figheight(figure.get_figheight() + 0.017 * letters * lines)
        for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
            if not axis.get_label_text():  # a place that is given is not searched for, which takes long
                axis.set_label_coords(0, 0)
        equal = any(axes.get_aspect() != "auto" for axes in figure.axes)
        for _ in range(1 + equal):  # panels of equal axes find their places only the second time
            figure.get_layout_engine().execute(figure)  # type: ignore[union-attr]  # once for all its files
        figure.set_layout_engine(None)


def _set_title(axes: Axes, text: str) -> None:
    """Give a panel a title, in as many lines as its width needs."""
    columns = axes.get_gridspec().ncols  # type: ignore[union-attr]
    _fold(axes.set_title(text, fontsize="medium", loc="left", fontweight="bold", y=1.0), 0.84 / columns)


def _draw_legend(figure: Figure, looks: Mapping[str, dict[str, Any]]) -> None:
    """Draw a legend below the panels, where it hides no data; looks: Matplotlib's options by label."""
    handles = [Line2D([], [], label=name, **look) for name, look in looks.items()]
    for columns in (4, 2, 1):
        ordered = order_by_rows(handles, columns)
        legend = figure.legend(handles=ordered, loc="outside lower center", ncols=columns, frameon=False)
        if legend.get_window_extent().width <= figure.bbox.width or columns == 1:
            break
        legend.remove()
    for text in legend.get_texts():
        _fold(text, 0.9)
    figure.set_figheight(figure.get_figheight() + legend.get_window_extent().height / figure.dpi)


def _fold(text: Text, most: float) -> None:
    """Fold a text, between words where it can, to `most` of the figure's width, or of its height if it is upright."""
    figure = text.figure.bbox
    across, room = ("height", figure.height) if text.get_rotation() == 90 else ("width", figure.width)
    whole = text.get_text()
    letters = len(whole)
    while (long := getattr(text.get_window_extent(), across)) > most * room - 2 and letters > 8:
        letters = min(letters - 1, int(letters * most * room / long))
        text.set_text(_Folder(letters, break_on_hyphens=False).fill(whole))


def _style_line(style: Style) -> dict[str, Any]:
    """Matplotlib's options for a curve."""
    return {"color": rgb(style.colour), "ls": style.dash, "lw": 1.7}


def compute_ecdf(values: Array, at: Array) -> Array:
    """Share of the values (N,) that are no more than each of `at`; NaN is left out, and no values give NaN."""
    ordered = np.sort(values[~np.isnan(values)])
    if not len(ordered):
        return np.full(len(at), np.nan)
    shares: Array = np.searchsorted(ordered, at, side="right") / len(ordered)
    return shares


def compute_share_under(values: Array, bound: float) -> float:
    """Share of the values (N,) that are below a bound; NaN is left out."""
    counted = values[~np.isnan(values)]
    return float(np.mean(counted < bound)) if len(counted) else np.nan


def find_quartiles(curves: Array) -> Array:
    """Lower quartile, median and upper quartile (3, T) of curves (n, T) at each scan; NaN is left out."""
    found = np.full((3, curves.shape[1]), np.nan)
    held = ~np.isnan(curves).all(axis=0)
    quantile = np.nanquantile if np.isnan(curves[:, held]).any() else np.quantile  # which is much faster
    found[:, held] = quantile(curves[:, held], [0.25, 0.5, 0.75], axis=0)
    return found
