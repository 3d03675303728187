"""A rollout that cannot begin leaves no world behind."""

import pytest
from helpers.clients import open_clients

from sim.environments.rollout import Rollout
from sim.mission.mission import Mission
from sim.scenario.loading import load


def test_a_rollout_closes_its_world_if_its_first_scan_fails(monkeypatch):
    def failing(self):
        raise MemoryError

    monkeypatch.setattr(Mission, "team", property(failing))
    before = open_clients()
    with pytest.raises(MemoryError):
        Rollout(load("forest", ["duration=2", "sensing.mode=ideal"]), 0, 0)
    assert open_clients() == before
