"""The default search on whole decisions, beside particle swarm with a hundred times its evaluations."""

import numpy as np
import pytest

from planning.composition import Composition
from planning.coordination import expected
from planning.optimizers import CrossEntropy, ParticleSwarm


class Both:
    """An optimiser that runs the default and, from the same starts, a swarm with many times its evaluations."""

    def __init__(self, times):
        self.times = times

    def minimise(self, objective, starts, max_speeds, rng):
        found = CrossEntropy().minimise(objective, starts, max_speeds, rng)
        self.evaluations = self.times * found.evaluations
        swarm = ParticleSwarm(self.evaluations).minimise(objective, starts, max_speeds, rng)
        assert swarm.evaluations >= self.evaluations
        self.excess = found.cost / swarm.cost - 1.0
        return found


def excess(random_team, seed, times):
    """By how much the first UAV's plan costs more than the swarm's: three UAVs, four to six targets, 75 trees, MWTP."""
    situation = random_team(seed, trees=75, targets=4 + seed % 3)[0]
    both = Both(times)
    Composition(optimizer=both).decide(situation, expected(situation, 5), [0], np.random.default_rng(seed))
    return both.excess


def test_the_default_is_as_good_as_particle_swarm_with_ten_times_its_evaluations(random_team):
    assert max(excess(random_team, seed, 10) for seed in range(3)) <= 0.01


@pytest.mark.slow
def test_the_default_is_as_good_as_particle_swarm_with_a_hundred_times_its_evaluations(random_team):
    """All but one: a basin too narrow to be found at every try, by the swarm too."""
    found = np.array([excess(random_team, seed, 100) for seed in range(50)])
    print(f"\nworst {found.max():.4f}, mean {found.mean():.4f}, over 1 % worse in {np.sum(found > 0.01)} of 50,")
    print(f"over 1 % better in {np.sum(found < -0.01)}")
    assert np.sum(found > 0.01) <= 1 and found.max() <= 0.1 and found.mean() <= 0.0
