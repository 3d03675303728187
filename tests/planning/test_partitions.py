"""Assignment in rounds against every joint plan of a few controls, and the bounds of its papers."""

import dataclasses
import itertools

import numpy as np
import pytest
from helpers.nominal import nominal

from planning.composition import Composition
from planning.coordination.partitions import Partitions
from planning.loading import PlannerError, load_planner
from planning.objective.nbo import Measure, objective
from planning.optimizers.grid_search import GridSearch

HORIZON = 2


class Exhaustive(GridSearch):
    """Tries all sequences of a few controls, and no start besides."""

    def minimise(self, objective, starts, *arguments):
        return super().minimise(objective, np.zeros_like(starts[:1]), *arguments)


GRID = Exhaustive(4)


def planned(team, seed, rounds):
    pieces = {"horizon": HORIZON, "beta": 0.0, "optimizer": GRID, "uncertainty": "information"}
    plans = Composition(coordination=Partitions(rounds), **pieces).plan(team, np.random.default_rng(seed))
    return np.array([plan.controls for plan in plans])


class Information:
    """Information of plans of some UAVs of a team, as if there were no others."""

    def __init__(self, team):
        self.situations = {}
        for size in range(1, len(team) + 1):
            for uavs in itertools.combinations(range(len(team)), size):
                others = tuple(team[i].own for i in uavs[1:])
                self.situations[uavs] = nominal(dataclasses.replace(team[uavs[0]], neighbours=others), HORIZON)

    def __call__(self, uavs, plans):
        """Information (N,) of plans (N, k, H, 2) m/s of UAVs `uavs`, by ascending id."""
        if not uavs:
            return np.zeros(len(plans))
        return -objective(
            self.situations[uavs], plans[0], range(len(uavs)), 0.0, measure=Measure(gains=True, cutoff=np.inf)
        )(plans)

    def gain(self, uav, others, plans):
        """Gain of a UAV's plan over those of others, of a joint plan (n, H, 2) m/s."""
        with_it = tuple(sorted((uav, *others)))
        return float((self(with_it, plans[None, list(with_it)]) - self(others, plans[None, list(others)]))[0])


def sequences():
    return np.array(list(itertools.product(GRID.controls(5.0), repeat=HORIZON)))


def joint(count):
    each = sequences()
    return np.stack([each[list(chosen)] for chosen in itertools.product(range(len(each)), repeat=count)])


def test_one_uav_a_round_has_at_least_half_of_the_optimum_and_often_all(random_team):
    shares, tried = [], joint(3)
    for seed in range(20):
        team = random_team(seed, spread=12.0)
        value = Information(team)
        best = value((0, 1, 2), tried).max()
        shares.append(value((0, 1, 2), planned(team, 0, 0)[None])[0] / best)
    assert min(shares) >= 0.5 and np.mean(shares) > 0.95


def test_each_uav_gains_the_most_over_those_before_it(random_team):
    for seed in range(5):
        team = random_team(seed, spread=12.0)
        value, plans = Information(team), planned(team, 0, 0)
        for uav in range(3):
            before = tuple(range(uav))
            alternatives = np.repeat(plans[None, : uav + 1], 25, axis=0)
            alternatives[:, uav] = sequences()
            gains = value((*before, uav), alternatives) - value(before, alternatives[:, :uav])
            assert value.gain(uav, before, plans) >= gains.max() - 1e-9


@pytest.mark.parametrize("rounds", [1, 2, 3])
def test_rounds_lose_at_most_half_of_what_plans_of_one_round_share(random_team, rounds):
    """The bound by the plans that were made, and that of the papers by the redundancy of any two plans."""
    tried, pairs, losing = joint(3), joint(2), 0
    for seed in range(12):
        team = random_team(seed, spread=8.0)
        value, plans = Information(team), planned(team, seed, rounds)
        drawn = np.random.default_rng(seed).integers(rounds, size=3)
        order = np.argsort(drawn, kind="stable").tolist()
        shared = redundant = 0.0
        for place, uav in enumerate(order):
            known = tuple(sorted(j for j in order[:place] if drawn[j] < drawn[uav]))
            before = tuple(sorted(order[:place]))
            shared += value.gain(uav, known, plans) - value.gain(uav, before, plans)
            for j in set(before) - set(known):
                two = tuple(sorted((uav, j)))
                alone = value(two[:1], pairs[:, :1]) + value(two[1:], pairs[:, 1:])
                redundant += float((alone - value(two, pairs)).max())
        best, found = value((0, 1, 2), tried).max(), value((0, 1, 2), plans[None])[0]
        assert found >= (best - shared) / 2 - 1e-9
        assert found >= (best - redundant) / 2 - 1e-9 and shared <= redundant + 1e-9
        losing += shared > 0.1
    assert losing >= {1: 8, 2: 3, 3: 1}[rounds]


def test_more_rounds_than_one_leave_less_in_common_on_average(random_team):
    """With n rounds two UAVs share one with probability 1/n, so that the expected redundancy falls as 1/n."""
    found = {}
    for rounds in (1, 2, 4):
        values = []
        for seed in range(30):
            team = random_team(seed, spread=8.0)
            values.append(Information(team)((0, 1, 2), planned(team, seed, rounds)[None])[0])
        found[rounds] = np.mean(values)
    assert found[1] < found[2] < found[4]


def test_plans_that_are_not_received_do_not_count(random_team):
    team = random_team(4, spread=12.0)
    deaf = [dataclasses.replace(s, reception=((),)) for s in team]
    np.testing.assert_array_equal(planned(deaf, 0, 0), planned(team, 0, 1))


def test_options_that_information_has_no_use_for_are_refused():
    with pytest.raises(PlannerError, match=r"cutoff=10 has no effect with uncertainty 'information'; set cutoff=0"):
        load_planner("rsp(cutoff=10)")
    with pytest.raises(PlannerError, match=r"beta=0\.5 has no effect with uncertainty 'information'; set beta=0"):
        load_planner("rsp(beta=0.5)")
    with pytest.raises(PlannerError, match="rounds=2 has no effect with coordination 'parallel'"):
        load_planner("rsp(coordination=parallel)")
