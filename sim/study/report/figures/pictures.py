"""The figures of a report with their captions."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count, groupby

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from sim.facts.metrics.metric import UNKNOWN, Metric
from sim.study.analysis.answers import Answer, map_points
from sim.study.analysis.groups import Group
from sim.study.analysis.labels import SYMBOLS, append_cell, make_slug
from sim.study.analysis.levels import LevelAnswer, Threshold
from sim.study.analysis.normalised_score import SCORE, Ends
from sim.study.report.figures.charts import (
    LOOK,
    compute_share_under,
    draw_ecdf_figure,
    draw_levels_figure,
    draw_scatter_figure,
    draw_score_figure,
    draw_time_figure,
    find_quartiles,
)
from sim.study.report.figures.panels import FigureLayout, lay_out_figures, lay_out_levels
from tracking.numerics.arrays import Array


@dataclass(frozen=True)
class Picture:
    """A figure of the report."""

    name: str  # name of its files
    title: str
    caption: str
    alt: str
    svg: bytes
    png: bytes
    pdf: bytes = b""  # as wide as a column of a paper; empty if there is none


def draw_pictures(groups: Sequence[Group], baseline: str, metrics: Sequence[Metric]) -> list[Picture]:
    """Distributions of OSPA, OSPA over time, and planners compared by map; without pictures that would be empty."""
    flown = [group for group in groups if group.done]
    found: list[Picture] = []
    for layout in lay_out_figures(flown) if flown else ():
        found += [_draw_ecdf(layout), _draw_over_time(layout)]
    compared = [(metric, map_points(flown, baseline, metric)) for metric in metrics]
    drawn = [(metric, points) for metric, points in compared if any(map(len, points.values()))]
    return _rename_equal_ones(found + [_draw_scatter(points, baseline, metric) for metric, points in drawn[:2]])


def draw_response_pictures(found: Sequence[LevelAnswer], metric: Metric, threshold: Threshold | None) -> list[Picture]:
    """Pictures of a metric over each factor, with a panel for each combination of the other factors' levels."""
    drawn = []
    for factor, answers in groupby(found, lambda answer: answer.factor):
        for layout in lay_out_levels(list(answers)):
            name = SYMBOLS.get(factor, factor)
            means = [
                f"{append_cell(a.planner, (*a.others, (factor, a.level)))} {metric.with_unit(a.found.mean.value)}"
                for line in layout.shown
                for a in line
            ]
            caption = "Mean over the maps; bars are its 95 % interval."
            caption += f" The dashed line is {threshold.text(metric)}." if threshold else ""
            figure = draw_levels_figure(layout, metric, threshold)
            title = f"{metric.label[0].upper()}{metric.label[1:]} over {name}"
            picture = _make_picture(f"levels-{make_slug(factor)}", title, caption, "; ".join(means), figure)
            narrow = draw_levels_figure(layout, metric, threshold, column=True)
            drawn.append(replace(picture, pdf=encode_figure(narrow, "pdf")))
    return _rename_equal_ones(drawn)


def _rename_equal_ones(found: Sequence[Picture]) -> list[Picture]:
    """The pictures with unique names: equal ones, as after the removal of special characters, get a number."""
    named: dict[str, Picture] = {}
    for picture in found:
        numbered = (f"{picture.name}-{k}" for k in count(2))
        name = next(name for name in chain([picture.name], numbered) if name not in named)
        named[name] = replace(picture, name=name)
    return list(named.values())


def draw_score_picture(found: Sequence[Answer], ends: Ends) -> Picture:
    """Picture of the normalised scores of planners, cell by cell."""
    lines = [f"{append_cell(s.planner, s.cell)} {SCORE.text(s.mean.value)} %" for s in found]
    caption = f"0 is {ends.floor}, 100 is {ends.bound}. Lines are 95 % intervals over the maps."
    return _make_picture("score", "Normalised score", caption, "; ".join(lines), draw_score_figure(found))


def _draw_ecdf(layout: FigureLayout[Group]) -> Picture:
    shares = [(group.title, compute_share_under(group.pool_ospa(), 1.0)) for group in layout.shown]
    texts = [f"{title} {UNKNOWN if np.isnan(share) else f'{share:.1%}'}" for title, share in shares]
    alt = "Share of scans with an OSPA under 1 m: " + "; ".join(texts)
    caption = (
        "Share of scans with a mean OSPA of the UAVs of at most x, over all scans of all trials. "
        "Further left is better. The axis is logarithmic; the dashed line is at 1 m."
    )
    return _make_picture("ecdf", "Distribution of OSPA", caption, alt, draw_ecdf_figure(layout), layout.title)


def _draw_over_time(layout: FigureLayout[Group]) -> Picture:
    ends = []
    for group in layout.shown:
        medians = find_quartiles(group.curves().ospa)[1]
        last = medians[~np.isnan(medians)][-1:]
        ends.append(f"{group.title} {last[0]:.2f} m" if len(last) else f"{group.title} {UNKNOWN}")
    caption = (
        "Median over the trials at each scan; shaded, with up to four curves in a panel: lower to upper quartile of "
        "them. The axis is linear below 1 m (dashed) and logarithmic above."
    )
    alt = "Median OSPA at the last scan: " + "; ".join(ends)
    return _make_picture("time", "OSPA over time", caption, alt, draw_time_figure(layout), layout.title)


def _draw_scatter(points: Mapping[str, Array], baseline: str, shown: Metric) -> Picture:
    above = {name: f"{np.sum(p[:, 1] > p[:, 0])} of {len(p)}" for name, p in points.items()}
    alt = "; ".join(f"{name}: {count} maps above {baseline}" for name, count in above.items())
    aim = {"lower": "Below the diagonal", "higher": "Above the diagonal", "neither": ""}[shown.better]
    caption = f"Each point is a seed that both flew: across, the value of {baseline}; upwards, that of the planner."
    caption += f" {aim} the planner is better." if aim else ""
    figure = draw_scatter_figure(points, baseline, shown)
    return _make_picture(f"maps-{make_slug(shown.name)}", f"Map by map: {shown.label}", caption, alt, figure)


def _make_picture(name: str, title: str, caption: str, alt: str, figure: Figure, shared: str = "") -> Picture:
    """A picture of all cells, or of those described by the text `shared`."""
    if shared:
        name, title = f"{name}-{make_slug(shared)}", f"{title}, {shared}"
    return Picture(name, title, caption, f"{title}. {alt}.", encode_figure(figure, "svg"), encode_figure(figure, "png"))


def encode_figure(figure: Figure, kind: str) -> bytes:
    """The content of a figure's file, "png", "svg" or "pdf"; equal figures give equal bytes."""
    drawn = io.BytesIO()
    varying = {"png": "Software", "svg": "Date", "pdf": "CreationDate"}[kind]
    with matplotlib.rc_context(LOOK):
        figure.savefig(drawn, format=kind, dpi=130, metadata={varying: None})
    return drawn.getvalue()
