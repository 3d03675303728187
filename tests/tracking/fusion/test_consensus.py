"""Consensus: weights of what neighbours send, and ids that agree without a server."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.graphs import SCAN, exchange, graph, message, metropolis
from scipy.optimize import brentq
from scipy.stats import multivariate_normal

from tracking.fusion.consensus import combine, fuse
from tracking.fusion.message import EMPTY, IDS_PER_SCAN, Message, is_new_id, new_id


def beliefs(rng: np.random.Generator, count: int, centre=(0, 0, 0, 0)) -> tuple[np.ndarray, np.ndarray]:
    roots = rng.normal(size=(count, 4, 4)) * 0.5
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.2 * np.eye(4)
    return np.array(centre) + rng.normal(scale=0.3, size=(count, 4)), covariances


def select(said, rows):
    """A message with these rows of its tracks."""
    return replace(said, **{name: getattr(said, name)[np.array(rows, dtype=int)] for name in EMPTY})


def test_a_fleet_without_uavs_sends_nothing():
    assert fuse([], np.zeros((0, 0), dtype=bool), 5).shape == (0,)


class Heard:
    """A member that says a given message and keeps what it is left with."""

    max_speed = 3.0

    def __init__(self, said: Message) -> None:
        self.said = said

    def message(self, degree: int) -> Message:
        return replace(self.said, degree=degree)

    def accept(self, message: Message) -> None:
        self.left = message


def like_named(rng: np.random.Generator, uavs: int) -> list[Message]:
    """Messages about the same five tracks that differ in all else."""
    out = []
    for u in range(uavs):
        said = {
            "partition": (0, float(rng.integers(0, 3))),
            "times": rng.integers(0, 3, (5, 4)) / 5.0,
            "views": rng.integers(0, 2**36, (5, 2)),
            "misses": rng.integers(0, 4, 5),
            "sightings": np.column_stack([rng.normal(size=(5, 2)), np.arange(5.0)]),
            "novel": rng.normal(size=(5, 20 + u + 1)) * (rng.random((5, 1)) < 0.5),
        }
        out.append(message(u, range(1, 6), *beliefs(rng, 5), degree=0, weight=rng.uniform(0.1, 1.0, 5), **said))
    return out


@pytest.mark.parametrize("kind", ["line", "ring", "complete"])
def test_averages_are_mixed_by_metropolis_weights_and_the_latest_of_all_else_is_taken(kind):
    """With messages lost, too: a UAV keeps the share of a neighbour that it did not hear."""
    rng, adjacency = np.random.default_rng(3), graph(kind, 6)
    said, heard = like_named(rng, 6), adjacency & (rng.random((6, 6)) < 0.7)
    members = [Heard(m) for m in said]
    fuse(members, adjacency, 1, ~heard[None])
    weights = np.where(heard, metropolis(adjacency), 0.0)
    weights += np.diag(1.0 - weights.sum(axis=1))
    novel = np.array([np.pad(m.novel, ((0, 0), (0, 26 - m.novel.shape[1]))) for m in said])
    for u, left in enumerate(m.left for m in members):
        assert left.novel.shape == (5, 26)
        for ours, all_of_them in ((left.shares, np.array([m.shares for m in said])), (left.novel, novel)):
            np.testing.assert_allclose(ours, np.tensordot(weights[u], all_of_them, 1), rtol=1e-12, atol=1e-12)
        told = [m for m, one in zip(said, heard[u] | (np.arange(6) == u), strict=True) if one]
        np.testing.assert_array_equal(left.times, np.max([m.times for m in told], axis=0))
        np.testing.assert_array_equal(left.views, np.bitwise_or.reduce([m.views for m in told]))
        np.testing.assert_array_equal(left.misses, np.bitwise_and.reduce([m.misses for m in told]))
        np.testing.assert_array_equal(left.sightings, said[u].sightings)
        assert left.partition == (0, max(m.partition[1] for m in told))


@pytest.mark.parametrize("seed", range(4))
def test_a_table_of_all_rounds_equals_the_updates_of_single_uavs(seed):
    """Bit by bit, with losses; three rounds do not reach all UAVs."""
    rng = np.random.default_rng(seed)
    adjacency, lost = graph(("line", "ring")[seed % 2], 8), rng.random((3, 8, 8)) < 0.4
    members = [Heard(said) for said in like_named(rng, 8)]
    expected = [m.message(int(row.sum())) for m, row in zip(members, adjacency, strict=True)]
    for k in range(3):
        expected = exchange(expected, adjacency & ~lost[k], 1)
    fuse(members, adjacency, 3, lost)
    assert len({m.times.tobytes() for m in expected}) > 1
    for ours, theirs in zip([m.left for m in members], expected, strict=True):
        assert (ours.partition, ours.deleted) == (theirs.partition, theirs.deleted)
        for name in ("ids", "keys", "shares", "times", "views", "misses", "sightings"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
        width = theirs.novel.shape[1]  # columns of UAVs that it has not heard of are empty
        np.testing.assert_array_equal(ours.novel[:, :width], theirs.novel)
        assert not ours.novel[:, width:].any()


@pytest.mark.parametrize("columns", [0, 21])
def test_a_fleet_without_tracks_agrees_on_that(columns):
    rng = np.random.default_rng(0)
    said = [select(m, []) for m in like_named(rng, 3)]
    members = [Heard(replace(m, novel=np.zeros((0, columns)))) for m in said]
    fuse(members, graph("complete", 3), 2)
    assert [(m.left.shares.shape, m.left.times.shape) for m in members] == [((0, 22), (0, 4))] * 3


def test_pairs_agree_at_once_on_the_smaller_id_and_a_lone_uav_keeps_its_message():
    means, covariances = beliefs(np.random.default_rng(8), 1)
    pair = [message(u, [id], means, covariances, degree=1) for u, id in enumerate((31, 12))]
    for m in exchange(pair, graph("line", 2), 1):
        np.testing.assert_array_equal(m.ids, [12])
    own = message(0, [3], *beliefs(np.random.default_rng(12), 1), degree=0)
    assert combine(own, [], 3.0) is own


def random_fleet(rng: np.random.Generator, adjacency: np.ndarray) -> list[Message]:
    """Each UAV holds some of four people, far apart, under ids of its own for people met in this scan."""
    centres = 20.0 * np.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0]])
    out = []
    for uav, row in enumerate(adjacency):
        held = np.flatnonzero(rng.random(4) < 0.6)
        parts = [beliefs(rng, 1, centres[k]) for k in held]
        means = np.array([p[0][0] for p in parts]).reshape(-1, 4)
        covariances = np.array([p[1][0] for p in parts]).reshape(-1, 4, 4)
        ids = [new_id(3, uav, c) for c in range(len(held))]
        out.append(message(uav, ids, means, covariances, degree=int(row.sum())))
    return out


@pytest.mark.parametrize("kind", ["complete", "ring", "line"])
def test_new_tracks_of_different_uavs_get_one_id_each_in_the_fleet(kind):
    rng = np.random.default_rng(6)
    adjacency = graph(kind, 6)
    for _ in range(20):
        messages = random_fleet(rng, adjacency)
        after = exchange(messages, adjacency, 5)
        people = {tuple(np.round(mean[:2] / 20).astype(int)) for m in messages for mean in m.beliefs[0]}
        for m in after:
            np.testing.assert_array_equal(m.ids, after[0].ids)
            assert {tuple(np.round(mean[:2] / 20).astype(int)) for mean in m.beliefs[0]} == people
            assert len(m.ids) == len(people)


def test_the_fleets_sum_is_conserved_while_ids_change():
    rng = np.random.default_rng(7)
    adjacency = graph("line", 6)
    for _ in range(20):
        messages = random_fleet(rng, adjacency)
        total = sum(m.shares.sum(axis=0) for m in messages)
        for _ in range(5):
            messages = exchange(messages, adjacency, 1)
            np.testing.assert_allclose(sum(m.shares.sum(axis=0) for m in messages), total, rtol=1e-11, atol=1e-9)


def test_tracks_are_of_one_person_if_that_is_likelier_than_two_people():
    """The oracle is SciPy's density; the border between one person and two is where both are as likely."""
    covariance = np.diag([0.1, 0.1, 0.2, 0.2])
    two = 1e-5 / (math.pi * 3.0**2)  # 1e-5 people per m² whom one UAV does not know, of any velocity up to 3 m/s
    border = brentq(lambda x: multivariate_normal(np.zeros(4), 2 * covariance).pdf([x, 0, 0, 0]) / two - 1.0, 0.1, 9.0)
    for factor, count in ((0.999, 1), (1.001, 2)):
        offset = [factor * border, 0.0, 0.0, 0.0]
        pair = [message(0, [1], np.zeros(4), covariance, degree=1), message(1, [2], offset, covariance, degree=1)]
        assert [len(m.ids) for m in exchange(pair, graph("line", 2), 3)] == [count, count]


