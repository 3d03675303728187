"""Fleets that were all apart and heal to a line, a ring, a star or a complete graph: one track per person, one id."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.fleets import fleet, ids, play
from helpers.graphs import NOW, exchange, graph, told
from helpers.scenes import R


def healing_to(kind: str, n: int) -> np.ndarray:
    """Adjacency of a graph of n UAVs, of which the first is the star's hub."""
    if kind != "star":
        return graph(kind, n)
    hub = np.arange(n) == 0
    return hub[:, None] ^ hub[None]


def turned(seed: int, kind: str) -> list[int]:
    """Numbers of tracks of a person that turned after the first UAV looked away, when all five UAVs meet."""
    rng = np.random.default_rng(seed)
    trackers, place, velocity = fleet(5), np.zeros(2), np.array([1.5, 0.0])
    for k in range(15):
        if k == 11:
            angle = rng.uniform(-1.5, 1.5)
            velocity = 1.5 * np.array([np.cos(angle), np.sin(angle)])
        seen = [None if (u == 0 and k > 11) or k < 2 * u else [rng.multivariate_normal(place, R)] for u in range(5)]
        play(trackers, k, seen, healing_to(kind, 5) if k == 14 else np.zeros((5, 5), bool))
        place = place + 0.2 * velocity
    assert len(set(ids(trackers))) == 1
    return [len(t.tracks) for t in trackers]


@pytest.mark.parametrize("kind", ["complete", "line", "ring", "star"])
@pytest.mark.parametrize("seed", [20, 32])
def test_a_track_last_seen_before_a_turn_gathers_the_newcomers_of_that_person(kind, seed):
    """Some of the four newcomers agree with each other, but not with the track that one of them was matched to."""
    assert turned(seed, kind) == [1] * 5


def test_a_person_in_view_keeps_a_track_beside_an_older_one_of_its_id():
    """One partition saw person 3 before, elsewhere; the other sees 3, and a person where the first has 3."""
    first = replace(told(0, [30.0], [0.05], [3], [NOW - 0.2]), degree=1)
    second = replace(told(1, [0.0, 30.2], [0.05, 0.05], [3, 50], [NOW, NOW], partition=(1, NOW)), degree=1)
    for message in exchange([first, second], graph("complete", 2), 5):
        assert sorted(message.beliefs[0][:, 0].round(1).tolist()) == [0.0, 30.2]  # of the one who saw 3 last


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["complete", "line", "ring", "star"])
def test_on_any_graph_uavs_agree_after_healing_with_hardly_any_duplicates(kind):
    assert sum(max(turned(seed, kind)) > 1 for seed in range(100, 200)) <= 1
