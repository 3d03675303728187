"""Levels are compared as SciPy's paired tests and a plain step-down do, and chosen on maps that do not judge them."""

from itertools import product

import numpy as np
import pytest
from helpers.trials import failed, row
from scipy import stats

from sim.study.analysis.groups import drop_constant_factors, find_varying_factors, group_rows
from sim.study.analysis.intervals import estimate_means
from sim.study.analysis.levels import Threshold, find_choices, find_levels
from sim.study.analysis.metric_choice import find_shown_metric

HELD, ERROR, NEES = map(find_shown_metric, ("share_held", "gospa.mean_m", "nees.position.mean"))
FACTOR = find_shown_metric("real_time_factor")  # of which higher values are better, without a bound
NOISE = np.array([-0.05, -0.03, -0.02, -0.01, -0.005, 0.005, 0.01, 0.02, 0.03, 0.05])  # without skewness


def rows_of(values, factors=("H",), planner="sma-nbo", metric=HELD.name):
    """Rows with the values (maps,) of each level, or tuple of levels."""
    return [
        row(planner, seed, tuple(zip(factors, (level,) if isinstance(level, str) else level, strict=True)), {metric: v})
        for level, of_maps in values.items()
        for seed, v in enumerate(of_maps)
    ]


def levels(rows, metric=HELD, threshold=None, **order):
    groups = drop_constant_factors(group_rows(rows, levels=order))
    return find_levels(groups, metric, find_varying_factors(groups, order), threshold)


def choices(rows, chosen, metric=HELD, threshold=None):
    return find_choices(drop_constant_factors(group_rows(rows)), metric, chosen, threshold)


def step_down(p_values, level=0.05):
    """Holm's procedure, test by test."""
    kept = set()
    for k, (name, p) in enumerate(sorted(p_values.items(), key=lambda item: item[1])):
        if p > level / (len(p_values) - k):
            break
        kept.add(name)
    return kept


def test_differences_from_the_level_before_and_the_best_are_scipys_paired_tests_with_holm():
    maps = np.random.default_rng(0).uniform(0.2, 0.4, 10)  # some are harder, at all levels
    values = {"1": maps, "3": maps + 0.025 + NOISE, "5": maps + 0.045 + 1.5 * NOISE, "10": maps + 0.04 + 0.5 * NOISE}
    found = levels(rows_of(values, metric=FACTOR.name), FACTOR)
    assert [answer.level for answer in found] == ["1", "3", "5", "10"] and {a.planner for a in found} == {"sma-nbo"}
    assert [answer.gap is None for answer in found] == [False, False, True, False]
    assert [answer.step is None for answer in found] == [True, False, False, False]
    steps = [answer.step for answer in found[1:]]
    compared = dict(zip((("3", "1"), ("5", "3"), ("10", "5"), ("1", "5")), (*steps, found[0].gap), strict=True))
    for (one, other), gap in compared.items():
        test = stats.ttest_rel(values[one], values[other])
        assert gap.p_value == pytest.approx(test.pvalue, rel=1e-6)
        assert (gap.mean.low, gap.mean.high) == pytest.approx(tuple(test.confidence_interval()), rel=1e-6)
    kept = step_down({pair: gap.p_value for pair, gap in compared.items()})
    assert {pair for pair, gap in compared.items() if gap.survives} == kept and len(kept) == 2
    assert sum(gap.significant for gap in compared.values()) == 3  # so one is lost by the correction
    assert found[1].gap.survives == found[2].step.survives and found[1].gap.mean.value == -found[2].step.mean.value
    assert found[3].gap == found[3].step  # the best is the one before: one test, which counts once


def test_levels_are_in_the_order_given_else_in_that_of_numbers_and_one_alone_is_no_line():
    values = {name: 0.5 + NOISE for name in ("none", "some", "all")}
    assert [answer.level for answer in levels(rows_of(values))] == ["all", "none", "some"]
    assert [answer.level for answer in levels(rows_of(values), H=tuple(values))] == list(values)
    crossed = {("1", "15"): NOISE, ("2", "15"): NOISE, ("2", "30"): NOISE}
    found = levels(rows_of(crossed, ("size", "height")))
    assert [(a.factor, a.others, a.level) for a in found] == [
        ("size", (("height", "15"),), "1"),
        ("size", (("height", "15"),), "2"),
        ("height", (("size", "2"),), "15"),
        ("height", (("size", "2"),), "30"),
    ]


def test_the_least_is_best_of_errors_and_no_level_is_where_neither_direction_is_better():
    values = {"1": 3.0 + NOISE, "2": 2.0 + NOISE, "3": np.full(10, np.nan)}
    found = levels(rows_of(values, metric=ERROR.name), ERROR)
    assert [answer.gap is None for answer in found] == [False, True, False]
    assert found[0].gap.mean.value == pytest.approx(1.0) and found[2].gap.pairs == found[2].found.maps == 0
    assert not found[2].gap.survives
    assert {answer.gap for answer in levels(rows_of(values, metric=NEES.name), NEES)} == {None}