def test_a_void_version_of_a_track_does_not_keep_it_from_a_new_one():
    """UAV 1 last had person 3 elsewhere, and starts a track where UAV 0 has found 3 again."""
    covariances = np.stack([0.1 * np.eye(4), 4.0 * np.eye(4)])
    pair = [
        message(0, [3], np.zeros(4), covariances[0], degree=1, seen=5.0),
        message(1, [7, 3], [[0.1, 0, 0, 0], [9.0, 9, 0, 0]], covariances, degree=1, seen=[5.0, 1.0]),
    ]
    pair[1] = select(pair[1], [1, 0])
    for m in exchange(pair, graph("line", 2), 1):
        np.testing.assert_array_equal(m.ids, [3])
        np.testing.assert_allclose(m.beliefs[0][0, :2], [0.05, 0.0])


def test_a_new_id_of_a_contested_track_is_not_one_that_another_track_has():
    """UAV 1's partition gave its other track, in a round before, the id that comes first for a track without one."""
    taken = new_id(SCAN, 1, IDS_PER_SCAN - 1)
    far = np.array([[-20.0, 0, 0, 0], [20.0, 0, 0, 0]])
    pair = [
        message(0, [5], np.zeros(4), 0.1 * np.eye(4), degree=1),
        message(1, [5, taken], far, [0.1 * np.eye(4)] * 2, degree=1, partition=(1, 0.0)),
    ]
    for m in exchange(pair, graph("line", 2), 1):
        np.testing.assert_array_equal(m.ids, [5, taken - 1, taken])
        np.testing.assert_allclose(m.beliefs[0][:, 0], [0.0, -20.0, 20.0], atol=1e-9)


