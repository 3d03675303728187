"""Cells, pairs and differences are those that a count by hand gives."""

import msgspec
import numpy as np
import pytest
from helpers.trials import failed, row, study

from sim.facts.metrics.metric import Metric
from sim.study.analysis.answers import find_answers, holm
from sim.study.analysis.groups import drop_constant_factors, find_constant_factors, find_varying_factors, group_rows
from sim.study.analysis.intervals import compute_p_values, count_maps_needed, estimate_means, estimate_medians
from sim.study.analysis.labels import find_baseline
from sim.study.analysis.metric_choice import choose_metrics, find_outside_metrics, find_shown_metric, list_available
from tracking.errors import InputError

MEAN, SHARE, NEES = (
    find_shown_metric("ospa.mean_m"),
    find_shown_metric("ospa.share_under_1m"),
    find_shown_metric("nees.position.mean"),
)


def flown(planner, values, name="ospa.mean_m", factors=()):
    return [row(planner, seed, factors, {name: value}) for seed, value in values.items()]


def answer(rows, baseline, asked=MEAN, planner="greedy", cell=()):
    found = find_answers(group_rows(rows, baseline), [asked], baseline)
    (one,) = [a for a in found if (a.planner, a.cell) == (planner, cell)]
    return one


def test_pairs_are_by_seed_and_what_is_better_depends_on_the_metric():
    rows = flown("greedy", {2: 5.0, 0: 1.0, 1: 2.0}) + flown("sma-nbo", {1: 2.0, 2: 1.0, 0: 3.0})
    gap = answer(rows, "sma-nbo").difference
    assert (gap.pairs, gap.unpaired, gap.won, gap.tied, gap.lost) == (3, 0, 1, 1, 1)
    assert gap.mean == estimate_means(np.array([[-2.0], [0.0], [4.0]]))[0]
    one, other = (find_answers(group_rows(r, "sma-nbo"), [MEAN], "sma-nbo") for r in (rows, rows[::-1]))
    assert one == other
    for asked, expected in ((MEAN, (0, 0, 2)), (SHARE, (2, 0, 0)), (NEES, (0, 0, 0))):
        rows = flown("sma-nbo", {0: 0.1, 1: 0.2}, asked.name) + flown("greedy", {0: 0.5, 1: 0.6}, asked.name)
        gap = answer(rows, "sma-nbo", asked).difference
        assert (gap.won, gap.tied, gap.lost) == expected


def test_failed_undefined_and_lonely_maps_are_counted_and_left_out():
    rows = [*flown("sma-nbo", {0: 1.0, 1: 1.0, 2: np.nan, 3: 1.0}), failed("sma-nbo", 4)]
    rows += [*flown("greedy", {0: 2.0, 1: np.inf, 2: 2.0, 4: 2.0, 9: 3.0}), failed("greedy", 3)]
    both = [*rows, failed("sma-nbo", 5), failed("greedy", 5)]
    assert answer(both, "sma-nbo").difference.unpaired == 6
    one = answer(rows, "sma-nbo")
    assert (one.maps, one.flown, one.trials, one.failed, one.undefined) == (4, 6, 5, 1, 1)
    assert one.mean == estimate_means(np.array([[2.0], [2.0], [2.0], [3.0]]))[0]
    assert (one.difference.pairs, one.difference.unpaired) == (1, 5)  # seeds 1, 2, 3, 4 and 9 lack one of both
    base = answer(rows, "sma-nbo", planner="sma-nbo")
    assert (base.maps, base.flown, base.trials, base.failed, base.undefined) == (3, 5, 4, 1, 1)
    assert base.difference is None


def test_a_trial_counts_as_faulty_from_one_fault_on():
    rows = [row("greedy", seed, metrics={"ospa.mean_m": 1.0, "faults": float(seed)}) for seed in range(3)]
    assert answer(rows, "greedy").faulty == 2


def test_cells_without_baseline_and_groups_that_failed_are_there():
    rows = flown("sma-nbo", {0: 1.0}, factors=(("R", "1"),)) + flown("greedy", {0: 1.0}, factors=(("R", "5"),))
    gap = answer(rows, "sma-nbo", cell=(("R", "5"),)).difference
    assert (gap.pairs, gap.unpaired) == (0, 1) and np.isnan(gap.mean.value)
    rows = [*flown("sma-nbo", {0: 1.0}), failed("greedy", 0)]
    one = answer(rows, "sma-nbo")
    assert (one.maps, one.failed) == (0, 1) and np.isnan(one.mean.value)


