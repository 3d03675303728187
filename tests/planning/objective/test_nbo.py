"""The compiled objective against a plain transcription of the paper's equations, also of doubtful targets; MWTP."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.nominal import nominal, plain_cost, plain_square_mwtp, squares, team_cost, weighted_trace_penalty

from planning.composed import Composed
from planning.objective.nbo import Measure, make_objective
from planning.prediction.predicted_belief import predict_belief
from planning.prediction.propagation import MonteCarlo, Nominal
from planning.prediction.quadrangle import shortest_move
from tracking.filter.mean_reverting import MeanRevertingVelocity

WALKING = MeanRevertingVelocity(1.0, 0.5, walking_speed=1.6, scans=5)

# End of the horizon in the paper's MWTP figure, in its drawing units, y upwards.
FIGURE_SENSORS = np.array([[227.0, -168.25], [120.0, -154.25]])
FIGURE_TARGETS = np.array([[70.0, -104.5], [249.0, -94.5]])
FIGURE_REACH = np.array([33.0, 33.0])


@pytest.mark.parametrize("beta", [0.0, 0.5])
@pytest.mark.parametrize(("uavs", "targets"), [(3, 4), (1, 3), (4, 2), (2, 6)])
def test_the_compiled_objective_equals_a_plain_transcription(random_team, uavs, targets, beta):
    counts = []
    for seed in range(25):
        situation = random_team(seed, uavs=uavs, targets=targets, spread=12.0 + seed)[0]
        situation = dataclasses.replace(situation, motion=WALKING if seed % 2 else situation.motion)
        controls = np.random.default_rng(seed).uniform(-3.5, 3.5, (uavs, 5, 2))
        expected, seen = plain_cost(situation, controls, beta)
        assert team_cost(nominal(situation, 5), controls, beta) == pytest.approx(expected, rel=1e-9)
        counts += seen
    assert 0 in counts and 1 in counts and (uavs == 1 or 2 in counts)


@pytest.mark.parametrize(
    ("beta", "doubtful", "cutoff"), [(0.0, True, np.inf), (0.5, True, np.inf), (0.5, False, 1.0), (0.5, True, 1.0)]
)
def test_expected_visibility_and_cutoffs_equal_a_plain_transcription(random_team, beta, doubtful, cutoff):
    changed = 0
    for seed in range(15):
        situation = random_team(seed, spread=12.0 + seed)[0]
        situation = dataclasses.replace(situation, motion=WALKING if seed % 2 else situation.motion)
        controls = np.random.default_rng(seed).uniform(-3.5, 3.5, (3, 5, 2))
        view = Nominal(doubtful).predict(situation, 5, np.random.default_rng(0))
        expected, _ = plain_cost(situation, controls, beta, expected=doubtful, cutoff=cutoff)
        found = make_objective(view, controls, [0], beta, measure=Measure(gains=False, cutoff=cutoff))(
            controls[None, :1]
        )[0]
        assert found == pytest.approx(expected, rel=1e-6)  # marks have eight digits
        without = plain_cost(situation, controls, beta, expected=doubtful and cutoff < np.inf)[0]
        changed += not math.isclose(expected, without, rel_tol=1e-3 if cutoff == np.inf else 1e-2)
    assert changed >= 10


def test_candidates_of_each_uav_are_costed_as_joint_plans(random_team):
    situation = random_team(3)[0]
    view = nominal(situation, 4)
    rng = np.random.default_rng(0)
    controls, candidates = rng.uniform(-3, 3, (3, 4, 2)), rng.uniform(-3, 3, (6, 3, 4, 2))
    for uavs in ([0], [1], [2], [0, 2], [2, 1], [0, 1, 2]):
        chosen = candidates[:, : len(uavs)]
        for value, candidate in zip(make_objective(view, controls, uavs, 0.5)(chosen), chosen, strict=True):
            joint = controls.copy()
            joint[uavs] = candidate
            assert value == pytest.approx(plain_cost(situation, joint, 0.5)[0], rel=1e-9)


@pytest.mark.parametrize("traces", [(4.0, 9.0), (9.0, 4.0)])
def test_mwtp_matches_the_sensors_and_targets_of_the_papers_figure(traces):
    penalty = weighted_trace_penalty(FIGURE_TARGETS, np.array(traces), FIGURE_SENSORS, squares(FIGURE_REACH))
    to_first = math.hypot(120 - 70, 154.25 - 104.5)  # sensor 2 to target 1
    to_second = math.hypot(249 - 227, 168.25 - 94.5)  # sensor 1 to target 2
    assert penalty == pytest.approx(to_first * traces[0] + to_second * traces[1], rel=1e-12)
    # p^MDO: the fields of view just cover the targets.
    moves = [shortest_move(squares(FIGURE_REACH), i, *(FIGURE_TARGETS[1 - i] - FIGURE_SENSORS[i])) for i in (0, 1)]
    np.testing.assert_allclose(FIGURE_SENSORS + moves, [[227.0, -94.5 - 33.0], [70.0 + 33.0, -104.5 - 33.0]])


def test_mwtp_agrees_with_the_plain_algorithm():
    rng = np.random.default_rng(5)
    for _ in range(200):
        n, T = rng.integers(1, 5), rng.integers(1, 8)
        sensors, targets = rng.uniform(-40, 40, (n, 2)), rng.uniform(-40, 40, (T, 2))
        traces, reach = rng.uniform(0.1, 9, T), rng.uniform(8, 13, n)
        expected = plain_square_mwtp(targets, traces, sensors, reach)
        found = weighted_trace_penalty(targets, traces, sensors, squares(reach))
        assert found == pytest.approx(expected, rel=1e-12)


class Kept:
    """An optimiser that tells the values of some candidates and keeps the first."""

    def __init__(self, candidates):
        self.candidates = candidates

    def minimise(self, objective, starts, max_speeds, rng, in_reach=None):
        self.values = objective(self.candidates)
        return starts[0]


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
        Composed(beta=beta, optimizer=optimizer).decide(situation, controls, [0, 1, 2], rng)
        expected = plain_cost(situation, controls, beta, weights=[t.existence for t in situation.tracks])[0]
        assert optimizer.values[0] == pytest.approx(expected, rel=1e-9)
        Composed(beta=beta, optimizer=optimizer, existence=False).decide(situation, controls, [0, 1, 2], rng)
        assert optimizer.values[0] == team_cost(nominal(situation, 5), controls, beta) != pytest.approx(expected)


def test_each_sample_of_a_target_counts_alike(random_team):
    situation = doubted(random_team(1)[0], [0.2, 1.0, 0.5, 0.7])
    controls = np.random.default_rng(0).uniform(-3, 3, (3, 5, 2))
    optimizer = Kept(controls[None])
    pieces = Composed(propagation=MonteCarlo(3), optimizer=optimizer)
    pieces.decide(situation, controls, [0, 1, 2], np.random.default_rng(0))
    drawn = MonteCarlo(3).predict(situation, 5, np.random.default_rng(0))
    samples = [np.ascontiguousarray(drawn.points[:, 4 * s : 4 * s + 4]) for s in range(3)]
    alone = [predict_belief(situation, points, drawn.covariances[:4]) for points in samples]  # with its own trees
    each = [team_cost(one._replace(weights=np.array([0.2, 1.0, 0.5, 0.7])), controls, 0.5) for one in alone]
    assert optimizer.values[0] == pytest.approx(np.mean(each), rel=1e-12)