def test_a_contested_track_among_hundreds_gets_no_id_of_a_new_one():
    count = IDS_PER_SCAN + 3  # a person each
    places = np.array([[20.0 * (k % 40), 20.0 * (k // 40), 0, 0] for k in range(count)])
    for contested in (IDS_PER_SCAN // 2, count - 1):
        pair = [
            message(0, [contested], np.full(4, -50.0), 0.1 * np.eye(4), degree=1),
            message(1, range(count), places, [0.1 * np.eye(4)] * count, degree=1, partition=(1, 0.0)),
        ]
        ids = combine(pair[0], pair[1:], 3.0).ids
        assert len(ids) == count + 1 and not is_new_id(ids, SCAN).any()
        assert new_id(SCAN, 1, 0) < ids[-1] < new_id(SCAN, 2, 0)


def test_a_lost_track_of_a_uav_does_not_keep_its_new_one_apart():
    """UAV 1 lost person 3 elsewhere and starts a track of the person that UAV 0 has found again."""
    covariances = np.stack([4.0 * np.eye(4), 0.1 * np.eye(4)])
    lost, found, other = [7.0, 7.0, 0, 0], [0.1, 0, 0, 0], {"partition": (1, 5.0), "time": 5.0}
    three = [
        message(0, [3], np.zeros(4), covariances[1], degree=1, seen=5.0),
        message(1, [3], lost, covariances[0], degree=2, seen=1.0, **other),
        message(2, [3, 7], [lost, found], covariances, degree=1, seen=[1.0, 5.0], **other),
    ]
    for m in exchange(three, graph("line", 3), 2):
        np.testing.assert_array_equal(m.ids, [3])


def test_pairs_match_together_where_velocities_agree():
    covariance = 0.1 * np.eye(4)
    east, west = [0, 0, 1.5, 0], [0, 0, -1.5, 0]
    pair = [message(u, [u + 1], v, covariance, degree=1) for u, v in enumerate((east, west))]
    assert [len(m.ids) for m in exchange(pair, graph("line", 2), 3)] == [2, 2]
    covariance = 0.1 * np.eye(4)
    ours = np.array([[0.0, 0, 0, 0], [1.0, 0, 0, 0]])
    theirs = np.array([[0.9, 0, 0, 0], [1.9, 0, 0, 0]])  # nearest first would pair 1.0 with 0.9 and lose two
    said = enumerate((([1, 2], ours), ([3, 4], theirs)))
    pair = [message(u, ids, means, [covariance] * 2, degree=1) for u, (ids, means) in said]
    for m in exchange(pair, graph("line", 2), 1):
        np.testing.assert_array_equal(m.ids, [1, 2])
        np.testing.assert_allclose(m.beliefs[0][:, 0], [0.45, 1.45])


def test_labels_of_new_tracks_are_unique_and_ascend_with_time():
    ids = [new_id(*birth) for birth in itertools.product(range(1, 5), (0, 1, 999), (0, 1, 999))]
    assert len(set(ids)) == len(ids) and new_id(2, 0, 0) > new_id(1, 999, 999) > 999_999
