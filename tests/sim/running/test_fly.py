"""A mission is one loop over its snapshots, which whoever watches may leave; no world is left behind."""

import pytest
from helpers.clients import open_clients

from sim.mission.trial import Trial
from sim.running.fly import fly, fly_mission
from sim.scenario.loading import load_scenario

TRIAL = Trial(load_scenario("forest", ["duration=1"]), "hover", 0)


def test_who_leaves_the_loop_keeps_what_was_flown():
    before, times, flying = open_clients(), [], fly(TRIAL)
    for snapshot in flying:
        times.append(snapshot.time)
        if len(times) == 3:
            break
    outcome, whole = flying.land(), fly_mission(TRIAL).recording
    assert outcome.recording.interrupted and outcome.recording.times.tolist() == times == whole.times[:3].tolist()
    assert not whole.interrupted and len(whole.times) == 6
    assert outcome.recording.poses.tobytes() == whole.poses[:3].tobytes()
    assert 0.0 < outcome.seconds["start_up"] < outcome.wall_s and open_clients() == before


@pytest.mark.parametrize("scans", [0, 2])
def test_an_error_before_or_in_the_loop_closes_the_world(scans):
    before = open_clients()
    with pytest.raises(OSError, match="no room"), fly(TRIAL) as flying:
        for k, _ in enumerate(flying if scans else []):
            if k == scans:
                break
        raise OSError("no room")
    assert open_clients() == before
