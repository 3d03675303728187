"""Intervals, distributions and bands are those of their definitions."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import bootstrap

from sim.study.statistics import (
    RESAMPLES,
    bands,
    ecdf,
    means,
    medians,
    resampled_means,
    resampled_medians,
    share_under,
)


def skewed(n, columns=1, seed=0):
    return np.random.default_rng(seed).lognormal(0.0, 0.8, (n, columns))


def three(estimate):
    return estimate.value, estimate.low, estimate.high


@pytest.mark.parametrize(("n", "seed"), [(5, 1), (10, 2), (50, 3)])
def test_intervals_of_means_are_bca_intervals_of_the_same_resamples(n, seed):
    values = skewed(n, seed=seed)
    drawn = SimpleNamespace(bootstrap_distribution=resampled_means(values)[0])
    peer = bootstrap(
        (values[:, 0],), np.mean, n_resamples=0, bootstrap_result=drawn, method="BCa", vectorized=True
    ).confidence_interval
    np.testing.assert_allclose(three(means(values)[0]), (values.mean(), peer.low, peer.high), rtol=1e-9)


def test_intervals_of_medians_are_percentiles_of_the_same_resamples():
    values = skewed(9)
    drawn = SimpleNamespace(bootstrap_distribution=resampled_medians(values)[0])
    peer = bootstrap(
        (values[:, 0],), np.median, n_resamples=0, bootstrap_result=drawn, method="percentile", vectorized=True
    ).confidence_interval
    np.testing.assert_allclose(three(medians(values)[0]), (np.median(values), peer.low, peer.high), rtol=1e-12)


@pytest.mark.parametrize("n", [3, 4, 5])
def test_resamples_spread_as_all_samples_with_replacement_do(n):
    values = skewed(n)
    every = np.array([values[list(chosen), 0] for chosen in product(range(n), repeat=n)])
    for drawn, exact in (
        (resampled_means(values)[0], every.mean(axis=1)),
        (resampled_medians(values)[0], np.median(every, axis=1)),
    ):
        at = np.unique(np.round(exact, 9)) + 1e-9
        error = np.abs(np.mean(drawn[:, None] <= at, axis=0) - np.mean(exact[:, None] <= at, axis=0))
        assert error.max() < 1.63 / np.sqrt(RESAMPLES)  # Kolmogorov's bound at 1 %


def test_intervals_come_near_those_of_a_fresh_bootstrap():
    values = skewed(20)
    peer = bootstrap((values[:, 0],), np.mean, n_resamples=20000, rng=np.random.default_rng(9)).confidence_interval
    estimate = means(values)[0]
    width = peer.high - peer.low
    assert abs(estimate.low - peer.low) < 0.05 * width and abs(estimate.high - peer.high) < 0.05 * width


def test_intervals_of_means_cover_the_truth_nearly_as_often_as_they_say():
    values = np.random.default_rng(1).normal(3.0, 1.0, (30, 600))
    covered = np.mean([e.low <= 3.0 <= e.high for e in means(values)])
    assert 0.92 <= covered <= 0.97


def test_columns_do_not_depend_on_one_another():
    values = skewed(8, columns=4)
    for function in (means, medians):
        for j, estimate in enumerate(function(values)):
            np.testing.assert_allclose(three(estimate), three(function(values[:, j : j + 1])[0]), rtol=1e-12)


def test_the_same_values_give_the_same_intervals():
    assert means(skewed(12)) == means(skewed(12))


def test_one_map_has_no_interval_and_none_has_no_value():
    for function in (means, medians):
        np.testing.assert_array_equal(three(function(np.array([[2.0]]))[0]), (2.0, np.nan, np.nan))
        np.testing.assert_array_equal(three(function(np.zeros((0, 1)))[0]), (np.nan, np.nan, np.nan))
        assert function(np.zeros((3, 0))) == []


@pytest.mark.parametrize("n", [2, 3, 7, 50])
def test_equal_values_have_an_interval_of_no_width(n):
    for function in (means, medians):
        np.testing.assert_allclose(three(function(np.full((n, 1), 0.1))[0]), (0.1, 0.1, 0.1), rtol=1e-15)


def test_ties_count_half():
    values = np.array([[0.0], [0.0], [0.0], [1.0]])
    drawn = SimpleNamespace(bootstrap_distribution=resampled_means(values)[0])
    peer = bootstrap((values[:, 0],), np.mean, n_resamples=0, bootstrap_result=drawn, method="BCa").confidence_interval
    np.testing.assert_allclose(three(means(values)[0]), (0.25, peer.low, peer.high), rtol=1e-9)


@pytest.mark.parametrize("gap", [np.nan, np.inf, -np.inf])
def test_undefined_values_are_left_out(gap):
    values = skewed(6, columns=2)
    holed = np.insert(values, 3, [gap, 5.0], axis=0)
    for function in (means, medians):
        assert function(holed)[0] == function(values[:, :1])[0]
        assert np.isfinite(three(function(holed)[1])).all()


def test_the_distribution_is_the_share_at_or_below():
    values = np.array([0.5, 2.0, 0.5, np.nan, 1.0], dtype=np.float32)
    at = np.array([0.4, 0.5, 0.7, 1.0, 2.0, 9.0])
    brute = [np.mean([v <= x for v in (0.5, 2.0, 0.5, 1.0)]) for x in at]
    np.testing.assert_array_equal(ecdf(values, at), brute)
    assert share_under(values, 1.0) == 0.5
    assert np.isnan(ecdf(np.array([np.nan]), at)).all() and np.isnan(share_under(np.zeros(0), 1.0))


def test_bands_are_quartiles_of_the_maps_that_still_fly():
    curves = np.array([[1.0, 4.0, np.nan], [2.0, 8.0, np.nan], [3.0, np.nan, np.nan], [4.0, 6.0, np.nan]])
    expected = [[1.75, 5.0, np.nan], [2.5, 6.0, np.nan], [3.25, 7.0, np.nan]]
    np.testing.assert_array_equal(bands(curves), expected)
