"""The default search on whole decisions, beside particle swarm with a hundred times its evaluations."""

from dataclasses import replace

import numpy as np
import pytest

from planning.coordination.decision import expected_plans
from planning.loading import load_planner
from planning.optimizers.particle_swarm import ParticleSwarm

PLANNERS = ("sma-nbo-mwtp", "pma-nbo")  # expected and nominal visibility


class Both:
    """An optimiser that runs the planner's own and, from the same starts, a swarm with many times its evaluations."""

    def __init__(self, own, times):
        self.own, self.times = own, times

    def minimise(self, objective, starts, max_speeds, rng, hints=None):
        found = self.own.minimise(objective, starts, max_speeds, rng, hints)
        self.evaluations = self.times * found.evaluations
        swarm = ParticleSwarm(self.evaluations).minimise(objective, starts, max_speeds, rng)
        assert swarm.evaluations >= self.evaluations
        self.excess = found.cost / swarm.cost - 1.0
        return found


def excess(random_team, planner, seed, times):
    """By how much the first UAV's plan costs more than the swarm's: three UAVs, four to six targets, 75 trees, MWTP."""
    situation, composition = random_team(seed, trees=75, targets=4 + seed % 3)[0], load_planner(planner).composition
    both = Both(composition.optimizer, times)
    replace(composition, optimizer=both).decide(
        situation, expected_plans(situation, 5), [0], np.random.default_rng(seed)
    )
    return both.excess


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_default_is_as_good_as_particle_swarm_with_ten_times_its_evaluations(random_team, planner):
    assert max(excess(random_team, planner, seed, 10) for seed in range(3)) <= 0.01


@pytest.mark.slow
@pytest.mark.parametrize("planner", PLANNERS)
def test_the_default_is_as_good_as_particle_swarm_with_a_hundred_times_its_evaluations(random_team, planner):
    found = np.array([excess(random_team, planner, seed, 100) for seed in range(50)])
    print(f"\nworst {found.max():.4f}, mean {found.mean():.4f}, over 1 % worse in {np.sum(found > 0.01)} of 50,")
    print(f"over 1 % better in {np.sum(found < -0.01)}")
    assert found.max() <= 0.01 and found.mean() <= 0.0
