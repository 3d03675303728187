"""Fleets of trackers on networks that split and heal, and without some messages."""

import numpy as np
import pytest
from helpers.fleets import HALVES, WHOLE, fleet, ids, look, play
from helpers.graphs import graph
from helpers.scenes import AWAY, MOTION, scan, track

from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.tracker import Tracker

FUSIONS = pytest.mark.parametrize("fusion", ["kla", "hcmci"])


def disagreement(trackers: list[Tracker]) -> float:
    """Largest difference of positions [m] between UAVs; their ids must agree."""
    assert len(set(ids(trackers))) == 1
    means = np.array([[t.belief.mean[:2] for t in s.tracks] for s in trackers]).reshape(len(trackers), -1, 2)
    return float(np.ptp(means, axis=0).max(initial=0.0))


class Walkers:
    """People near the origin, and scans of UAVs on a circle above them between trees."""

    def __init__(self, seed: int, uavs: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.forest = Forest(tuple(Tree(*self.rng.uniform(-12, 12, 2), 1.5) for _ in range(12)))
        self.states = np.column_stack([self.rng.uniform(-6, 6, (5, 2)), self.rng.normal(scale=0.9, size=(5, 2))])
        angles = 2 * np.pi * np.arange(uavs) / uavs
        self.poses = [Pose.level(5 * np.cos(a), 5 * np.sin(a), 18.0) for a in angles]

    def walk(self, trackers: list[Tracker], k: int) -> None:
        self.states[:, 2:] += self.rng.normal(scale=0.1, size=(5, 2)) - 0.02 * self.states[:, :2]
        self.states[:, :2] += 0.2 * self.states[:, 2:]
        for t in trackers:
            pose = self.poses[t.uav]
            _, z = look(self.rng, pose, self.forest, self.states[:, :2], 0.97)
            t.step(scan(k, *z, uav=t.uav, pose=pose))

    def held(self, t: Tracker) -> list[int]:
        """The person nearest to each track."""
        means = np.array([s.belief.mean[:2] for s in t.tracks])
        return np.linalg.norm(means[:, None] - self.states[None, :, :2], axis=2).argmin(axis=1).tolist()


@FUSIONS
@pytest.mark.parametrize(("kind", "seed"), [("complete", 0), ("ring", 3)])
def test_a_fleet_that_was_split_agrees_in_the_scan_in_which_it_heals(kind, seed, fusion):
    people = Walkers(seed, 6)
    trackers = fleet(6, forest=people.forest, fusion=fusion)
    side = np.arange(6) < 3
    parted = graph(kind, 6) & (side[:, None] == side[None])
    for k in range(62):
        people.walk(trackers, k)
        fuse(trackers, parted if k < 60 else graph(kind, 6), 5)
        if k == 59:
            # Both partitions detected all people on their own.
            assert not {id for held in ids(trackers[:3]) for id in held} & {i for h in ids(trackers[3:]) for i in h}
    assert disagreement(trackers) < 0.15 and sorted(people.held(trackers[0])) == [0, 1, 2, 3, 4]


def conflict(fusion: str, scans: int) -> list[Tracker]:
    """A lost person, re-acquired by one half of the fleet, and another person that the other half takes for them."""
    trackers = fleet(4, track(3, 0, 0, 0.2, 0), forest=Forest((Tree(0, 0, 3.0),)), fusion=fusion)
    for k in range(scans):
        stranger, person = (-5.0, 3.0 + 0.1 * (k - 10)), (3.4, 0.1 * (k - 14))
        first = [stranger] if k >= 10 else []
        second = [person] if k >= 14 else []
        healed = k == scans - 1
        play(trackers, k, [first, first, second, second], WHOLE if healed else HALVES)
        if k == scans - 2:
            assert ids(trackers) == [(3,)] * 4 and np.ptp([t.tracks[0].belief.mean[0] for t in trackers]) > 7.0
    return trackers


@FUSIONS
@pytest.mark.parametrize("adjacency", [WHOLE, graph("line", 4)])
def test_two_people_of_one_id_become_two_when_the_halves_meet(fusion, adjacency):
    trackers = conflict(fusion, 20)
    assert disagreement(trackers) < 0.05
    kept, other = trackers[0].tracks
    # The partition of the smaller UAV keeps the id.
    assert kept.id == 3 and kept.belief.mean[0] < -4.5
    assert other.id > 3 and other.belief.mean[0] > 3.0
    for k in range(20, 30):
        play(trackers, k, [[(-5.0, 3.0 + 0.1 * (k - 10)), (3.4, 0.1 * (k - 14))]] * 4, adjacency)
        assert set(ids(trackers)) == {(3, other.id)}


@pytest.mark.parametrize("adjacency", [WHOLE, graph("line", 4)])
def test_a_person_known_to_both_halves_and_lost_by_one_keeps_the_older_id(adjacency):
    """No UAV has a view when the halves meet, and the beliefs differ: the last detection counts."""
    trackers = fleet(4, fusion="hcmci")
    for k in range(19):
        place = (0.3 * k, 0.0) if k < 10 else (3.0, 0.3 * (k - 10))  # turns when only the second half looks
        first = [place] if 3 <= k < 10 else None
        play(trackers, k, [first, first, [place], [place]], adjacency & HALVES)
    assert ids(trackers) == [(5_000_000,)] * 2 + [(2_002_000,)] * 2
    expected = MOTION.predict(trackers[2].tracks[0].belief)
    play(trackers, 19, [None] * 4, adjacency)
    assert ids(trackers) == [(2_002_000,)] * 4
    for t in trackers:
        np.testing.assert_allclose(t.tracks[0].belief.mean, expected.mean, atol=1e-6)
        np.testing.assert_allclose(t.tracks[0].belief.covariance, expected.covariance, atol=1e-6)


def test_a_reacquisition_unknown_to_some_uavs_makes_no_duplicate():
    """Messages of the scan of the re-acquisition are lost: only UAVs with a detection know of it."""
    trackers = fleet(3, track(3, 0, 0, 0.5, 0), forest=Forest((Tree(0, 0, 3.0),)))
    for k in range(20):
        z = [(0.0, 3.5 + 0.2 * (k - 12))] if k >= 12 else []
        for t in trackers:
            t.step(scan(k, *z, uav=t.uav) if t.uav == 0 else scan(k, uav=t.uav, pose=AWAY))
        deaf = np.zeros((5, 3, 3), bool)
        deaf[:, 1] = k == 13  # two of three: confirmed and re-acquired in this scan
        fuse(trackers, graph("complete", 3), 5, deaf)
    assert ids(trackers) == [(3,)] * 3


@pytest.mark.parametrize(("cut", "held"), [(12, 0), (25, 1)])
def test_a_track_of_a_forgotten_deletion_comes_back_and_is_deleted_again(cut, held, monkeypatch):
    """UAV 1 looks elsewhere and keeps what UAV 0 has refuted; the two meet again after `cut` scans."""
    monkeypatch.setattr("tracking.fusion.exchange._FORGET_AFTER", 2.0)
    trackers = fleet(2, track(3, 0, 0, 0, 0))
    counts = []
    for k in range(cut + 6):
        trackers[0].step(scan(k, uav=0))
        trackers[1].step(scan(k, uav=1, pose=AWAY))
        fuse(trackers, np.full((2, 2), k >= cut), 5)
        counts.append([len(t.tracks) for t in trackers])
    assert counts[cut - 1] == [0, 1] and counts[cut] == [held, held] and counts[cut + 5] == [0, 0]