def again(planner, values, factors=()):
    """Rows of maps by seed, each with the values of its repeats; None where one failed."""
    return [
        failed(planner, seed, factors, repeat=r)
        if v is None
        else row(planner, seed, factors, {"ospa.mean_m": v}, repeat=r)
        for seed, found in values.items()
        for r, v in enumerate(found)
    ]


def test_a_map_counts_once_with_the_mean_of_its_repeats():
    rows = again("sma-nbo", {0: [1.0, 3.0], 1: [4.0, 8.0], 2: [0.0, 2.0]})
    rows += again("greedy", {0: [3.0, 3.0], 1: [4.0, 8.0], 2: [1.0, 2.0]})
    one, base = answer(rows, "sma-nbo"), answer(rows, "sma-nbo", planner="sma-nbo")
    expected = estimate_means(np.array([[2.0], [6.0], [1.0]]))[0]
    assert (base.mean.value, base.mean.low, base.mean.high) == (3.0, 0.0, expected.high)  # no error is below zero
    assert base.median == estimate_medians(np.array([[2.0], [6.0], [1.0]]))[0]
    assert (base.maps, base.flown, base.trials) == (3, 3, 6)
    gaps = np.array([[1.0], [0.0], [0.5]])
    gap = one.difference
    assert (
        gap.mean == estimate_means(gaps)[0]
        and gap.p_value == compute_p_values(gaps)[0]
        and [gap.needed] == count_maps_needed(gaps)
    )
    assert (gap.pairs, gap.unpaired, gap.won, gap.tied, gap.lost) == (3, 0, 0, 1, 2)


def test_repeats_count_whatever_their_order_without_those_that_failed():
    rows = again("sma-nbo", {0: [1.0, 3.0], 1: [4.0, 8.0]}) + again("greedy", {0: [3.0, 3.0], 1: [4.0, 9.0]})
    assert answer(rows[::-1], "sma-nbo") == answer(rows, "sma-nbo")
    rows = again("sma-nbo", {0: [1.0, 3.0], 1: [4.0, None], 2: [5.0, 5.0]})
    rows += again("greedy", {0: [None, 4.0], 1: [None, 6.0], 2: [5.0, 6.0]})
    one = answer(rows, "sma-nbo")
    assert (one.maps, one.flown, one.trials, one.failed) == (3, 3, 4, 2)
    gap = one.difference
    assert gap.mean == estimate_means(np.array([[1.0], [0.5]]))[0]  # map 1 has no repeat that both flew
    assert (gap.pairs, gap.unpaired) == (2, 1)


def test_intervals_end_where_values_do():
    rows = flown("sma-nbo", {s: v for s, v in enumerate((1.0, 0.99, 0.98, 0.97, 0.2))}, "ospa.share_under_1m")
    share = answer(rows, "sma-nbo", SHARE, "sma-nbo").mean
    free = estimate_means(np.array([[1.0, 0.99, 0.98, 0.97, 0.2]]).T)[0]
    assert (share.low, share.high) == (0.0, 1.0) and free.low < 0 and free.high > 1
    rows += flown("greedy", {s: v for s, v in enumerate((0.0, 0.01, 0.02, 0.03, 0.2))}, "ospa.share_under_1m")
    gap = answer(rows, "sma-nbo", SHARE).difference.mean
    assert gap.low == -1.0 and estimate_means(np.array([[-1.0, -0.98, -0.96, -0.94, 0]]).T)[0].low < -1
    error = answer(flown("sma-nbo", {0: 0.0, 1: 0.1, 2: 9.0}), "sma-nbo", planner="sma-nbo").mean
    assert error.low == 0.0 and error.high > 9.0


def test_metrics_from_outside_may_be_negative():
    lag = Metric("lag", name="mine:LAG")
    rows = flown("sma-nbo", {0: -3.0, 1: -4.0, 2: -5.0}, lag.name)
    assert answer(rows, "sma-nbo", lag, "sma-nbo").mean == estimate_means(np.array([[-3.0], [-4.0], [-5.0]]))[0]


