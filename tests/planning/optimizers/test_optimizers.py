"""Optimisers on functions with a known minimum, against exhaustive search, and on whole decisions beside a swarm."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.nominal import nominal

from planning.objective.nbo import make_objective
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.grid_search import GridSearch
from planning.optimizers.mutations import _CYCLE, _SHAKE, draw_chances, mutate_plans
from planning.optimizers.optimizer import make_pursuits
from planning.optimizers.particle_swarm import ParticleSwarm
from planning.planner import limit_speed
from planning.planner_loading import load_planner
from planning.prediction.intent import expect_plans
from planning.prediction.propagation import nominal_positions
from planning.prediction.targets_in_reach import NO_TARGETS

SEARCHES = {
    "cross-entropy": CrossEntropy(8192, elites=8, rounds=20, spread=0.5, shrink=0.75),
    "particle-swarm": ParticleSwarm(6000),
}
LIMIT = np.array([5.0])
PLANNERS = ("sma-nbo-mwtp", "pma-nbo")  # expected and nominal visibility


@pytest.fixture
def clock(monkeypatch):
    """The time [s] of the optimisers, which a test moves on, however slow the machine is."""
    time = [0.0]
    for name in ("cross_entropy", "grid_search", "particle_swarm"):
        monkeypatch.setattr(f"planning.optimizers.{name}.perf_counter", lambda: time[0])
    return time


def counting(objective):
    """The objective, and a list of the numbers of plans that it is asked for."""
    asked = []

    def counted(c, *ease):
        asked.append(len(c))
        return objective(c, *ease)

    return counted, asked


def run(optimizer, objective, starts, seed=0, limits=LIMIT):
    return optimizer.minimise(objective, starts, limits, np.random.default_rng(seed))


@pytest.mark.parametrize("name", SEARCHES)
@pytest.mark.parametrize("uavs", [1, 2])
def test_the_minimum_of_a_quadratic_is_found(name, uavs):
    goal = np.array([[[1.0, -2.0], [3.0, 0.5], [-1.0, 2.0]], [[0.0, 0.5], [-3.0, 1.0], [1.0, 1.0]]])[:uavs]
    found = run(SEARCHES[name], lambda c: np.sum((c - goal) ** 2, axis=(1, 2, 3)), np.zeros((1, uavs, 3, 2)))
    np.testing.assert_allclose(found, goal, atol=0.1)


@pytest.mark.parametrize("optimizer", [CrossEntropy(16, rounds=2), ParticleSwarm(40), GridSearch(2)])
def test_no_optimiser_is_worse_than_its_best_start_or_too_fast(optimizer):
    rng = np.random.default_rng(2)
    limits = np.array([5.0, 2.0])
    for seed in range(10):
        starts = limit_speed(rng.normal(0, 3, (5, 2, 2, 2)), limits)
        weights = rng.normal(size=(2, 2, 2))

        def objective(c, weights=weights):
            return np.sum(np.sin(7 * c * weights) + c * weights, axis=(1, 2, 3))

        found = run(optimizer, objective, starts, seed, limits)
        assert objective(found[None])[0] <= objective(starts).min()
        assert np.all(np.linalg.norm(found, axis=2).max(axis=1) <= limits * (1 + 1e-12))


@pytest.mark.parametrize(
    "optimizer", [CrossEntropy(160), ParticleSwarm(120), GridSearch(8), GridSearch(8, evaluations=30)]
)
def test_an_optimiser_uses_no_more_evaluations_than_it_may(optimizer):
    objective, asked = counting(lambda c: np.sum(c**2, axis=(1, 2, 3)))
    run(optimizer, objective, np.ones((3, 1, 2, 2)))
    assert sum(asked) - 3 <= (optimizer.evaluations or 9**2) + (40 if isinstance(optimizer, ParticleSwarm) else 0)


@pytest.mark.parametrize("optimizer", [CrossEntropy(64, seconds=0.2), ParticleSwarm(10**9, seconds=0.2)])
def test_a_budget_in_seconds_is_used_and_kept(optimizer, clock):
    """Each call takes 2 ms."""
    asked = []

    def objective(c):
        clock[0] += 0.002
        asked.append(len(c))
        return np.sum(c**2, axis=(1, 2, 3))

    run(optimizer, objective, np.ones((1, 1, 2, 2)))
    assert 0.2 <= clock[0] < 0.21 and sum(asked) > 130  # more than two searches by 64 plans


def test_a_repeated_search_returns_the_best_plan_of_all_its_searches(clock):
    values = []

    def objective(c):
        clock[0] += 0.002
        values.append(np.sin(1e4 * c).sum(axis=(1, 2, 3)))
        return values[-1]

    found = run(CrossEntropy(40, elites=4, last_elites=4, rounds=2, seconds=0.5), objective, np.ones((1, 1, 2, 2)))
    assert len(values) > 6 and np.sin(1e4 * found).sum() == np.concatenate(values).min()


def test_a_start_is_not_lost_where_wider_views_lead_away_from_it():
    start = np.ones((1, 1, 2, 2))

    def objective(c, ease=None):
        away = np.abs(c - start).sum(axis=(1, 2, 3))
        return away if ease is None else -away

    found = CrossEntropy(2000).minimise(objective, start, LIMIT, np.random.default_rng(0), NO_TARGETS)
    np.testing.assert_array_equal(found, start[0])


@pytest.mark.parametrize(
    "optimizer",
    [CrossEntropy(10**5, rounds=100, seconds=0.2), ParticleSwarm(10**5, seconds=0.2), GridSearch(300, seconds=0.2)],
)
def test_a_budget_in_seconds_ends_a_longer_search_with_its_best_plan(optimizer, clock):
    """Each call takes 0.05 s; all plans would take ten calls or more."""
    asked = []

    def objective(c):
        clock[0] += 0.05
        asked.append(c)
        return np.sum((c - 1.0) ** 2, axis=(1, 2, 3))

    found = run(optimizer, objective, np.full((1, 1, 2, 2), 3.0))
    assert len(asked) <= 6
    tried = np.concatenate(asked)
    assert np.sum((tried - 1.0) ** 2, axis=(1, 2, 3)).min() == np.sum((found - 1.0) ** 2)


def test_the_grid_holds_every_sequence_of_controls_within_speed_limits():
    grid = GridSearch(4)
    tried = []

    def objective(c):
        tried.append(c)
        return np.zeros(len(c))

    run(grid, objective, np.zeros((1, 2, 2, 2)), limits=np.array([5.0, 5.0]))
    plans = {tuple(np.round(p, 9).ravel().tolist()) for p in np.concatenate(tried)}
    assert len(plans) == 5 ** (2 * 2)
    with pytest.raises(ValueError, match="optimizer grid: 625 plans of 2 UAVs over 2 steps, at most 600"):
        run(GridSearch(4, most=600), objective, np.zeros((1, 2, 2, 2)), limits=np.array([5.0, 5.0]))
    plans = limit_speed(np.array([[[6.0, 8.0], [0.3, 0.4]]]), 5.0)
    assert plans[0, 0] == pytest.approx([3.0, 4.0]) and plans[0, 1] == pytest.approx([0.3, 0.4])


class AtThreeSpeeds(GridSearch):
    def controls(self, max_speed):
        return np.concatenate([super(AtThreeSpeeds, self).controls(part * max_speed) for part in (1 / 3, 2 / 3, 1.0)])


@pytest.mark.parametrize("optimizer", [CrossEntropy(), ParticleSwarm(12_288, particles_per_step=100)])
def test_with_effort_the_optimum_of_exhaustive_search_is_found(random_team, optimizer):
    """Fifty small cases: one of two UAVs, two steps; exhaustive search over 24 directions at three speeds."""
    excess = []
    for seed in range(50):
        situation = random_team(seed, uavs=2, targets=3, spread=15.0)[0]
        view, plans = nominal(situation, 2), expect_plans(situation, 2)

        values = make_objective(view, plans, [0], 0.5)
        chases = make_pursuits(nominal_positions(situation, 2), situation.own, 1.0)[:, None]
        best = run(AtThreeSpeeds(24), values, plans[None, :1])
        found = run(optimizer, values, np.concatenate([plans[None, :1], chases]), seed)
        excess.append(values(found[None])[0] / values(best[None])[0] - 1.0)
    assert max(excess) <= 0.01


class Both:
    """An optimiser that runs the planner's own and, from the same starts, a swarm with many times its evaluations."""

    def __init__(self, own, times):
        self.own, self.times = own, times

    def minimise(self, objective, starts, max_speeds, rng, in_reach=None):
        own, asked = counting(objective)
        found = self.own.minimise(own, starts, max_speeds, rng, in_reach)
        evaluations = self.times * sum(asked)
        its, used = counting(objective)
        swarm = ParticleSwarm(evaluations).minimise(its, starts, max_speeds, rng)
        assert sum(used) >= evaluations
        self.excess = objective(found[None])[0] / objective(swarm[None])[0] - 1.0
        return found


