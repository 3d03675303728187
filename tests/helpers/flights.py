"""Short missions."""

from planning.planner_loading import load_planner
from sim.mission.mission import Mission
from sim.mission.recorder import Recorder
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import encode_scenario

# One above the other, so that they see one another; cameras of two sizes.
PAIR = "uavs=[{{start=[-28,-2],footprint=20,mount='{0}'}},{{start=[-28,2],footprint=27,mount='{0}',pixels=96}}]"
IDEAL = ("sensing.mode=ideal", "dynamics=kinematic")


def mission_of(setting, planner="hover", seed=0, repeat=0):
    """A mission that has not begun, by the planner of a name."""
    return Mission(setting, load_planner(planner), seed, repeat)


def fly(*overrides, planner="hover", seed=0, duration=1, repeat=0, see=lambda mission: None):
    """The mission flown by a planner, or the one of a name, and its snapshots; `see` is called at each scan."""
    setting = load_scenario("forest", [f"duration={duration}", *overrides])
    mission = Mission(setting, load_planner(planner) if isinstance(planner, str) else planner, seed, repeat)
    snapshots = []
    for snapshot in mission.fly():
        snapshots.append(snapshot)
        see(mission)
    return mission, snapshots


def fly_ideal(*overrides, duration=4, **options):
    """The same with ideal sensing and kinematic motion."""
    return fly(*IDEAL, *overrides, duration=duration, **options)


def recording_of(mission, snapshots, *, planner="greedy", seed=0, repeat=0):
    """The recording of a mission that was flown."""
    recorder = Recorder(repeat)
    for snapshot in snapshots:
        recorder.add(snapshot)
    return recorder.recording(
        scenario=encode_scenario(mission.scenario), planner=planner, seed=seed, forest=mission.forest
    )


def recorded(*overrides, planner="greedy", seed=3, duration=8, **options):
    """The recording of a mission."""
    mission, snapshots = fly(*overrides, planner=planner, seed=seed, duration=duration, **options)
    return recording_of(mission, snapshots, seed=seed, repeat=options.get("repeat", 0))


def filmed(*overrides, duration=4):
    """A recording, and the image of each scan and UAV that the mission had."""
    images = []

    def keep(mission):
        images.append([None if frame is None else frame.copy() for frame in mission.images])

    return recorded(*overrides, duration=duration, see=keep), images
