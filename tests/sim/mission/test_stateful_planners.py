"""A stateful planner is reset once before the first decision, with a seed of the mission's own."""

import copy
import pickle

import numpy as np
import pytest

from planning.planner import Plan
from sim.mission.mission import Mission
from sim.scenario.loading import load_scenario
from tracking.errors import InputError

SETTING = load_scenario("forest", ["sensing.mode=ideal", "dynamics=kinematic", "duration=3", "trees.density=5"])


class Wanderer:
    """Flies on along a path that its seed gives, which it remembers alone."""

    stateful = True

    def __init__(self):
        self.seeds = []

    def reset(self, seed):
        self.seeds.append(seed)
        self.chance = np.random.default_rng(seed)

    def plan(self, team, rng):
        return [Plan(self.chance.uniform(-1.0, 1.0, (1, 2))) for _ in team]


def commands(mission):
    return np.array([snapshot.commands for snapshot in mission.fly()])


def test_it_is_reset_once():
    planner = Wanderer()
    list(Mission(SETTING, planner, seed=3).fly())
    assert len(planner.seeds) == 1 and 0 <= planner.seeds[0] < 2**63


def test_asked_from_outside_it_flies_as_when_the_mission_asks():
    by_itself, mission, found = commands(Mission(SETTING, Wanderer(), seed=3)), Mission(SETTING, Wanderer(), seed=3), []
    while not mission.over:
        team = mission.team
        found.append(mission.step(mission.planner.plan(team, mission.rng) if team else None).commands)
    np.testing.assert_array_equal(found, by_itself)
    assert len(mission.planner.seeds) == 1


def test_seed_and_repeat_give_the_memory_and_one_planner_flies_again():
    planner, flown = Wanderer(), {}
    for key in ((3, 0), (4, 0), (3, 1), (3, 0)):
        found = commands(Mission(SETTING, planner, *key))
        np.testing.assert_array_equal(flown.setdefault(key, found), found)
    assert planner.seeds[0] == planner.seeds[3] and len(set(planner.seeds)) == 3
    assert np.any(flown[3, 0] != flown[4, 0]) and np.any(flown[3, 0] != flown[3, 1])


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda mission: pickle.loads(pickle.dumps(mission))])
@pytest.mark.parametrize("scans", [0, 8])
def test_a_copy_of_a_mission_has_a_memory_of_its_own(copied, scans):
    mission = Mission(SETTING, Wanderer(), seed=3)
    for _ in range(scans):
        mission.step()
    other = copied(mission)
    np.testing.assert_array_equal(commands(mission), commands(other))
    assert mission.planner.seeds == other.planner.seeds and len(other.planner.seeds) == 1


def test_a_reset_that_fails_is_one_line():
    class Raising(Wanderer):
        def reset(self, seed):
            raise ValueError("no weights")

    with pytest.raises(InputError, match=r"cannot be reset: .*no weights"):
        Mission(SETTING, Raising())