def excess(random_team, planner, seed, times, search=0):
    """By how much the first UAV's plan costs more than the swarm's: three UAVs, four to six targets, 75 trees, MWTP."""
    situation, composed = random_team(seed, trees=75, targets=4 + seed % 3)[0], load_planner(planner)
    both = Both(composed.minimiser, times)
    replace(composed, optimizer=both).decide(
        situation, expect_plans(situation, 5), [0], np.random.default_rng(seed + 50 * search)
    )
    return both.excess


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_default_is_as_good_as_particle_swarm_with_ten_times_its_evaluations(random_team, planner):
    assert max(excess(random_team, planner, seed, 10) for seed in range(3)) <= 0.01


@pytest.mark.slow
@pytest.mark.parametrize("planner", PLANNERS)
def test_the_default_is_as_good_as_particle_swarm_with_a_hundred_times_its_evaluations(random_team, planner):
    """Fifty decisions, each searched four times; now and then one of the two alone finds the better basin."""
    found = np.array([excess(random_team, planner, seed, 100, search) for seed in range(50) for search in range(4)])
    print(f"\nworst {found.max():.4f}, mean {found.mean():.4f}, of {len(found)} over 1 % worse in")
    print(f"{np.sum(found > 0.01)}, over 1 % better in {np.sum(found < -0.01)}")
    assert np.mean(found > 0.01) <= 0.02 and found.mean() <= 0.0


def test_shakes_add_an_offset_and_noise_of_one_variance_to_all_steps_of_all_uavs():
    parents, speeds = np.zeros((1, 2, 5, 2)), np.array([5.0, 2.0])
    chances = draw_chances(np.random.default_rng(0), 16_000, parents)
    children = mutate_plans(parents, chances, 1e-3, speeds, NO_TARGETS)  # too small for limits to matter
    shaken = np.flatnonzero(np.resize(_CYCLE, len(children)) == _SHAKE)
    sizes = np.multiply.outer(1e-3 * np.exp(chances.normals[shaken, 2]), speeds)
    noise = (children[shaken] / sizes[..., None, None]).reshape(len(shaken), -1)
    steps = 0.5 * (np.eye(5) + np.ones((5, 5)))  # half of a step's variance is that of all steps together
    assert len(noise) >= 2000
    np.testing.assert_allclose(np.cov(noise.T), np.kron(np.eye(2), np.kron(steps, np.eye(2))), atol=0.12)
