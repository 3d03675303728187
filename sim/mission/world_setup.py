"""Set-up of a mission's world from its seed: the forest, and the people who walk in it."""

import numpy as np

from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario
from sim.world.forest import grow
from sim.world.trajectories import Trajectories, read_trajectories
from sim.world.walkers import walk
from tracking.geometry.visibility import Forest


def forest_and_people(scenario: Scenario, seed: int) -> tuple[Forest, Trajectories]:
    """The trees of a scenario and seed, and the people: simulated walkers or the recorded ones of the scenario's file.

    Walkers go round trunks. Recorded people do not, so no trunk stands on their paths. Trajectories cover at least two
    scans, because a velocity needs two positions.
    """
    people, duration = scenario.people, max(scenario.duration, 1 / scenario.rates.sensing)
    file = people.trajectory_file
    recorded = None if file is None else read_trajectories(file, scenario.area, duration=duration)
    paths = np.zeros((0, 2)) if recorded is None else recorded.positions[~np.isnan(recorded.positions[..., 0])]
    grown = grow(scenario.trees, scenario.area, stream(seed, "forest"), paths)
    forest = Forest(grown.trees, scenario.sensing.occlusion)
    if recorded is not None:
        return forest, recorded
    return forest, walk(people, scenario.area, forest, duration=duration, rng=stream(seed, "walkers"))
