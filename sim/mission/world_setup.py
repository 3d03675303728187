"""Set-up of a mission's world from its seed: the forest, the people who walk in it, and the air."""

import math
from typing import NamedTuple

import msgspec
import numpy as np

from sim.scenario.environment import Wind
from sim.scenario.geo import tell_origin
from sim.scenario.random_streams import stream
from sim.scenario.remarks import find_remarks
from sim.scenario.scenario import Scenario, is_clear
from sim.world.forest import grow
from sim.world.recorded_people import describe_trajectories, read_trajectories
from sim.world.stem_map import describe_stem_map, plant
from sim.world.trajectories import Trajectories
from sim.world.walkers import walk
from tracking.errors import InputError
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.exponential import exp
from tracking.numerics.normal import standard_normal

_TRIES = 10_000  # places that are drawn for one UAV


def make_forest_and_people(scenario: Scenario, seed: int) -> tuple[Forest, Trajectories]:
    """The trees of a scenario and seed, and the people: simulated walkers or the recorded ones of the scenario's file.

    Walkers go round trunks. Recorded people do not, so no trunk stands on their paths.
    """
    recorded = _read_recorded_people(scenario)
    if scenario.trees.file:
        planted = plant(scenario, recorded)
    else:
        paths = np.zeros((0, 2)) if recorded is None else recorded.positions[~np.isnan(recorded.positions[..., 0])]
        planted = grow(scenario.trees, scenario.area, stream(seed, "forest"), paths)
    forest = Forest(planted.trees, scenario.sensing.occlusion)
    if recorded is not None:
        return forest, recorded
    walkers = stream(seed, "walkers")
    return forest, walk(scenario.people, scenario.area, forest, duration=_find_duration(scenario), rng=walkers)


class Remarks(NamedTuple):
    """What users should know of a scenario that is allowed, one line each."""

    files: list[str]  # what the files of people and trees hold
    doubts: list[str]  # settings without the effect that one expects, and parts of files that are left out


def find_scenario_remarks(scenario: Scenario) -> Remarks:
    """Remarks on a scenario and the files that it names; InputError if a file cannot be used."""
    people, left_out = describe_trajectories(scenario)
    trees, odd = describe_stem_map(scenario.trees, scenario.geo)
    return Remarks(
        [line for line in (people, trees, tell_origin(scenario.geo)) if line],
        [*find_remarks(scenario), *odd, *left_out],
    )


def draw_starts(scenario: Scenario, seed: int) -> Scenario:
    """The scenario with the starts that a seed draws; InputError if there is no room for a UAV beside the others.

    A place is drawn uniformly from the disc around `start`, again and again until it lies inside the area and clear of
    the other UAVs.
    """
    rng, area = stream(seed, "starts"), scenario.area
    placed = {i: uav for i, uav in enumerate(scenario.uavs) if not uav.start_radius}
    if len(placed) == len(scenario.uavs):
        return scenario
    for i, uav in enumerate(scenario.uavs):
        if i in placed:
            continue
        for offset in uav.start_radius * rng.uniform(-1.0, 1.0, (_TRIES, 2)):
            x, y = (uav.start + offset).tolist()
            there = msgspec.structs.replace(uav, start=(x, y), start_radius=0.0)
            inside = length(offset) <= uav.start_radius and abs(x) <= area.width / 2 and abs(y) <= area.height / 2
            if inside and all(is_clear(there, other) for other in placed.values()):
                placed[i] = there
                break
        else:
            raise InputError(f"uavs.{i}.start_radius: {uav.start_radius:g} m leaves no room beside the other UAVs")
    return msgspec.structs.replace(scenario, uavs=tuple(placed[i] for i in range(len(placed))))


def count_people(scenario: Scenario) -> int:
    """Number of people in the missions of a scenario."""
    recorded = _read_recorded_people(scenario)
    return scenario.people.count if recorded is None else recorded.positions.shape[1]


def _read_recorded_people(scenario: Scenario) -> Trajectories | None:
    file = scenario.people.trajectory_file
    return (
        None
        if file is None
        else read_trajectories(
            file, scenario.area, duration=_find_duration(scenario), people=scenario.people, geo=scenario.geo
        )
    )


def _find_duration(scenario: Scenario) -> float:
    """Time [s] that trajectories cover: at least two scans, because a velocity needs two positions."""
    return max(scenario.duration, 1 / scenario.rates.sensing)


class Air:
    """The velocity of the air at each physics step: first-order Gauss-Markov gusts around the mean.

    The two components are independent, with the scenario's standard deviation and correlation time. The process starts
    in its steady state and is discretised exactly, so that its statistics do not depend on the rate. All UAVs meet the
    same gust at the same time, because eddies that last for seconds are larger than a fleet.
    """

    def __init__(self, wind: Wind, rate: int, rng: np.random.Generator) -> None:
        self._wind = wind
        self._kept = exp(-1.0 / (rate * wind.gust_time))
        self._rng = rng
        self._gust = wind.gust * standard_normal(rng, 2)

    def steps(self, count: int) -> Array:
        """Velocities (count, 2) m/s of the air, east and north, in the next physics steps."""
        drawn = self._wind.gust * math.sqrt(1.0 - self._kept * self._kept) * standard_normal(self._rng, (count, 2))
        gusts = np.empty((count, 2))
        for k in range(count):
            gusts[k] = self._gust
            self._gust = self._kept * self._gust + drawn[k]
        return np.asarray(gusts + self._wind.velocity)
