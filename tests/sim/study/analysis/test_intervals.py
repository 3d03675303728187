"""Intervals, tests, distributions and bands are those of their definitions."""

from math import comb

import numpy as np
import pytest
from scipy import stats

from sim.study.analysis import intervals
from sim.study.analysis.answers import holm
from sim.study.analysis.intervals import compute_p_values, count_maps_needed, estimate_means, estimate_medians
from sim.study.report.figures.charts import compute_ecdf, compute_share_under, find_quartiles


def skewed(n, columns=1, seed=0):
    return np.random.default_rng(seed).lognormal(0.0, 0.8, (n, columns))


def three(estimate):
    return estimate.value, estimate.low, estimate.high


@pytest.mark.parametrize(("n", "seed"), [(3, 1), (5, 1), (10, 2), (50, 3)])
@pytest.mark.parametrize("sign", [1, -1])
def test_intervals_of_means_are_students_lengthened_by_the_edgeworth_term(n, seed, sign):
    values = sign * skewed(n, seed=seed)[:, 0]
    student = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    quantile = stats.t.ppf(0.975, n - 1)
    reach = stats.skew(values, bias=False) * values.std(ddof=1) * (1 + 2 * quantile**2) / (6 * n)
    assert reach != 0
    expected = values.mean(), student.low + min(reach, 0), student.high + max(reach, 0)
    np.testing.assert_allclose(three(estimate_means(values[:, None])[0]), expected, rtol=1e-9)


def exact_rank(n):
    """Rank of the lower end in whole numbers: fewer than so many of n coins show heads in 2.5 % of cases at most.

    So often the true median lies below fewer than so many of n values.
    """
    outside, rank = 1, 1
    while 40 * (outside + comb(n, rank)) <= 2**n:
        outside, rank = outside + comb(n, rank), rank + 1
    return rank


def test_intervals_of_medians_are_the_innermost_values_that_hold_95_percent_and_quick():
    for n in (*range(2, 301), 1000, 3000):
        values = np.random.default_rng(n).permutation(np.arange(1.0, n + 1))
        assert three(estimate_medians(values[:, None])[0]) == ((n + 1) / 2, exact_rank(n), n + 1 - exact_rank(n))
    n = 100_000
    low = int(three(estimate_medians(np.arange(1.0, n + 1)[:, None])[0])[1])
    assert stats.binom.cdf(low - 1, n, 0.5) <= 0.025 < stats.binom.cdf(low, n, 0.5)
    assert low == pytest.approx(n / 2 - 1.96 * np.sqrt(n) / 2, abs=2)


def test_intervals_of_means_and_medians_cover_as_often_as_they_say():
    values = np.random.default_rng(5).lognormal(0.0, 1.5, (8, 4000))
    held = np.mean([e.low <= 1.0 <= e.high for e in estimate_medians(values)])
    assert held == pytest.approx(1 - 2 / 2**8, abs=0.006)
    values = np.random.default_rng(1).normal(3.0, 1.0, (30, 2000))
    covered = np.mean([e.low <= 3.0 <= e.high for e in estimate_means(values)])
    assert 0.94 <= covered <= 0.97


def test_ends_are_moved_by_a_part_of_the_range_that_shrinks_with_the_finite_maps():
    values = np.random.default_rng(5).uniform(size=(10, 3))
    values[:2, 1] = np.nan
    narrow, wide = estimate_means(values), estimate_means(values, [1.0, 2.0, np.inf])
    moved = [(a.low - b.low, b.high - a.high, b.value - a.value) for a, b in zip(narrow, wide, strict=True)]
    np.testing.assert_allclose(moved, [(0.008, 0.008, 0), (0.02, 0.02, 0), (0, 0, 0)], atol=1e-12)


@pytest.mark.parametrize("ranges", [(), [1.0], [20.0]])
@pytest.mark.parametrize("n", [6, 8, 20])
def test_the_p_value_is_that_of_the_interval_that_ends_at_zero(n, ranges, monkeypatch):
    for seed, shift in ((1, 0.8), (2, -1.5), (3, 3.0)):
        values = skewed(n, seed=seed) - shift
        (p_value,) = compute_p_values(values, ranges)
        if p_value in (1.0, 2.0 ** (1 - n)):
            continue
        with monkeypatch.context() as patch:
            patch.setattr(intervals, "LEVEL", 1 - p_value)
            estimate = estimate_means(values, ranges)[0]
        assert (estimate.low if estimate.value > 0 else estimate.high) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("n", [6, 8, 12, 40])
def test_p_values_below_5_percent_are_intervals_without_zero(n):
    values = np.random.default_rng(n).gamma(1.0, 1.0, (n, 500)) - np.linspace(0.0, 2.0, 500)
    apart = [not e.low <= 0 <= e.high for e in estimate_means(values)]
    assert [p_value <= 0.05 for p_value in compute_p_values(values)] == apart and 50 < sum(apart) < 450


@pytest.mark.parametrize("n", [1, 2, 5, 6])
def test_no_p_value_is_below_what_so_many_maps_can_give(n):
    equal, nearly = np.full((n, 1), 3.0), np.full((n, 1), 3.0) + 1e-6 * np.arange(n)[:, None]
    assert compute_p_values(equal) == [2.0 ** (1 - n)] and compute_p_values(nearly) == [2.0 ** (1 - n)]
    assert compute_p_values(np.zeros((n, 1))) == [1.0] and (compute_p_values(equal)[0] <= 0.05) == (n >= 6)
    assert compute_p_values(np.full((3, 1), np.nan)) == compute_p_values(np.zeros((0, 1))) == [1.0]


