"""Limits of a mission's size: products of settings that no machine could fly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

from sim.scenario.bounds import Path

if TYPE_CHECKING:  # which has itself checked here
    from sim.scenario.scenario import Scenario

MOST_WALKED = 3.6e5  # seconds of all people together, which take about a gigabyte
_MOST_PATHS = 2e7  # m, of which each is a point to walk to
Load = tuple[str, float, str, float]  # settings, their product, its unit and its limit


def check_workload(scenario: Scenario) -> None:
    """ValueError if the product of some settings is too large; it names them."""
    for settings, amount, things, most in _loads(scenario):
        if amount > most:
            raise ValueError(f"{settings} come to {amount:.6g} {things}; at most {most:g} are allowed")


def _loads(scenario: Scenario) -> Iterator[Load]:
    uavs, rates, people = len(scenario.uavs), scenario.rates, scenario.people
    scans = scenario.duration * rates.sensing
    yield "duration, rates.physics and uavs", scenario.duration * rates.physics * uavs, "steps of a UAV", 1e9
    yield "duration, rates.sensing and uavs", scans * uavs, "scans", 2e6
    yield (
        "duration, rates.sensing, network.rounds and uavs",
        scans * scenario.network.rounds * uavs * uavs,
        "messages",
        1e9,
    )
    if scenario.sensing.mode == "camera":
        pixels = scans * sum(uav.pixels * uav.pixels for uav in scenario.uavs)
        yield "duration, rates.sensing, uavs and their pixels", pixels, "pixels", 1e12
    area = scenario.area.width * scenario.area.height
    yield "area and uavs, each of which keeps a map of it,", area * uavs, "m² of maps", 6e8
    if not people.trajectories:
        yield "duration and people.count", scenario.duration * people.count, "seconds of walking", MOST_WALKED
        told = scans * uavs * people.count
        yield "duration, rates.sensing, uavs and people.count", told, "looks for a person", 1e7
        lengths = [_length(path) for path in people.paths]
        yield "people.paths, each as long as the longest,", len(lengths) * max(lengths, default=0.0), "m", _MOST_PATHS


def _length(path: Path) -> float:
    """Length of a path [m]."""
    return sum(math.sqrt((x - u) * (x - u) + (y - v) * (y - v)) for (x, y), (u, v) in pairwise(path))