def test_all_differences_are_judged_together():
    rows = [row("base", s, metrics={"ospa.mean_m": 1.0, "detection.recall": 0.5}) for s in range(8)]
    rows += [
        row("worse", s, metrics={"ospa.mean_m": 2.0 + 0.01 * s, "detection.recall": 0.4 + 0.001 * s}) for s in range(8)
    ]
    every = find_answers(group_rows(rows, "base"), [MEAN, find_shown_metric("detection.recall")], "base")
    found = [a.difference for a in every if a.difference]
    assert [gap.survives for gap in found] == holm([gap.p_value for gap in found]) == [True, True]
    worse = [r for r in rows if r.planner == "worse"]
    many = [*rows, *(msgspec.structs.replace(r, planner=f"w{k}") for k in range(6) for r in worse)]
    crowd = [a.difference for a in find_answers(group_rows(many, "base"), [MEAN], "base") if a.difference]
    assert {gap.p_value for gap in crowd} == {2 / 2**8} and not any(gap.survives for gap in crowd)  # 7 x 2 / 2⁸ > 5 %


def test_differences_without_a_pair_are_no_tests_and_take_no_stars():
    rows = [row("base", s, metrics={"ospa.mean_m": 1.0}) for s in range(6)]
    rows += [row("worse", s, metrics={"ospa.mean_m": 2.0 + 0.01 * s}) for s in range(6)]
    asked = [
        MEAN,
        find_shown_metric("detection.recall"),
        find_shown_metric("detection.precision"),
    ]  # which no trial has
    found = find_answers(group_rows(rows, "base"), asked, "base")
    assert [a.difference.survives for a in found if a.difference] == [True, False, False]


def test_over_all_cells_each_seed_counts_once_whole_and_with_its_baseline():
    cells = [(("R", "1"),), (("R", "5"),)]
    rows = flown("sma-nbo", {0: 0.0, 1: 0.0, 2: 0.0}, factors=cells[0])
    rows += flown("greedy", {0: 1.0, 1: 2.0, 2: 3.0}, factors=cells[0])
    rows += flown("sma-nbo", {0: 0.0, 1: 0.0}, factors=cells[1]) + flown("greedy", {0: -2.0, 1: 4.0}, factors=cells[1])
    gap = answer(rows, "sma-nbo", cell=None).difference
    assert gap.mean == estimate_means(np.array([[-0.5], [3.0]]))[0]
    assert (gap.pairs, gap.unpaired, gap.won, gap.lost, gap.cells) == (2, 1, 1, 1, 2)
    cells = [(("R", "1"),), (("R", "5"),)]
    rows = again("sma-nbo", {0: [0.0, 0.0], 1: [0.0, 0.0]}, cells[0])
    rows += again("greedy", {0: [1.0, 2.0], 1: [3.0, 3.0]}, cells[0])
    rows += again("sma-nbo", {0: [0.0, 0.0], 1: [0.0, None]}, cells[1])
    rows += again("greedy", {0: [3.0, 4.0], 1: [5.0, 7.0]}, cells[1])
    gap = answer(rows, "sma-nbo", cell=None).difference
    assert gap.mean == estimate_means(np.array([[2.5], [4.0]]))[0] and (gap.pairs, gap.unpaired, gap.cells) == (2, 0, 2)
    rows = [row(p, s, (("R", r),)) for p in ("sma-nbo", "greedy") for r in "15" for s in (0, 1)]
    rows += [row("greedy", s, (("R", "9"),)) for s in (0, 1)]
    gap = answer(rows, "sma-nbo", cell=None).difference
    assert (gap.pairs, gap.unpaired, gap.tied, gap.cells) == (2, 0, 2, 2)


def test_what_cancels_but_for_rounding_is_a_tie():
    shares = {"1": (150, 151), "3": (120, 121), "5": (100, 98)}  # of 201 scans: one more, one more, two fewer
    rows = []
    for seed in range(8):
        for r, counts in shares.items():
            for planner, count in zip(("sma-nbo", "greedy"), counts, strict=True):
                rows.append(row(planner, seed, (("R", r),), {SHARE.name: count / 201}))
    by_cell = answer(rows, "sma-nbo", SHARE, cell=None).difference
    repeats = [msgspec.structs.replace(r, factors=(), repeat=int(r.factors[0][1])) for r in rows]
    for gap in (by_cell, answer(repeats, "sma-nbo", SHARE).difference):
        assert (gap.won, gap.tied, gap.lost, gap.mean.value, gap.p_value) == (0, 8, 0, 0.0, 1.0)


