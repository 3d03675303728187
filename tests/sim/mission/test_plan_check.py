"""A planner that fails does not end the mission."""

import numpy as np
import pytest

from planning.planner import Plan
from sim.mission.plan_check import checked_plans

LAST = {i: Plan(np.array([[1.0, 0.0], [0.0, 2.0]])) for i in range(3)}


class Fixed:
    def __init__(self, plans):
        self.plans = plans

    def plan(self, team, rng):
        if isinstance(self.plans, BaseException):
            raise self.plans
        return self.plans


def good():
    return Plan(np.array([[3.0, 4.0], [0.0, 1.0]]))


@pytest.mark.parametrize("wrong", [RuntimeError("boom"), SystemExit(3), None, [], [good()]])
def test_a_team_without_plans_flies_its_last_intents(random_team, wrong):
    plans, faults = checked_plans(Fixed(wrong), random_team(0), LAST, np.random.default_rng(0))
    assert [f.uav for f in faults] == [None]
    for plan in plans:
        np.testing.assert_array_equal(plan.controls, [[0.0, 2.0]])


@pytest.mark.parametrize(
    "wrong",
    [Plan(np.array([[np.nan, 0.0]])), Plan(np.zeros(2)), Plan(np.zeros((0, 2))), "north", None, Plan("no")],
)
def test_a_uav_without_a_valid_plan_flies_its_last_intent_then_hovers(random_team, wrong):
    planner = Fixed([good(), wrong, good()])
    plans, faults = checked_plans(planner, random_team(0), LAST, np.random.default_rng(0))
    assert [f.uav for f in faults] == [1]
    np.testing.assert_array_equal(plans[0].controls, good().controls)
    np.testing.assert_array_equal(plans[1].controls, [[0.0, 2.0]])
    plans, _ = checked_plans(planner, random_team(0), dict(enumerate(plans)), np.random.default_rng(0))
    np.testing.assert_array_equal(plans[1].controls, [[0.0, 0.0]])


def test_too_fast_a_command_is_clipped_and_reported(random_team):
    planner = Fixed([Plan(np.array([[6.0, 8.0]])), good(), good()])
    plans, faults = checked_plans(planner, random_team(0), {}, np.random.default_rng(0))
    np.testing.assert_allclose(plans[0].controls, [[3.0, 4.0]])
    assert len(faults) == 1 and "exceeds" in faults[0].message


def test_valid_plans_pass_unchanged(random_team):
    plans, faults = checked_plans(Fixed([good()] * 3), random_team(0), {}, np.random.default_rng(0))
    assert faults == []
    for plan in plans:
        np.testing.assert_array_equal(plan.controls, good().controls)