def test_holms_correction_is_that_of_its_definition_and_errs_in_5_percent():
    assert holm([0.01, 0.04, 0.03, 0.005]) == [True, False, False, True]
    assert holm([]) == [] and holm([0.05]) == [True] and holm([0.026, 0.026]) == [False, False]
    rng = np.random.default_rng(1)
    for _ in range(200):
        given = rng.beta(0.3, 3.0, rng.integers(1, 8)).round(3).tolist()
        rejected = [False] * len(given)
        for k, i in enumerate(sorted(range(len(given)), key=given.__getitem__)):  # the least against 5 %/m, and so on
            if given[i] * (len(given) - k) > 0.05:
                break
            rejected[i] = True
        assert holm(given) == rejected
    families = np.random.default_rng(2).uniform(size=(4000, 5))
    assert np.mean([any(holm(row)) for row in families.tolist()]) == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("shift", [0.3, 0.6, 1.0, -0.6])
def test_maps_needed_are_the_fewest_with_the_power(shift):
    values = np.random.default_rng(4).normal(0, 1, (30, 1))
    values = (values - values.mean()) / values.std(ddof=1) + shift
    (needed,) = count_maps_needed(values)

    def power(n):
        end = stats.t.ppf(0.975, n - 1)
        return stats.nct.sf(end, n - 1, abs(shift) * np.sqrt(n))

    assert power(needed) >= 0.8 > power(needed - 1)


def test_maps_needed_have_ends():
    assert count_maps_needed(np.full((4, 1), 2.0)) == [6.0] and count_maps_needed(np.array([[1.0], [-1.0]])) == [np.inf]
    assert count_maps_needed(1e-6 + np.array([[1.0], [-1.0]])) == [np.inf]
    assert np.isnan(count_maps_needed(np.ones((1, 1)))).all()


def test_columns_are_independent_and_few_maps_have_no_interval():
    values = skewed(8, columns=4)
    for function in (estimate_means, estimate_medians):
        for j, estimate in enumerate(function(values)):
            np.testing.assert_allclose(three(estimate), three(function(values[:, j : j + 1])[0]), rtol=1e-12)
    for function in (estimate_means, estimate_medians):
        np.testing.assert_array_equal(three(function(np.array([[2.0]]))[0]), (2.0, np.nan, np.nan))
        np.testing.assert_array_equal(three(function(np.zeros((0, 1)))[0]), (np.nan, np.nan, np.nan))
        assert function(np.zeros((3, 0))) == []


@pytest.mark.parametrize("n", [2, 3, 7, 50])
def test_equal_values_have_a_median_of_no_width_and_no_interval_of_their_mean(n):
    values = np.full((n, 1), 0.1)
    np.testing.assert_allclose(three(estimate_medians(values)[0]), (0.1, 0.1, 0.1), rtol=1e-15)
    np.testing.assert_allclose(three(estimate_means(values)[0]), (0.1, np.nan, np.nan), rtol=1e-15)


@pytest.mark.parametrize(("n", "ties", "told"), [(10, 4, True), (10, 5, False), (40, 34, True), (40, 35, False)])
def test_means_have_an_interval_if_six_values_differ_from_the_most_common_one(n, ties, told):
    for common in (0.0, 0.7):
        values = np.concatenate([np.full(ties, common), common + 0.1 * np.arange(1, n - ties + 1)])[:, None]
        assert np.isfinite(three(estimate_means(values)[0])[1:]).all() == told
    for few in ([1.0, 2.0], [1.0, 2.0, 3.0, 4.0, 5.0]):
        assert np.isfinite(estimate_means(np.array(few)[:, None])[0].low)
        assert np.isnan(estimate_means(np.array([few[0], *few])[:, None])[0].low)


def test_ties_do_not_count_as_maps_in_the_least_p_value():
    for n in (3, 5, 6):
        values = np.concatenate([np.zeros(30), 100.0 + 1e-6 * np.arange(n)])[:, None]
        assert compute_p_values(values)[0] >= 2.0 ** (1 - n)
    assert compute_p_values(np.array([[0.0], [1e-3]])) == [1.0]


@pytest.mark.parametrize("gap", [np.nan, np.inf, -np.inf])
def test_undefined_values_are_left_out(gap):
    values = skewed(6, columns=2)
    holed = np.insert(values, 3, [gap, 5.0], axis=0)
    for function in (estimate_means, estimate_medians):
        assert function(holed)[0] == function(values[:, :1])[0] and np.isfinite(three(function(holed)[1])).all()


def test_distributions_are_shares_at_or_below_and_bands_quartiles():
    values = np.array([0.5, 2.0, 0.5, np.nan, 1.0], dtype=np.float32)
    at = np.array([0.4, 0.5, 0.7, 1.0, 2.0, 9.0])
    brute = [np.mean([v <= x for v in (0.5, 2.0, 0.5, 1.0)]) for x in at]
    np.testing.assert_array_equal(compute_ecdf(values, at), brute)
    assert compute_share_under(values, 1.0) == 0.5
    assert np.isnan(compute_ecdf(np.array([np.nan]), at)).all() and np.isnan(compute_share_under(np.zeros(0), 1.0))
    curves = np.array([[1.0, 4.0, np.nan], [2.0, 8.0, np.nan], [3.0, np.nan, np.nan], [4.0, 6.0, np.nan]])
    expected = [[1.75, 5.0, np.nan], [2.5, 6.0, np.nan], [3.25, 7.0, np.nan]]
    np.testing.assert_array_equal(find_quartiles(curves), expected)


def test_equal_differences_that_rare_maps_outweigh_show_nothing():
    for size, shown in ((0.001, False), (0.02, True)):  # of a share, with 0.008 for maps that ten lack
        (p_value,) = compute_p_values(np.full((10, 1), size), [1.0])
        assert (p_value <= 0.05) == shown
