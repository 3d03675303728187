"""Figures of a study show the data they are given."""

from itertools import product

import numpy as np
from helpers.trials import row, study

from sim.study.analysis.answers import map_points
from sim.study.analysis.groups import drop_constant_factors, group_rows
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.report.figures.charts import AT, draw_ecdf_figure, draw_scatter_figure, draw_time_figure, find_quartiles
from sim.study.report.figures.panels import lay_out_figures
from sim.study.report.figures.pictures import draw_pictures, encode_figure


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
            pooled = np.concatenate([r.ospa for r in curve.group.done])
            brute = [100 * np.mean(pooled <= x) for x in AT]
            np.testing.assert_allclose(line.get_ydata(), brute, rtol=1e-12)
        assert axes.get_xscale() == "log" and "logarithmic" in figure.axes[-1].get_xlabel()
    figure = draw_time_figure(layout)
    for axes, curves in zip(figure.axes, layout.panels.values(), strict=True):
        for line, shade, curve in zip(lines(axes), axes.collections, curves, strict=True):
            low, median, high = find_quartiles(np.array([r.ospa for r in curve.group.done], dtype=float))
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


def test_figures_whose_levels_differ_in_a_sign_have_names_of_their_own(without_pictures):
    cells = [tuple(zip(("drift", "a", "b"), cell, strict=True)) for cell in product(("-1", "1"), "xy", "xy")]
    rows = [row(planner, seed, cell) for planner in ("greedy", "hover") for cell in cells for seed in range(2)]
    drawn = [
        picture for picture in draw_pictures(groups(rows, "greedy"), "greedy", ()) if picture.name.startswith("ecdf")
    ]
    assert [picture.name for picture in drawn] == ["ecdf-drift-1", "ecdf-drift-1-2"]
    assert [picture.title.rpartition(", ")[2] for picture in drawn] == ["drift = -1", "drift = 1"]
