"""Figures of a study show the data they are given."""

from itertools import product

import numpy as np
import pytest
from helpers.trials import row, study
from matplotlib.text import Text

from sim.study.analysis.answers import Answer, map_points
from sim.study.analysis.groups import drop_constant_factors, find_varying_factors, group_rows
from sim.study.analysis.intervals import Estimate, estimate_means
from sim.study.analysis.levels import Threshold, find_levels
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.analysis.normalised_score import SCORE
from sim.study.report.figures.charts import (
    AT,
    COLUMN,
    draw_ecdf_figure,
    draw_levels_figure,
    draw_scatter_figure,
    draw_score_figure,
    draw_time_figure,
    find_quartiles,
)
from sim.study.report.figures.panels import lay_out_figures, lay_out_levels
from sim.study.report.figures.pictures import draw_pictures, draw_response_pictures, encode_figure


def groups(rows=None, baseline="sma-nbo"):
    return drop_constant_factors(group_rows(study() if rows is None else rows, baseline))


def lines(axes):
    """Lines that show data: one with as many points as any."""
    return [line for line in axes.get_lines() if len(line.get_xdata()) > 2]


def test_distributions_are_of_all_scans_and_bands_quartiles_of_maps():
    found = groups()
    (layout,) = lay_out_figures(found)
    figure = draw_ecdf_figure(layout)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["λ = 15", "λ = 75"]
    for axes, curves in zip(figure.axes, layout.panels.values(), strict=True):
        for line, curve in zip(lines(axes), curves, strict=True):
            pooled = np.concatenate([r.ospa for r in curve.shown.done])
            brute = [100 * np.mean(pooled <= x) for x in AT]
            np.testing.assert_allclose(line.get_ydata(), brute, rtol=1e-12)
        assert axes.get_xscale() == "log" and "logarithmic" in figure.axes[-1].get_xlabel()
    figure = draw_time_figure(layout)
    for axes, curves in zip(figure.axes, layout.panels.values(), strict=True):
        for line, shade, curve in zip(lines(axes), axes.collections, curves, strict=True):
            low, median, high = find_quartiles(np.array([r.ospa for r in curve.shown.done], dtype=float))
            np.testing.assert_allclose(line.get_ydata(), median)
            np.testing.assert_allclose(line.get_xdata(), np.arange(26) / 5)
            drawn = set(np.round(shade.get_paths()[0].vertices[:, 1], 9))
            assert drawn == set(np.round([*low, *high], 9))


def test_texts_of_figures_count_scans_and_maps_and_ties_as_neither(without_pictures):
    values = {"sma-nbo": (1.0, 1.0, 1.0), "greedy": (2.0, 1.0, 0.5)}
    rows = [row(p, s, metrics={"ospa.mean_m": v}) for p, own in values.items() for s, v in enumerate(own)]
    found = {p.name: p.alt for p in draw_pictures(groups(rows), "sma-nbo", [find_shown_metric("ospa.mean_m")])}
    assert "sma-nbo 0.0%; greedy 33.3%." in found["ecdf"] and "sma-nbo 1.00 m; greedy 1.00 m." in found["time"]
    assert "greedy: 1 of 3 maps above sma-nbo." in found["maps-ospa-mean-m"]


def test_levels_are_true_to_scale_with_their_intervals_a_line_at_the_threshold_and_every_panel():
    rng = np.random.default_rng(2)
    cells = [(("size", size), ("height", str(10 * k))) for size, k in product("136", range(14))]
    rows = [row(p, s, c, {"share_held": rng.random()}) for p in ("a", "b") for c in cells for s in range(8)]
    found = groups(rows, "a")
    held, bound = find_shown_metric("share_held"), Threshold("share_held", 0.9)
    levels = [a for a in find_levels(found, held, find_varying_factors(found)) if a.factor == "size"]
    layouts = lay_out_levels(levels)
    assert [len(layout.panels) for layout in layouts] == [12, 2]
    for layout in layouts:
        figure = draw_levels_figure(layout, held, bound)
        for axes, (title, curves) in zip(figure.axes, layout.panels.items(), strict=False):
            assert axes.get_title(loc="left") == title and title.startswith("height = ")
            assert list(axes.get_xticks()) == [1, 3, 6]
            assert [90, 90] in [list(line.get_ydata()) for line in axes.get_lines()]
            for drawn, curve in zip(axes.containers, curves, strict=True):
                own = [g for g in found if g.planner == curve.label and f"height = {dict(g.cell)['height']}" == title]
                means = [estimate_means(g.values("share_held")[:, None], [1.0])[0].cut(0, 1) for g in own]
                np.testing.assert_allclose(drawn.lines[0].get_xdata().astype(float), [1, 3, 6], atol=0.05)
                np.testing.assert_allclose(drawn.lines[0].get_ydata(), [100 * m.value for m in means])
                (bars,) = drawn.lines[2]
                np.testing.assert_allclose(
                    [segment[:, 1] for segment in bars.get_segments()], [[100 * m.low, 100 * m.high] for m in means]
                )
    pictures = draw_response_pictures(levels, held, bound)
    assert [picture.name for picture in pictures] == ["levels-size", "levels-size-2"]
    assert pictures[0].pdf.startswith(b"%PDF") and "a (height = 0, size = 1) " in pictures[0].alt


