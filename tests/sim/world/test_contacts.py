"""Contacts of UAVs are noticed, recorded, summarised and shown; near misses are not."""

import dataclasses
import json

import numpy as np
import pytest
from helpers.flights import fly_ideal
from helpers.recordings import record
from helpers.summaries import shown, summary
from helpers.teams import Spy

from sim.facts.metrics.fleet_facts import list_contacts
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.world.contacts import Contact
from sim.world.world import World
from tracking.geometry.visibility import Forest, Tree

APART = 6.0  # m


def approach(dynamics, offset):
    """Scenario of two UAVs of one altitude, the second one ahead of the first, `offset` m aside."""
    return Scenario(dynamics=dynamics, uavs=(Uav(start=(0.0, 0.0)), Uav(start=(APART, offset))))


@pytest.mark.parametrize("dynamics", ["quadrotor", "kinematic"])
@pytest.mark.parametrize(("offset", "expected"), [(0.1, (Contact(0, "uav", 1),)), (0.5, ())])
def test_uavs_on_a_collision_course_touch_once_they_meet(dynamics, offset, expected):
    with World(approach(dynamics, offset), Forest(()), 0) as world:
        for _ in range(240):  # a second at 1 m/s each leaves 4 m between them
            world.step(np.array([[1.0, 0.0], [-1.0, 0.0]]))
        assert world.take_contacts() == ()
        for _ in range(600):
            world.step(np.array([[1.0, 0.0], [-1.0, 0.0]]))
        assert world.take_contacts() == expected and world.take_contacts() == ()


@pytest.mark.parametrize("dynamics", ["quadrotor", "kinematic"])
@pytest.mark.parametrize("kind", ["canopy", "trunk"])
def test_a_uav_flown_into_a_tree_touches_that_tree(dynamics, kind):
    """No scenario lets trees reach up to a UAV, so the world is given a forest that does."""
    setting = Scenario(dynamics=dynamics, uavs=(Uav(start=(0.0, 0.0)),))
    base = 10.0 if kind == "canopy" else 25.0  # the UAV flies at 17.3 m
    trees = (Tree(0.0, 20.0), Tree(4.0, 0.0, 2.0, base, 30.0), Tree(-30.0, 0.0))
    with World(setting, Forest(trees), 1) as world:
        for _ in range(240 * 3):
            world.step(np.array([[2.0, 0.0]]))
        assert world.take_contacts() == (Contact(0, kind, 1),)
        if dynamics == "quadrotor":
            assert world.poses()[0].position[0] < 4.0


def test_contacts_of_missions_are_told_at_the_scans_after_them():
    fleet = f"uavs=[{{start=[0, 0]}}, {{start=[{APART}, 0]}}]"
    _, snapshots = fly_ideal("trees.density=0", fleet, planner=Spy(lambda s: [[1.0 - 2.0 * s.own.id, 0.0]]))
    touching = [s.time for s in snapshots if s.contacts]
    # Bodies 0.34 m wide that close 6 m at 2 m/s touch from 2.83 s, before the scan at 3.0 s, to 3.17 s, before 3.2 s.
    assert touching == [3.0, 3.2] and {c for s in snapshots for c in s.contacts} == {Contact(0, "uav", 1)}


def with_contacts(rows):
    return dataclasses.replace(record(), contacts=np.array(rows, dtype=np.int64).reshape(-1, 4))


def test_a_contact_that_lasts_counts_once_and_stands_in_the_table():
    # UAVs 0 and 1 at scans 3 and 4, and again at 6; UAV 2 and canopy 7 at scan 4.
    found = list_contacts(with_contacts([(3, 0, 0, 1), (4, 0, 0, 1), (4, 2, 1, 7), (6, 0, 0, 1)]))
    assert found == [
        {"time": 3 / 5, "until": 4 / 5, "uav": 0, "kind": "uav", "other": 1},
        {"time": 4 / 5, "until": 4 / 5, "uav": 2, "kind": "canopy", "other": 7},
        {"time": 6 / 5, "until": 6 / 5, "uav": 0, "kind": "uav", "other": 1},
    ]
    texts = []
    for rows in ([], [(3, 0, 0, 1), (4, 2, 1, 7)]):
        result = summary(with_contacts(rows))
        assert json.loads(json.dumps(result, allow_nan=False)) == result
        texts.append(shown(result))
    assert "contacts" not in texts[0]
    for piece in ("contacts", "at 0.6 s", "UAV 0 touched UAV 1", "at 0.8 s", "UAV 2 touched the canopy of tree 7"):
        assert piece in texts[1]
