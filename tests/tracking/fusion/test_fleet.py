"""Trackers as a fleet: one id per person, and one deletion per track."""

import dataclasses

import numpy as np
import pytest
from helpers.fleets import fleet, look
from helpers.graphs import graph
from helpers.scenes import ABOVE, AWAY, check, scan, track, tracker

from tracking.fusion.consensus import fuse
from tracking.fusion.message import FIRST_NEW_ID
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.tracker import Tracker

PAIR = np.ones((2, 2), bool)


def test_a_track_lives_while_one_uav_sees_the_person_and_ends_for_all():
    trackers = fleet(3, track(3, 0, 0, 0, 0))
    for k in range(20):
        for u, t in enumerate(trackers):
            t.step(scan(k, *([(0, 0)] if u == 0 else []), uav=u))
        fuse(trackers, graph("line", 3), 5)
    assert [[t.id for t in s.tracks] for s in trackers] == [[3]] * 3
    trackers = fleet(4, track(3, 0, 0, 0, 0))
    for k in range(6):
        for u, t in enumerate(trackers):
            t.step(scan(k, uav=u, pose=ABOVE if u == 3 else AWAY))
        fuse(trackers, graph("line", 4), 5)
        assert [len(t.tracks) for t in trackers] == [int(k < 4)] * 4


def test_a_track_taken_over_from_a_neighbour_brings_its_misses_along():
    trackers = [tracker(track(3, 0, 0, 0, 0)), tracker(uav=1)]
    for k in range(5):
        trackers[0].step(scan(k, uav=0))
        trackers[1].step(scan(k, uav=1, pose=AWAY))
        fuse(trackers, PAIR if k > 2 else np.eye(2, dtype=bool), 5)
        assert [len(t.tracks) for t in trackers] == ([1, 0] if k < 3 else [1, 1] if k < 4 else [0, 0])


def test_a_partition_brings_a_deleted_track_back_only_if_it_detected_the_person():
    trackers = fleet(2, track(3, 0, 0, 0, 0))
    for k in range(10):
        trackers[0].step(scan(k, uav=0))
        trackers[1].step(scan(k, uav=1, pose=AWAY))
        fuse(trackers, PAIR if k > 7 else np.eye(2, dtype=bool), 5)
        assert [len(t.tracks) for t in trackers] == ([1, 1] if k < 4 else [0, 1] if k < 8 else [0, 0])
    trackers = fleet(2, track(3, 0, 0, 0, 0))
    for k in range(10):
        trackers[0].step(scan(k, uav=0))
        trackers[1].step(scan(k, (0, 0), uav=1))
        fuse(trackers, PAIR if k > 7 else np.eye(2, dtype=bool), 5)
        assert [len(t.tracks) for t in trackers] == [int(k < 4 or k > 7), 1]


def test_a_partition_has_the_name_of_its_smallest_uav_heard_within_a_second():
    """From the eleventh scan on UAV 0 is alone. At the start the fleet is one partition."""
    trackers, leaders = fleet(3, track(3, 0, 0, 0, 0)), []
    for k in range(20):
        for t in trackers:
            t.coast(0.25 * k)
        leaders.append([t.message(2).partition[0] for t in trackers])
        apart = (np.arange(3) == 0) & (k > 9)
        fuse(trackers, apart[:, None] == apart, 5)
    assert leaders == [[0, 0, 0]] * 14 + [[0, 1, 2]] + [[0, 1, 1]] * 5


def walk(seed: int, scans: int = 150) -> tuple[list[Tracker], np.ndarray]:
    """A fleet of three that starts from nothing above four people in a forest, with false alarms and misses."""
    rng = np.random.default_rng(seed)
    forest = Forest(tuple(Tree(*rng.uniform(-15, 15, 2), 1.5) for _ in range(12)))
    trackers = fleet(3, forest=forest)
    people = np.column_stack([rng.uniform(-6, 6, (4, 2)), rng.normal(scale=0.7, size=(4, 2))])
    for k in range(scans):
        people[:, 2:] += rng.normal(scale=0.05, size=(4, 2)) - 0.01 * people[:, :2]
        people[:, :2] += 0.2 * people[:, 2:]
        for u, t in enumerate(trackers):
            pose = Pose.level(*np.array([[0, 4], [4, -3], [-4, -3]])[u], 22.0)
            _, z = look(rng, pose, forest, people[:, :2], 0.97)
            false = pose.position[:2] + rng.uniform(-12, 12, (rng.poisson(0.05), 2))
            t.step(scan(k, *z, *false, uav=u, pose=pose))
        fuse(trackers, graph("line", 3), 5)
        for t in trackers:
            check(t)
    return trackers, people


@pytest.mark.parametrize("seed", range(4))
def test_a_fleet_that_starts_from_nothing_finds_and_holds_all_people(seed):
    trackers, people = walk(seed)
    assert len({tuple(t.id for t in s.tracks) for s in trackers}) == 1
    means = np.array([t.belief.mean[:2] for t in trackers[0].tracks])
    assert len(means) == 4
    nearest = np.linalg.norm(people[:, None, :2] - means, axis=2)
    assert sorted(nearest.argmin(axis=1)) == [0, 1, 2, 3]


def refound(*companions: tuple[float, float]) -> list[int]:
    """Ids in the end where one UAV takes a person for new in the scan in which another takes up their lost track."""
    trackers = fleet(2, track(3, 0, 0, 0, 0))
    sharp, coarse = ([(3.0, 0.0), *companions], 0.01), ([(3.0, 0.0)], 0.2)
    for k in range(16):  # a second and more from when both see the person
        poses = [ABOVE if k >= 9 else AWAY, ABOVE if k >= 10 else AWAY]
        for u, (t, (points, variance)) in enumerate(zip(trackers, (sharp, coarse), strict=True)):
            seen = scan(k, *(points if poses[u] is ABOVE else []), uav=u, pose=poses[u])
            t.step(dataclasses.replace(seen, covariances=variance * np.tile(np.eye(2), (len(seen.measurements), 1, 1))))
        fuse(trackers, PAIR, 5)
    assert trackers[0].tracks[0].id == trackers[1].tracks[0].id
    return [t.id for t in trackers[0].tracks]


def test_a_reacquired_person_stays_one_beside_a_new_one():
    assert refound() == [3]
    old, new = refound((7.0, 0.0))
    assert old == 3 and new >= FIRST_NEW_ID
