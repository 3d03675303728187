"""The squared error up to a cut-off against the integral over errors and against drawn ones, and its objective."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.nominal import nominal, plain_cost
from scipy.integrate import quad

from planning.loading import load_planner
from planning.objective.nbo import Measure, objective
from planning.prediction.propagation import Nominal
from tracking.filter.kalman import Gaussian
from tracking.metrics.squared_error import cut_off
from tracking.track import Track


def expected(traces, cutoff):
    found = np.array(traces, dtype=float)
    cut_off(found, cutoff)
    return found


@pytest.mark.parametrize("cutoff", [0.5, 10.0, 40.0])
def test_the_expected_squared_error_is_the_integral_over_all_errors(cutoff):
    traces = np.geomspace(1e-3 * cutoff**2, 1e4 * cutoff**2, 15)
    for trace, found in zip(traces, expected(traces, cutoff), strict=True):
        # The length of an error in the plane, of variance `trace` / 2 along each axis, has Rayleigh's density.
        inside = quad(lambda r, t=trace: r**2 * 2 * r / t * math.exp(-(r**2) / t), 0.0, cutoff, limit=200)[0]
        assert found == pytest.approx(inside + cutoff**2 * math.exp(-(cutoff**2) / trace), rel=1e-7)


def test_a_trace_far_below_the_cutoff_keeps_its_bits_and_none_passes_its_square():
    traces = np.array([1e-6, 0.03, 1.0, 2.6, 1e9])
    found = expected(traces, 10.0)
    assert found[:4].tolist() == traces[:4].tolist()
    assert found[4] == pytest.approx(100.0, rel=1e-6) and found[4] <= 100.0
    assert expected(traces, math.inf).tolist() == traces.tolist()


@pytest.mark.parametrize("oblong", [1.0, 4.0, 1e9])
def test_drawn_errors_of_oblong_covariances_are_at_most_a_fifth_less(oblong):
    draws, worst = np.random.default_rng(0).standard_normal((200_000, 2)), []
    for trace in (5.0, 50.0, 100.0, 200.0, 1000.0):
        variances = np.array([oblong, 1.0]) * trace / (oblong + 1.0)
        drawn = np.minimum((draws**2 * variances).sum(axis=1), 100.0).mean()
        worst.append(drawn / expected([trace], 10.0)[0])
    low = {1.0: 0.99, 4.0: 0.9, 1e9: 0.8}[oblong]
    assert low <= min(worst) and max(worst) <= 1.01


@pytest.mark.parametrize("doubtful", [False, True])
def test_the_objective_with_a_cutoff_equals_a_plain_transcription(random_team, doubtful):
    changed = 0
    for seed in range(15):
        situation = random_team(seed, spread=12.0 + seed)[0]
        controls = np.random.default_rng(seed).uniform(-3.5, 3.5, (3, 5, 2))
        view = Nominal(doubtful).predict(situation, 5, np.random.default_rng(0))
        wanted, _ = plain_cost(situation, controls, 0.5, expected=doubtful, cutoff=1.0)
        found = objective(view, controls, [0], 0.5, measure=Measure(gains=False, cutoff=1.0))(controls[None, :1])[0]
        assert found == pytest.approx(wanted, rel=1e-6)
        changed += not math.isclose(wanted, plain_cost(situation, controls, 0.5, expected=doubtful)[0], rel_tol=1e-2)
    assert changed >= 10


def test_a_person_lost_for_longer_costs_no_more(random_team):
    situation, still = random_team(2)[0], np.zeros((3, 3, 2))
    view = nominal(situation, 3)
    found = {}
    for cutoff in (np.inf, 10.0):
        for grown in (1e4, 1e6):  # of three of four people
            scales = np.array([1.0, grown, grown, grown])[:, None, None]
            lost = view._replace(covariances=view.covariances * scales)
            values = objective(lost, still, [0], 0.0, measure=Measure(gains=False, cutoff=cutoff))
            found[cutoff, grown] = values(still[None, :1])[0]
    assert found[np.inf, 1e6] > 90.0 * found[np.inf, 1e4]
    assert found[10.0, 1e4] <= found[10.0, 1e6] <= min(1.01 * found[10.0, 1e4], 4 * 3 * 100.0)


def test_a_lost_person_draws_a_uav_away_only_without_a_cutoff(random_team):
    """One UAV holds a person; another is lost 36 m away, and seeing that one takes leaving the first."""
    situation = random_team(2, uavs=1, targets=2, trees=0)[0]
    here = situation.own.position[:2]
    held = Track(0, Gaussian(np.array([*here, 0.0, 0.0]), np.diag([0.1, 0.1, 4.0, 4.0])))
    lost = Track(1, Gaussian(np.array([here[0] + 36.0, here[1], 0.0, 0.0]), np.diag([200.0, 200.0, 0.5, 0.5])))
    situation = dataclasses.replace(situation, tracks=(held, lost))
    ends = []
    for cutoff in (0, 10):
        planner = load_planner(f"sma-nbo-gospa(search=0, cutoff={cutoff}, evaluations=2000)")
        (plan,) = planner.plan([situation], np.random.default_rng(0))
        ends.append(plan.controls[:, 0].sum())
    assert ends[0] > 15.0 and ends[1] < 0.0
