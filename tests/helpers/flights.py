"""Short missions."""

from planning.loading import load_planner
from sim.mission.mission import Mission, Trial
from sim.recording.recording import Recorder
from sim.scenario.loading import load
from sim.scenario.scenario import resolved

# One above the other, so that they see one another; cameras of two sizes.
PAIR = "uavs=[{{start=[-28,-2],footprint=20,mount='{0}'}},{{start=[-28,2],footprint=27,mount='{0}',pixels=96}}]"


def fly(*overrides, planner="hover", seed=0, duration=1):
    """The mission flown and its snapshots."""
    setting = load("forest", [f"duration={duration}", *overrides])
    mission = Mission.of(Trial(setting, planner, seed))
    return mission, list(mission.fly())


def recorded(*overrides, planner="greedy", seed=3, duration=8, see=lambda mission: None):
    """The recording of a mission, flown by a planner or by the one of a name, and its scenario.

    `see` is called with the mission at each scan.
    """
    setting, recorder = load("forest", [f"duration={duration}", *overrides]), Recorder()
    mission = Mission(setting, load_planner(planner) if isinstance(planner, str) else planner, seed)
    for snapshot in mission.fly():
        recorder.add(snapshot)
        see(mission)
    recording = recorder.recording(scenario=resolved(setting), planner="greedy", seed=seed, forest=mission.forest)
    return recording, setting


def filmed(*overrides, duration=4):
    """A recording, and the image of each scan and UAV that the mission had."""
    images = []

    def keep(mission):
        images.append([None if frame is None else frame.copy() for frame in mission.frames])

    return recorded(*overrides, duration=duration, see=keep)[0], images
