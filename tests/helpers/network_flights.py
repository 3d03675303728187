"""Missions with a faulty network."""

from sim.mission.mission import Mission, Trial
from sim.recording.recording import Recorder
from sim.scenario.loading import load
from sim.scenario.scenario import resolved

IDEAL = ("sensing.mode=ideal", "dynamics=kinematic")


def fly(*overrides, planner="hover", seed=0, duration=4):
    """The mission flown and its snapshots."""
    mission = Mission.of(Trial(load("forest", [f"duration={duration}", *IDEAL, *overrides]), planner, seed))
    return mission, list(mission.fly())


def recorded(mission, snapshots):
    recorder = Recorder()
    for snapshot in snapshots:
        recorder.add(snapshot)
    return recorder.recording(scenario=resolved(mission.scenario), planner="p", seed=0, forest=mission.forest)
