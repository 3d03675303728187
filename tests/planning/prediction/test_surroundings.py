"""Decisions from a UAV's surroundings against decisions from all that it knows."""

from dataclasses import replace

import numpy as np
import pytest

from planning import composed
from planning.composed import Composed
from planning.objective.nbo import Measure, make_objective
from planning.planner_loading import load_planner
from planning.prediction.field_of_view import viewing_range
from planning.prediction.intent import expect_plans
from planning.prediction.propagation import Nominal
from planning.prediction.surroundings import find_near_uavs, find_surroundings


def far_and_wide(random_team, seed, spread=400.0):
    """A situation with UAVs and targets within `spread` m of the middle, crowded about the UAV itself."""
    near = random_team(seed, uavs=4, targets=6, trees=60, spread=25.0)[0]
    far = random_team(seed + 100, uavs=12, targets=30, trees=60, spread=spread)[0]
    vehicles = tuple(replace(v, id=4 + v.id) for v in far.vehicles)
    return replace(near, neighbours=near.neighbours + vehicles, tracks=near.tracks + far.tracks)


@pytest.mark.parametrize("planner", ["sma-nbo-gospa(", "sma-nbo-gospa(cost_to_go=0.03, ", "sma-nbo(", "greedy-mi("])
def test_decisions_equal_those_from_the_whole_situation(random_team, monkeypatch, planner):
    decision, equal, left_out = load_planner(f"{planner}evaluations=640)"), 0, 0
    for seed in range(12):
        situation = far_and_wide(random_team, seed)
        plans = expect_plans(situation, 5)
        found = []
        for part in (find_surroundings, whole):
            monkeypatch.setattr(composed, "find_surroundings", part)
            found.append(decision.decide(situation, plans, [0], np.random.default_rng(seed)))
        near, rows = find_surroundings(situation, [0], 5)
        left_out += len(situation.tracks) - len(near.tracks) + len(plans) - len(rows)
        equal += np.array_equal(*found)
        if planner == "sma-nbo-gospa(":
            belief = Nominal(True).predict(situation, 5, np.random.default_rng(0))
            cost = make_objective(belief, plans, [0], 0.0, measure=Measure(gains=False, cutoff=10.0))(np.stack(found))
            assert cost[0] == pytest.approx(cost[1], rel=1e-5)  # rounding may lead the search to another plan
    assert equal >= 9 and left_out > 100


def whole(situation, uavs, horizon):
    return situation, np.arange(len(situation.vehicles))


def test_nothing_is_left_out_of_the_packaged_worlds(random_team):
    """Their areas are at most 200 x 130 m, so that their recordings keep their bytes."""
    situation = random_team(0, uavs=10, targets=30, spread=85.0)[3]
    assert find_surroundings(situation, [3], 5)[0] is situation


def test_the_surroundings_reach_farther_for_faster_uavs_and_longer_plans(random_team):
    situation = far_and_wide(random_team, 0, 800.0)
    kept = [len(find_surroundings(situation, [0], horizon)[0].tracks) for horizon in (5, 20, 100)]
    assert kept[0] < kept[1] < kept[2] == len(situation.tracks)


def test_distances_of_uavs_are_those_on_the_ground(random_team):
    situation = random_team(0, uavs=3)[0]
    for past, near in ((-1.0, True), (1.0, False)):
        far, other = (replace(v, position=situation.own.position + np.array([0, 0, 60])) for v in situation.neighbours)
        found, radius = find_near_uavs(replace(situation, neighbours=(far, other)), [0], 5)
        far.position[:2] += [0.6 * (radius + past), 0.8 * (radius + past)]
        found, _ = find_near_uavs(replace(situation, neighbours=(far, other)), [0], 5)
        assert found.tolist() == [True, near, True]


def test_uavs_that_can_come_to_see_one_place_are_near_each_other(random_team):
    situation = random_team(0, uavs=3)[0]
    for speed, horizon in ((60.0, 5), (10.0, 60)):
        vehicles = [replace(v, max_speed=speed) for v in situation.vehicles]
        fast = replace(situation, own=vehicles[0], neighbours=tuple(vehicles[1:]))
        reaches = sorted(viewing_range(v) + horizon * speed * situation.step for v in vehicles)
        assert find_near_uavs(fast, [0], horizon)[1] >= reaches[-1] + reaches[-2] > 250.0


def test_a_joint_plan_has_the_surroundings_of_all_its_uavs(random_team):
    situation = far_and_wide(random_team, 0)
    assert find_surroundings(situation, range(len(situation.vehicles)), 5)[0].neighbours == situation.neighbours


def test_the_mwtp_counts_all_that_is_known(random_team, monkeypatch):
    monkeypatch.setattr(composed, "find_surroundings", lambda *given: pytest.fail("something is left out"))
    situation = far_and_wide(random_team, 0)
    decided = Composed(evaluations=64).decide(situation, expect_plans(situation, 5), [0], np.random.default_rng(0))
    assert np.isfinite(decided).all()
