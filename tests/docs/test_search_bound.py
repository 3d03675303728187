"""docs/results/worlds.md: how soon a fleet without knowledge of people could find them at best, as it says."""

import re

import numpy as np
import pytest
from helpers.pages import DOCS

from sim.facts.metrics.fleet_facts import _find_people_in_the_open
from sim.mission.world_setup import make_forest_and_people
from sim.scenario.loading import load


def people_of(scenario, seed):
    """Times [s] for which people can be found, and the speeds [m/s] of all."""
    forest, people = make_forest_and_people(scenario, seed)
    times = np.arange(round(scenario.duration * scenario.rates.sensing) + 1) / scenario.rates.sensing
    places = np.array([people.at(time)[0] for time in times])
    free = _find_people_in_the_open(places, np.array([[tree.x, tree.y, tree.canopy_radius] for tree in forest.trees]))
    there, seen = ~np.isnan(places[..., 0]), np.flatnonzero(free.any(axis=0))
    ends = np.array([np.flatnonzero(there[:, person])[-1] for person in seen])
    moves = np.diff(places, axis=0) * scenario.rates.sensing
    return times[ends] - times[np.argmax(free[:, seen], axis=0)], np.hypot(*moves[~np.isnan(moves[..., 0])].T)


@pytest.mark.docs
def test_the_best_times_to_find_people_are_those_of_the_page():
    """The share of people not found falls from that outside the images at first, as fast as the images sweep."""
    scenario = load("search", [])
    stays, speeds = zip(*(people_of(scenario, seed) for seed in range(50)), strict=True)
    edges, area = np.array([uav.footprint for uav in scenario.uavs]), scenario.area.width * scenario.area.height
    passing = np.hypot(scenario.uavs[0].max_speed, np.sqrt(np.mean(np.square(np.concatenate(speeds)))))
    outside = 1.0 - np.square(edges).sum() / area
    told = []
    for width in (edges.sum(), np.sqrt(2.0) * edges.sum()):
        rate = width * passing / area
        searched = [np.minimum(stay, outside / rate) for stay in stays]
        found = np.mean([np.mean(outside * time - rate * time * time / 2) for time in searched])
        told += [f"{width * passing:.0f} m²", f"{found:.1f} s"]
    page = " ".join((DOCS / "results" / "worlds.md").read_text(encoding="utf-8").split())
    (said,) = re.findall(r"at most (\d+ m²) more in each second, or (\d+ m²) .*? in ([\d.]+ s), or ([\d.]+ s)", page)
    assert said == (told[0], told[2], told[1], told[3])
