"""A flight that ends before its first scan leaves no world behind."""

from contextlib import nullcontext

import pytest
from helpers.clients import open_clients

from sim.mission.trial import Trial
from sim.running.mission_flight import fly_mission
from sim.scenario.loading import load

TRIAL = Trial(load("forest", ["duration=1"]), "hover", 0)


def full(*given):
    raise OSError("no room")


@pytest.mark.parametrize(("watching", "prepare"), [(full, list), (lambda mission: nullcontext(), full)])
def test_what_fails_between_set_up_and_the_first_scan_closes_the_world(watching, prepare):
    before = open_clients()
    with pytest.raises(OSError, match="no room"):
        fly_mission(TRIAL, watching, prepare)
    assert open_clients() == before
