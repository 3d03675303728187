"""Association of tracks that need no comparison, against the general way."""

from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.graphs import exchange, graph, told

from tracking.fusion import track_association

NOW = 10.0


def fleet(rng):
    """Messages of a line of five UAVs, with the tracks of most people, last seen at different times."""
    said = []
    for uav in range(5):
        held = np.sort(rng.permutation(8)[: rng.integers(5, 9)])
        seen = rng.choice([NOW, NOW - 1.0, NOW - 3.0], len(held))
        deleted = ((int(rng.integers(8)), NOW - 2.0),) if rng.random() < 0.3 else ()
        said.append(
            told(
                uav, 40.0 * held, [0.1] * len(held), held.tolist(), seen, partition=(0, NOW), deleted=deleted, time=NOW
            )
        )
    return said


@pytest.mark.parametrize("seed", range(20))
def test_what_is_associated_at_once_is_what_the_general_way_finds(seed, monkeypatch):
    said, adjacency = fleet(np.random.default_rng(seed)), graph("line", 5)
    at_once, ways = track_association._associate_at_once, []

    def note(*given):
        found = at_once(*given)
        ways.append(found[0])
        return found

    monkeypatch.setattr(track_association, "_associate_at_once", note)
    quick = exchange(said, adjacency, 3)
    assert any(ways)
    monkeypatch.setattr(track_association, "_associate_at_once", lambda *given: (False, *at_once(*given)[1:]))
    for ours, theirs in zip(quick, exchange(said, adjacency, 3), strict=True):
        assert (ours.partition, ours.deleted) == (theirs.partition, theirs.deleted)
        for name in ("ids", "keys", "shares", "times", "views", "misses", "sightings"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


@pytest.mark.parametrize("seed", range(10))
def test_tracks_of_two_uavs_are_joined_as_in_the_likeliest_of_all_matchings(seed):
    """Only pairs that are more likely one person than two; a pair without this gain may not help another one."""
    between = np.random.default_rng(seed).normal(0.0, 2.0, (3, 3))
    ratios = np.full((6, 6), -np.inf)
    ratios[:3, 3:], ratios[3:, :3] = between, between.T
    holders = np.repeat(np.eye(2, dtype=bool), 3, axis=0)
    states = SimpleNamespace(sightings=np.full((6, 3), NOW))
    group = track_association._join(states, ratios, holders, np.zeros(6, bool))
    likeliest = max(permutations(range(3)), key=lambda order: np.maximum(between[range(3), order], 0.0).sum())
    joined = {(a, b) for a, b in enumerate(likeliest) if between[a, b] > 0.0}
    assert {(a, b) for a in range(3) for b in range(3) if group[a] == group[3 + b]} == joined
    assert len(np.unique(group)) == 6 - len(joined)