def test_the_confidence_in_a_threshold_is_that_of_scipys_test_of_one_side():
    values = {"1": 0.89 + NOISE, "2": 0.92 + NOISE, "3": np.array([1.0] * 6 + [0.7] * 4), "4": np.ones(10)}
    for threshold, greater in ((Threshold("x", 0.9), True), (Threshold("x", 0.9, False), False)):
        found = levels(rows_of(values, metric=FACTOR.name), FACTOR, threshold)
        for answer in found[:2]:
            side = "greater" if greater else "less"
            expected = 1 - stats.ttest_1samp(values[answer.level], 0.9, alternative=side).pvalue
            assert answer.found.sure == pytest.approx(expected, rel=1e-9)
        met = [int(np.sum(v >= 0.9 if greater else v <= 0.9)) for v in values.values()]
        assert [answer.found.met for answer in found] == met
        assert np.isnan([answer.found.sure for answer in found[2:]]).all()  # too many ties


def test_the_best_is_chosen_on_the_first_half_of_the_seeds_and_judged_on_the_others():
    lucky = np.array([0.9] * 6 + [0.2, 0.25, 0.3, 0.35, 0.4]) + 0.0
    steady = np.linspace(0.6, 0.7, 11)
    third = np.linspace(0.5, 0.6, 11)
    (found,) = choices(rows_of({"1": steady, "2": lucky, "3": third}), ["H"])
    assert (found.planner, found.others, found.options, found.levels) == ("sma-nbo", (), 3, (("H", "2"),))
    assert found.chosen_on == [0, 1, 2, 3, 4, 5] and found.judged_on == [6, 7, 8, 9, 10]
    assert found.before.mean.value == pytest.approx(0.9) and found.after.mean.value == pytest.approx(0.3)
    assert found.rival == (("H", "1"),)
    assert found.gap.mean == estimate_means((lucky - steady)[6:, None], [1.0])[0] and found.gap.pairs == 5
    assert choices(rows_of({"1": steady[:1], "2": lucky[:1]}), ["H"]) == []  # no seed is left to judge on


def test_the_cheapest_is_the_first_in_order_whose_mean_meets_the_threshold():
    rng = np.random.default_rng(3)
    values = {pair: rng.uniform(0.6, 1.0, 12) for pair in product("123", ("15", "30"))}
    for bound in np.linspace(0.6, 0.95, 15):
        (found,) = choices(rows_of(values, ("size", "height")), ["size", "height"], threshold=Threshold("x", bound))
        meeting = [pair for pair in values if values[pair][:6].mean() >= bound]
        if not meeting:
            assert found.levels is None and found.options == 6
            continue
        assert found.levels == tuple(zip(("size", "height"), meeting[0], strict=True)) and found.rival is None
        late = values[meeting[0]][6:]
        assert found.after.mean.value == pytest.approx(late.mean()) and found.after.met == np.sum(late >= bound)


def test_what_nobody_chooses_divides_the_choices_and_failed_maps_do_not_count():
    values = {("15", "1"): 0.9 + NOISE, ("15", "2"): 0.8 + NOISE, ("75", "1"): 0.5 + NOISE, ("75", "2"): 0.6 + NOISE}
    rows = [r for p in ("sma-nbo", "greedy") for r in rows_of(values, ("lambda", "H"), p)]
    bad = [r for r in rows if (r.planner, r.seed, dict(r.factors)["H"]) == ("greedy", 9, "1")]
    rows = [r for r in rows if r not in bad] + [failed("greedy", 9, r.factors) for r in bad]
    found = choices(rows, ["H"])
    assert [(c.planner, c.others[0][1], c.levels[0][1]) for c in found] == [
        ("greedy", "15", "1"),
        ("sma-nbo", "15", "1"),
        ("greedy", "75", "2"),
        ("sma-nbo", "75", "2"),
    ]
    assert [c.after.maps for c in found] == [4, 5, 5, 5] and {len(c.judged_on) for c in found} == {5}


def test_one_that_was_not_flown_on_the_hard_maps_is_neither_chosen_nor_the_best():
    hard = np.where(np.arange(10) < 2, -0.4, 0.0)
    rows = rows_of({"1": 0.9 + NOISE + hard, "2": 0.93 + NOISE + hard, "3": 0.88 + NOISE + hard})
    left = [r for r in rows if not (dict(r.factors)["H"] == "3" and r.seed < 2)]
    (one,) = choices(left, ["H"])
    assert one.levels == (("H", "2"),)
    (cheapest,) = choices(left, ["H"], threshold=Threshold(HELD.name, 0.8, True))
    assert cheapest.levels is None  # without the hard maps the third has 0.88
    assert [answer.gap is None for answer in levels(left)] == [False, True, False]