def test_points_are_maps_that_both_flew():
    found = groups()
    shown = find_shown_metric("ospa.share_under_1m")
    figure = draw_scatter_figure(map_points(found, "sma-nbo", shown), "sma-nbo", shown)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["greedy", "hover"]
    by_seed = {(g.cell, g.planner, r.seed): 100 * r.metrics[shown.name] for g in found for r in g.done}
    for axes, planner in zip(figure.axes, ("greedy", "hover"), strict=True):
        drawn = {tuple(point) for line in lines(axes) for point in np.round(line.get_xydata(), 9)}
        assert drawn == {
            (round(by_seed[g.cell, "sma-nbo", s], 9), round(by_seed[g.cell, planner, s], 9))
            for g in found[:: len(found) // 2]
            for s in range(6)
        }
        assert axes.get_xlim() == axes.get_ylim()


def test_missing_curves_and_values_do_not_stop_a_figure():
    rows = [*study(), row("late", 0, (("lambda", "15"), ("R", "5")), {"ospa.mean_m": np.nan})]
    found = groups(rows)
    (layout,) = lay_out_figures(found)
    shown = find_shown_metric("ospa.mean_m")
    for figure in (
        draw_ecdf_figure(layout),
        draw_time_figure(layout),
        draw_scatter_figure(map_points(found, "sma-nbo", shown), "sma-nbo", shown),
    ):
        assert encode_figure(figure, "svg").startswith(b"<?xml")


def texts_of(figure):
    """Titles, labels and legends of a figure, ticks aside."""
    panels = [axes for axes in figure.axes if axes.get_visible()]
    drawn = [text for axes in panels for text in (axes.xaxis.label, axes.yaxis.label, *axes.texts)]
    titles = [text for axes in panels for text in axes.findobj(Text) if text.get_text() == axes.get_title(loc="left")]
    legends = [text for legend in figure.legends for text in legend.get_texts()]
    return [text for text in (*drawn, *titles, *legends, *figure.texts) if text.get_text()]


MINE = [f"mylab.planners:InformationGreedyPlanner(horizon={k}, weight_of_what_is_not_yet_known=0.25)" for k in (3, 5)]
WORDS = ("consumer grade, with drift and with an offset of the clock", "surveyed, and corrected every second")


@pytest.mark.parametrize(
    ("planners", "cells"),
    [
        ([*MINE, "greedy", "hover", "random"], [(("navigation", word), ("R", r)) for word in WORDS for r in "15"]),
        (MINE, [()]),
        (["sma-nbo-gospa", "greedy"], [()]),
        ([f"planner-{k}" for k in range(15)], [(("lambda", density),) for density in ("15", "45", "75")]),
        (MINE[:1], [(("navigation", word), ("appearance of leaves and ground", word)) for word in WORDS]),
    ],
    ids=["long cells", "long names", "narrow", "many planners", "one planner"],
)
def test_no_text_of_a_figure_is_cut_or_runs_into_another(planners, cells):
    rows = [row(p, s, c, {"ospa.mean_m": 1.0 + s}) for c in cells for p in planners for s in range(3)]
    found, shown = groups(rows, planners[0]), find_shown_metric("ospa.share_under_1m")
    figures = [draw(layout) for layout in lay_out_figures(found) for draw in (draw_ecdf_figure, draw_time_figure)]
    if len(planners) > 1:
        points = map_points(found, planners[0], find_shown_metric("ospa.mean_m"))
        figures.append(draw_scatter_figure(points, planners[0], shown))
        scores = [Answer(cell, p, SCORE, mean=Estimate(0.5, 0.1, 0.9)) for cell in cells for p in planners]
        figures.append(draw_score_figure(scores))
    answers = find_levels(found, find_shown_metric("ospa.mean_m"), find_varying_factors(found))
    for factor in dict.fromkeys(answer.factor for answer in answers):
        (layout,) = lay_out_levels([answer for answer in answers if answer.factor == factor])
        narrow = draw_levels_figure(layout, shown, None, column=True)
        assert narrow.get_figwidth() == COLUMN and min(text.get_fontsize() for text in texts_of(narrow)) >= 8
        figures += [draw_levels_figure(layout, shown, None), narrow]
    for figure in figures:
        figure.draw_without_rendering()  # as it is saved
        boxes = {text.get_text(): text.get_window_extent() for text in texts_of(figure)}
        for text, box in boxes.items():
            assert min(box.x0, box.y0) >= 0 and box.x1 <= figure.bbox.width and box.y1 <= figure.bbox.height, text
            assert not any(box.overlaps(other) for words, other in boxes.items() if words != text), text
        assert min(axes.get_position().height * figure.get_figheight() for axes in figure.axes) > 0.5  # inches


def test_figures_whose_levels_differ_in_a_sign_have_names_of_their_own(without_pictures):
    cells = [tuple(zip(("drift", "a", "b"), cell, strict=True)) for cell in product(("-1", "1"), "xy", "xy")]
    rows = [row(planner, seed, cell) for planner in ("greedy", "hover") for cell in cells for seed in range(2)]
    drawn = [
        picture for picture in draw_pictures(groups(rows, "greedy"), "greedy", ()) if picture.name.startswith("ecdf")
    ]
    assert [picture.name for picture in drawn] == ["ecdf-drift-1", "ecdf-drift-1-2"]
    assert [picture.title.rpartition(", ")[2] for picture in drawn] == ["drift = -1", "drift = 1"]
