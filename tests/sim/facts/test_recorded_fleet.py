"""UAVs as planners knew them, as a recording gives them back."""

import numpy as np
from helpers.flights import IDEAL, fly, recording_of
from helpers.teams import Spy

from sim.facts.planned_path import make_vehicle
from sim.mission.mission import Mission
from sim.scenario.loading import load_scenario


def vehicle_at(recording, k, uav):
    here, before = recording.poses[[k, max(k - 1, 0)], uav, :2]
    return make_vehicle(recording.setting, uav, recording.poses_at(k)[uav], here, before)


def wandering(situation):
    """A new direction at each decision."""
    angle = 2.0 * situation.time + situation.own.id
    return [[4.0 * np.cos(angle), 4.0 * np.sin(angle)]]


def test_planners_know_velocities_of_the_engine_and_recordings_nearly():
    """Quadrotors that decide five times a second, and so never fly at their last command."""
    flying, far = [], 0

    def ways(situation):
        flying.append(mission._world.velocities()[:, :2])
        return wandering(situation)

    spy = Spy(ways)
    mission = Mission(load_scenario("forest", ["duration=3", "sensing.mode=ideal", "rates.planning=5"]), spy, 0)
    snapshots = list(mission.fly())
    recording = recording_of(mission, snapshots)
    for k, (team, velocities) in enumerate(zip(spy.teams, flying[::3], strict=True)):
        for s in team:
            np.testing.assert_array_equal(s.own.velocity, velocities[s.own.id])
            for v in s.neighbours:
                np.testing.assert_array_equal(v.velocity, velocities[v.id])
            recorded = vehicle_at(recording, k, s.own.id)
            np.testing.assert_array_equal(recorded.position, s.own.position)
            assert np.linalg.norm(recorded.velocity - s.own.velocity) < 0.6  # m/s: half a scan at 6 m/s²
            far += k > 0 and np.linalg.norm(s.own.velocity - snapshots[k].commands[s.own.id]) > 0.5
    assert far > 20


def test_kinematic_uavs_have_the_velocity_of_their_last_command():
    spy = Spy(wandering)
    mission, snapshots = fly(*IDEAL, planner=spy, duration=3)
    recording = recording_of(mission, snapshots)
    for k, team in enumerate(spy.teams):
        for s in team:
            np.testing.assert_array_equal(s.own.velocity, snapshots[5 * k].commands[s.own.id])
            recorded = vehicle_at(recording, 5 * k, s.own.id)
            np.testing.assert_allclose(recorded.velocity, s.own.velocity, atol=1e-9)
