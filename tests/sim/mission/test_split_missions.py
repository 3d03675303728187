"""Missions with a network that splits and heals: the fleet agrees in that scan, without duplicate tracks."""

import itertools

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from sim.mission.mission import Mission, Trial
from sim.mission.radio import open_links
from sim.scenario.loading import load

IDEAL = ("sensing.mode=ideal", "dynamics=kinematic")
NEAR, ALONE = 1.0, 3.0  # m, of a person's track, and of people with tracks that cannot be mistaken for each other's
SPLITS = {
    "one apart": ("network.cuts=[{links=[[0, 2], [1, 2]], start=3, end=13}]",),
    "all apart": ("network.cuts=[{links=[[0, 1], [0, 2], [1, 2]], start=2, end=14}]",),
    "off and on": (
        "network.cuts=[{links=[[0, 1], [0, 2]], start=2, end=9}, {links=[[0, 2], [1, 2]], start=11, end=15}]",
    ),
    "line": ("network.links=[[0, 1], [1, 2]]", "network.cuts=[{links=[[1, 2]], start=3, end=13}]"),
}


def tracks_near(snapshot, people):
    """Number (n, M) of tracks of each UAV near each person."""
    counts = []
    for held in snapshot.tracks:
        places = np.array([t.belief.mean[:2] for t in held]).reshape(-1, 2)
        counts.append((np.linalg.norm(places[:, None] - people[None], axis=2) < NEAR).sum(axis=0))
    return np.array(counts)


def flown(split: str, seed: int, *overrides: str, planner: str = "sma-nbo", duration: int = 18):
    """Per scan whether all hear each other, over others or not, whether all ids agree, and tracks near lone people."""
    scenario = load("forest", [f"duration={duration}", *SPLITS[split], *overrides])
    whole, agreed, counts = [], [], []
    for s in Mission.of(Trial(scenario, planner, seed)).fly():
        graph = open_links(scenario.network, s.time, np.array([p.position for p in s.poses]))
        whole.append(connected_components(graph)[0] == 1)
        agreed.append(len({tuple(t.id for t in held) for held in s.tracks}) == 1)
        gaps = np.linalg.norm(s.people[:, None] - s.people[None], axis=2) + np.diag(np.full(len(s.people), np.inf))
        counts.append(tracks_near(s, s.people) * (gaps.min(axis=1) > ALONE))
    return np.array(whole), np.array(agreed), np.array(counts)


def check(split: str, seed: int, *overrides: str) -> int:
    """Assert agreement from healing on, if any UAVs were apart; number of healings."""
    whole, agreed, counts = flown(split, seed, *overrides)
    healed = np.flatnonzero(whole[1:] & ~whole[:-1]) + 1
    assert agreed[whole].all()
    for k in healed.tolist():
        later = itertools.takewhile(lambda j: whole[j], range(k, len(whole)))
        assert counts[list(later)].max() <= 1, (split, seed, k)
    return len(healed)


@pytest.mark.parametrize(("split", "seed"), [("one apart", 0), ("all apart", 1)])
def test_a_fleet_that_heals_agrees_at_once_without_duplicates(split, seed):
    assert check(split, seed, *IDEAL) == 1


@pytest.mark.slow
@pytest.mark.parametrize("sensing", [IDEAL, ()])
@pytest.mark.parametrize("seed", range(20))
def test_a_fleet_that_heals_agrees_at_once_without_duplicates_on_any_seed(seed, sensing):
    split = list(SPLITS)[seed % len(SPLITS)]
    assert check(split, seed, *sensing) >= 1
