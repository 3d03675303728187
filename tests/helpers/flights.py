"""Short missions."""

from sim.mission.mission import Mission, Trial
from sim.scenario.loading import load


def fly(*overrides, planner="hover", seed=0, duration=1):
    """The mission flown and its snapshots."""
    setting = load("forest", [f"duration={duration}", *overrides])
    mission = Mission.of(Trial(setting, planner, seed))
    return mission, list(mission.fly())
