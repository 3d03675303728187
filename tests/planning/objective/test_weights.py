"""Targets that may not exist: each counts by its probability of existence."""

import dataclasses

import numpy as np
import pytest
from helpers.nominal import nominal, plain_cost

from planning.composition import Composition
from planning.loading import load_planner
from planning.objective.nbo import team_cost
from planning.prediction.propagation import MonteCarlo


class Kept:
    """An optimiser that tells the values of some candidates and keeps the first."""

    def __init__(self, candidates):
        self.candidates = candidates

    def minimise(self, objective, starts, max_speeds, rng, hints=None):
        self.values = objective(self.candidates)
        return type("Found", (), {"plans": starts[0]})()


def doubted(situation, existence):
    tracks = [dataclasses.replace(t, existence=float(r)) for t, r in zip(situation.tracks, existence, strict=True)]
    return dataclasses.replace(situation, tracks=tuple(tracks))


@pytest.mark.parametrize("beta", [0.0, 0.5])
def test_the_weighted_objective_equals_a_plain_transcription(random_team, beta):
    for seed in range(15):
        rng = np.random.default_rng(seed)
        situation = doubted(random_team(seed, spread=12.0 + seed)[0], rng.uniform(0.05, 1.0, 4))
        controls = rng.uniform(-3.5, 3.5, (3, 5, 2))
        optimizer = Kept(controls[None])
        Composition(beta=beta, optimizer=optimizer).decide(situation, controls, [0, 1, 2], rng)
        expected = plain_cost(situation, controls, beta, weights=[t.existence for t in situation.tracks])[0]
        assert optimizer.values[0] == pytest.approx(expected, rel=1e-9)
        Composition(beta=beta, optimizer=optimizer, existence=False).decide(situation, controls, [0, 1, 2], rng)
        assert optimizer.values[0] == team_cost(nominal(situation, 5), controls, beta) != pytest.approx(expected)


def test_each_sample_of_a_target_counts_alike(random_team):
    situation = doubted(random_team(1)[0], [0.2, 1.0, 0.5, 0.7])
    controls = np.random.default_rng(0).uniform(-3, 3, (3, 5, 2))
    optimizer = Kept(controls[None])
    Composition(propagation=MonteCarlo(3), optimizer=optimizer).decide(
        situation, controls, [0, 1, 2], np.random.default_rng(0)
    )
    drawn = MonteCarlo(3).predict(situation, 5, np.random.default_rng(0))
    each = [
        team_cost(
            drawn._replace(
                points=np.ascontiguousarray(drawn.points[:, 4 * s : 4 * s + 4]),
                covariances=drawn.covariances[:4],
                offsets=np.concatenate([[0], np.cumsum(_counts(drawn)[:, s].ravel())]),
                blockers=drawn.blockers[np.repeat(_sample(drawn), _counts(drawn).ravel()) == s],
                weights=np.array([0.2, 1.0, 0.5, 0.7]),
            ),
            controls,
            0.5,
        )
        for s in range(3)
    ]
    assert optimizer.values[0] == pytest.approx(np.mean(each), rel=1e-12)


def _counts(drawn):
    return np.diff(drawn.offsets).reshape(5, 3, 4)


def _sample(drawn):
    return np.broadcast_to(np.arange(3)[None, :, None], (5, 3, 4)).ravel()


def test_certain_targets_leave_plans_as_they_are(random_team):
    team = random_team(3)
    by_existence = load_planner("sma-nbo-mwtp").plan(team, np.random.default_rng(0))
    as_one = load_planner("sma-nbo-mwtp(existence=False)").plan(team, np.random.default_rng(0))
    for a, b in zip(by_existence, as_one, strict=True):
        np.testing.assert_array_equal(a.controls, b.controls)
    with pytest.raises(ValueError, match="existence of 'sma-nbo' must be True or False, is 1"):
        load_planner("sma-nbo(existence=1)")