def test_labels_keep_what_tells_planners_apart_in_natural_order():
    rows = [row(p, 0, (("lambda", d),)) for d in ("75", "15", "5") for p in ("mcr", "hover", "greedy")]
    groups = group_rows(rows, "hover")
    assert [g.cell[0][1] for g in groups[::3]] == ["5", "15", "75"]
    assert [g.planner for g in groups[:3]] == ["hover", "greedy", "mcr"]
    rows = [
        row(f"sma-nbo(horizon={h}, optimizer=swarm, weights=(1, {h}))", s, (("H", h),))
        for h in ("1", "3")
        for s in (0, 1)
    ] + [row("greedy", s, (("H", h),)) for h in ("1", "3") for s in (0, 1)]
    groups = group_rows(rows, find_baseline(rows, "sma-nbo"))
    assert [g.planner for g in groups] == ["sma-nbo(optimizer=swarm)", "greedy"] * 2
    for baseline in ("sma-nbo", rows[0].planner, "sma-nbo(optimizer=swarm)", None):
        assert find_baseline(rows, baseline) == "sma-nbo(optimizer=swarm)"
    rows = [row(f"sma-nbo(horizon={h})", s) for h in (1, 3) for s in (0, 1)]
    assert [g.planner for g in group_rows(rows)] == ["sma-nbo(horizon=1)", "sma-nbo(horizon=3)"]


def test_factors_are_what_varies_scenario_and_version_included():
    rows = [row(seed=0, scenario="forest"), row(seed=0, scenario="park", version="0.2.0")]
    assert find_varying_factors(group_rows(rows)) == {"scenario": ["forest", "park"], "version": ["0.1.0", "0.2.0"]}
    groups = group_rows(study())
    assert find_constant_factors(groups) == (("R", "5"),)
    assert {g.cell for g in drop_constant_factors(groups)} == {(("lambda", "15"),), (("lambda", "75"),)}


def test_wrong_names_and_trials_that_are_there_twice_are_refused():
    with pytest.raises(InputError, match=r"--baseline: 'gredy' is not one of .* did you mean greedy\?"):
        find_baseline(study(), "gredy")
    with pytest.raises(InputError, match=r"--metric: 'ospa.mean' is unknown; .* did you mean ospa.mean_m\?"):
        choose_metrics(study(), ["ospa.mean"])
    with pytest.raises(InputError, match=r"--metric: 'ospa.maen_m' .* did you mean ospa.mean_m\?"):
        find_outside_metrics(["detection.recall", "ospa.maen_m"])
    with pytest.raises(InputError, match="no trials"):
        find_baseline([], None)
    with pytest.raises(InputError, match=r"greedy, seed 3 is there twice in λ = 15; flights with other settings or"):
        group_rows([row("greedy", 3, (("lambda", "15"),))] * 2)


def test_the_usual_metrics_are_shown_unless_others_are_asked_for():
    rows = [*study(), row(seed=99, metrics={"new_m": 1.0})]
    assert [m.name for m in choose_metrics(rows, [])] == ["ospa.share_under_1m", "ospa.mean_m", "ospa.median_m"]
    assert [m.name for m in choose_metrics(rows, ["new_m", "new_m"])] == ["new_m"]
    assert find_shown_metric("new_m").title == "new m [m]" and find_shown_metric("new_m").better == "neither"
    assert list_available(rows)[-1] == "new_m"
    assert choose_metrics([failed()], ["ospa.mean_m"]) == [MEAN]  # where all failed, no name is unknown


@pytest.mark.parametrize(
    ("name", "decile", "worst"),
    [("gospa.mean_m", 8.1, (9.0, 104)), ("share_held", 0.9, (0.0, 100)), ("nees.position.mean", 8.1, (9.0, 104))],
)
def test_the_tail_is_on_the_side_of_bad_missions_and_names_the_worst_one(name, decile, worst):
    """Seeds 100 to 109 have the values 0, 5, 1, 6, 9, 2, 7, 3, 8, 4; repeats are averaged, missing values left out."""
    values = [0.0, 5.0, 1.0, 6.0, 9.0, 2.0, 7.0, 3.0, 8.0, 4.0]
    rows = [row(seed=100 + k, repeat=j, metrics={name: v - 5 + 10 * j}) for k, v in enumerate(values) for j in (0, 1)]
    rows += [row(seed=99, metrics={name: np.nan}), row(seed=98, metrics={name: np.inf}), failed(seed=97)]
    (answer,) = find_answers(group_rows(rows), [find_shown_metric(name)], "sma-nbo")
    assert answer.tail.decile == pytest.approx(decile) and (answer.tail.worst, answer.tail.seed) == worst


def test_no_value_has_no_tail():
    (answer,) = find_answers(group_rows([failed()]), [find_shown_metric("gospa.mean_m")], "sma-nbo")
    assert np.isnan([answer.tail.decile, answer.tail.worst]).all() and answer.tail.seed is None
