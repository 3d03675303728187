"""Track-to-track association where partitions of a fleet meet: one track per person in the end."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.graphs import NOW, exchange, graph, told
from helpers.scenes import scan, track, tracker

from tracking.fusion.consensus import fuse
from tracking.fusion.mixing import stack_messages
from tracking.fusion.track_association import associate_tracks

KINDS = pytest.mark.parametrize("kind", ["complete", "line"])
KEPT = [0.0], [0.05], [3], [NOW]


def met(first, second, kind: str) -> list[dict[int, float]]:
    """Final positions by id on each UAV, if UAVs 0 and 1 start with the first tracks, and 2 and 3 with the second."""
    adjacency = graph(kind, 4)
    said = [told(u, *(first if u < 2 else second)) for u in range(4)]
    said = [replace(m, degree=int(row.sum())) for m, row in zip(said, adjacency, strict=True)]
    out = exchange(said, adjacency, 5)
    return [dict(zip(m.ids.tolist(), m.beliefs[0][:, 0].tolist(), strict=True)) for m in out]


# Two partitions' places [m] of their tracks, variances, ids and last detections; places of the tracks that all hold
# in the end, by id where it is certain; and how exactly.
MEETINGS = {
    # One partition followed a person; the other lost the person half a second ago. The average is of those that saw it.
    "a strayed track is deleted, and its person's new track takes the id": (
        KEPT,
        ([1.5, 0.2], [0.3, 0.05], [3, 50], [NOW - 0.6, NOW]),
        ({3: 0.1}, 0.1),
    ),
    "two people stay two where one partition knows only one": (
        KEPT,
        ([1.5, 0.2], [0.3, 0.05], [3, 50], [NOW, NOW]),
        ([0.1, 1.5], 0.15),
    ),
    "a common id decides between tracks of about equal distance": (
        ([-0.3, 0.3], [0.05, 0.05], [3, 4], [NOW, NOW]),
        ([0.05, 0.55], [0.05, 0.05], [3, 4], [NOW, NOW]),
        ({3: -0.125, 4: 0.425}, 0.1),
    ),
    # Of two people 0.1 m apart errors make the others' ids the likelier ones: ids know more than this scan does.
    "a common id outweighs beliefs that prefer an exchange a little": (
        ([-0.1, 0.1], [0.05, 0.05], [3, 4], [NOW, NOW]),
        ([0.12, -0.05], [0.05, 0.05], [3, 4], [NOW, NOW]),
        ({3: 0.01, 4: 0.025}, 0.05),
    ),
    # The newcomer is likelier by 1.9 in twice a log-likelihood, which is less than a common name is worth.
    "a lost track's id does not outweigh a nearer new track": (
        KEPT,
        ([0.0, 0.3], [0.15, 0.05], [3, 50], [NOW - 3.0, NOW]),
        ({3: 0.15}, 0.1),
    ),
    # One partition's 5 is the other's 3, and each has lost its other track, also of one person.
    "of two people with exchanged ids the lost one is kept as last seen": (
        ([0.0, 20.5], [0.05, 1.0], [3, 5], [NOW, NOW - 3.0]),
        ([20.0, 0.2], [1.0, 0.05], [3, 5], [NOW - 2.0, NOW]),
        ([0.1, 20.0], 0.1),
    ),
    # One partition sees 5. At the other's belief of 5 it has lost 7, which the other has lost nearby.
    "a track in view elsewhere does not match a lost one": (
        ([0.0, 6.5, 16.0], [0.05, 1.0, 1.0], [5, 7, 8], [NOW, NOW - 3.0, NOW - 3.0]),
        ([6.0, 8.0], [1.0, 1.0], [5, 7], [NOW - 2.0, NOW - 2.0]),
        ({5: 0.0, 7: 8.0, 8: 16.0}, 0.1),
    ),
    "two lost people with exchanged ids stay two": (
        ([0.0, 20.0], [1.0, 1.0], [3, 5], [NOW, NOW]),
        ([20.0, 0.0], [1.0, 1.0], [3, 5], [NOW, NOW]),
        ([0.0, 20.0], 1e-6),
    ),
}


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("case", MEETINGS)
def test_where_two_partitions_meet_each_person_has_one_track(case, swapped, kind):
    first, second, (expected, error) = MEETINGS[case]
    for held in met(*((second, first) if swapped else (first, second)), kind):
        assert (held if isinstance(expected, dict) else sorted(held.values())) == pytest.approx(expected, abs=error)
        assert set(held) >= set(first[2]) & set(second[2])


@pytest.mark.parametrize("swapped", [False, True])
def test_a_lost_track_is_deleted_if_its_id_is_seen_elsewhere(swapped):
    """One partition follows 3 and has lost 5; its person 3 is the other partition's 5."""
    sees = [0.0], [0.05], [5], [NOW]
    lost = [0.1, 8.0], [0.05, 1.0], [3, 5], [NOW, NOW - 3.0]
    for held in met(*((lost, sees) if swapped else (sees, lost)), "complete"):
        assert held == pytest.approx({3: 0.05}, abs=0.02)


@pytest.mark.parametrize("swapped", [False, True])
def test_all_pairs_of_two_partitions_are_weighed_together(swapped):
    """Of two people with exchanged ids each partition has lost one; both parts' 5 are the likeliest pair of all."""
    first = [0.0, 2.0], [0.05, 1.0], [3, 5], [NOW, NOW - 3.0]
    second = [4.0, 1.1], [1.0, 0.05], [3, 5], [NOW - 2.0, NOW]
    for held in met(*((second, first) if swapped else (first, second)), "complete"):
        np.testing.assert_allclose(sorted(held.values()), [0.55, 4.0], atol=0.1)


def meeting(known, people, scans: int) -> list[list[int]]:
    """Numbers of tracks of two UAVs after each scan; from the third on they see all people and hear each other."""
    trackers = [tracker(t, uav=u) for u, t in enumerate(known)]
    counts = []
    for k in range(scans):
        for t, own in zip(trackers, people, strict=True):
            seen = own if k < 2 else sorted({tuple(p) for side in people for p in side})
            t.step(scan(k, *seen, uav=t.uav))
        fuse(trackers, np.eye(2, dtype=bool) if k < 2 else np.ones((2, 2), bool), 5)
        counts.append([len(t.tracks) for t in trackers])
    return counts


@pytest.mark.parametrize("speed", [0.8, 2.5])
def test_two_tracks_of_one_person_become_one_within_a_second(speed):
    """Tracks of opposite velocities, of which the faster ones do not agree when the two partitions meet."""
    known = track(3, 0, 0, speed, 0, variance=0.05), track(4, 0, 0, -speed, 0, variance=0.05)
    counts = meeting(known, [[(0, 0)], [(0, 0)]], 12)
    assert counts[:3] == [[1, 1]] * 2 + [[1 + (speed > 2)] * 2] and counts[7:] == [[1, 1]] * 5


def test_two_people_side_by_side_known_to_one_partition_each_stay_two():
    known = track(3, 0, 0, 0, 0, variance=0.01), track(4, 1.2, 0, 0, 0, variance=0.01)
    assert meeting(known, [[(0, 0)], [(1.2, 0)]], 20) == [[1, 1]] * 2 + [[2, 2]] * 18


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_the_last_detection_decides_on_a_person_lost_by_all(kind, swapped):
    """However much the others weigh: they have looked where the person is not, and know no better for it."""
    last, before = ([2.0], [0.3], [3], [NOW - 1.2]), ([0.0], [4.0], [3], [NOW - 4.0])
    adjacency, said = graph(kind, 4), []
    for u in range(4):
        part = last if (u < 2) ^ swapped else before
        sighting, weight = np.array([(part[0][0], 0.0, part[-1][0])]), 1.0 if part is last else 1e5
        m = told(u, *part)
        said.append(replace(m, degree=int(adjacency[u].sum()), sightings=sighting, shares=weight * m.shares))
    for m in exchange(said, adjacency, 5):
        assert m.ids.tolist() == [3] and m.beliefs[0][0, 0] == pytest.approx(2.0, abs=0.01)


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_a_lost_common_id_keeps_no_track_from_its_match(kind, swapped):
    """Both have lost 5, one of them hardly knows where. Where the other lost it, the first sees 3."""
    first = [0.0, 90.0], [0.05, 100.0], [3, 5], [NOW, NOW - 3.0]
    second = [40.0, 0.5], [1.0, 1.0], [3, 5], [NOW - 3.0, NOW - 2.0]
    for held in met(*((second, first) if swapped else (first, second)), kind):
        assert [place for place in held.values() if abs(place) < 5.0] == pytest.approx([0.25], abs=0.25)


def test_exchanged_ids_of_three_partitions_match_by_beliefs():
    """UAVs 0 and 2 have 3 and 4 exchanged, and 2 has just re-acquired a person."""
    lost = [0.0, 20.0], [1.0, 1.0], [3, 4], [NOW, NOW]
    sees = [0.1, 20.1], [0.05, 0.05], [3, 4], [NOW, NOW]
    other = [20.2, 0.2], [0.05, 0.05], [3, 4], [NOW, NOW]
    said = [replace(told(u, *part, partition=(u, NOW)), degree=2) for u, part in enumerate([lost, sees, other])]
    for m in exchange(said, graph("complete", 3), 5):
        assert m.ids.tolist() == [3, 4]
        np.testing.assert_allclose(m.beliefs[0][:, 0], [0.1, 20.1], atol=0.1)


def test_uavs_that_hear_the_same_decide_the_same():
    rng = np.random.default_rng(0)
    adjacency = graph("complete", 4)
    for _ in range(40):
        said = []
        for u in range(4):
            ids = np.sort(rng.choice(6, 3, replace=False))
            late = rng.random(3) < 0.7
            seen = np.where(late, NOW, NOW - 3.0)
            part = rng.normal(scale=1.5, size=3), rng.uniform(0.05, 1.0, 3), ids, seen
            said.append(replace(told(u, *part, partition=(u, NOW)), degree=3))
        assert len({m.ids.tobytes() for m in exchange(said, adjacency, 1)}) == 1


@pytest.mark.parametrize("first", [0, 1])
def test_a_lost_track_does_not_separate_two_tracks_in_view(first):
    """UAVs 1 and 2 lost the person; 0 never did, and 3 has met them again as a newcomer."""
    sees = [0.0], [0.05], [3], [NOW]
    lost = [20.0], [1.0], [3], [NOW - 3.0]
    again = [20.0, 0.2], [1.0, 0.05], [3, 50], [NOW - 3.0, NOW]
    parts = [sees, lost, lost, again] if first == 0 else [lost, again, lost, sees]
    said = []
    for u, part in enumerate(parts):
        sightings = np.array([(0.0, 0.0, seen) for seen in part[-1]])
        said.append(replace(told(u, *part, partition=(u, NOW), sightings=sightings), degree=3))
    for m in exchange(said, graph("complete", 4), 5):
        assert m.ids.tolist() == [3] and 0.0 < m.beliefs[0][0, 0] < 0.2


def test_of_two_tracks_in_reach_the_likelier_matches_not_the_wider():
    """The wide one is nearer in its own standard deviations, the other is the likelier."""
    vague = [4.0, 0.6], [9.0, 0.05], [60, 61], [NOW - 3.0, NOW]
    for m in met(([0.0], [0.05], [40], [NOW]), vague, "complete"):
        assert len(m) == 2 and m[40] == pytest.approx(0.3, abs=0.05)


def test_a_person_in_view_is_kept_though_a_third_partition_lost_the_track():
    """Another person of that id, seen later than the lost track and within its reach, ends no track in view."""
    parts = ([0.0], [0.05], [3], [NOW]), ([0.1], [1.0], [3], [NOW - 3.0]), ([5.0], [0.05], [3], [NOW])
    said = [replace(told(u, *part, partition=(u, NOW)), degree=2) for u, part in enumerate(parts)]
    for m in exchange(said, graph("complete", 3), 5):
        assert m.beliefs[0][:, 0] == pytest.approx([0.0, 5.0], abs=0.1)


def test_a_fresh_id_does_not_depend_on_which_partitions_a_uav_hears():
    """UAVs 2 and 3 hear of other people by the ids 3 and 4, the one of both, the other of 4 alone."""
    own = [told(u, [0.0, 20.0], [0.05, 0.05], [3, 4], [NOW, NOW]) for u in (2, 3)]
    both, one = (told(0, [50.0, 70.0][-n:], [0.05] * n, [3, 4][-n:], [NOW] * n) for n in (2, 1))
    fresh = []
    for m, other in zip(own, (both, one), strict=True):
        pair = sorted([m, other], key=lambda message: message.uav)
        joint = associate_tracks(stack_messages(pair), [0, 1], [(), ()], (m.scan, m.time), 3.0)
        rows = joint.rows[pair.index(m)]
        held, places = rows >= 0, m.beliefs.means[rows, 0].round(3)
        fresh.append(dict(zip(places[held].tolist(), joint.ids[held].tolist(), strict=True)))
    assert fresh[0][20.0] == fresh[1][20.0] and fresh[0][0.0] != fresh[0][20.0]


@pytest.mark.parametrize("until", [(NOW - 3.0, NOW - 1.0), (NOW - 1.0, NOW - 3.0)])
def test_of_two_deletions_of_a_track_the_later_one_counts(until):
    """UAV 0 detected the person between the times at which UAVs 1 and 2 deleted the track."""
    holder = told(0, [0.0], [0.05], [5], [NOW - 2.0])
    empty = [told(u + 1, [], [], [], [], deleted=((5, time),)) for u, time in enumerate(until)]
    for m in exchange([replace(m, degree=2) for m in (holder, *empty)], graph("complete", 3), 2):
        assert m.ids.tolist() == [] and m.deleted == ((5, NOW - 1.0),)


@pytest.mark.parametrize(("place", "held"), [(12.9, [12.9]), (13.8, [3.9, 13.8])])
def test_a_lost_track_ends_only_within_reach_of_all_its_sightings(place, held):
    """UAVs 0 and 1 lost person 3 one after the other. In 4 s at 3 m/s, with 1 m of margin, people come 13 m far."""
    parts = ([0.0, place], [1.0, 0.05], [3, 7], [NOW - 4.0, NOW]), ([3.9], [1.0], [3], [NOW - 3.0])
    said = [told(u, *part, partition=(u, NOW)) for u, part in enumerate((*parts, ([place], [0.05], [3], [NOW])))]
    for m in exchange([replace(m, degree=2) for m in said], graph("complete", 3), 5):
        assert sorted(m.beliefs[0][:, 0]) == pytest.approx(held, abs=0.1)


def test_a_track_is_joined_by_its_latest_version_in_a_partition():
    """UAV 0 missed a message in which its partition took up person 3 again, a newcomer to UAV 2."""
    parts = ([0.0], [1.0], [3], [NOW - 2.0]), ([20.0], [0.05], [3], [NOW]), ([20.1], [0.05], [50], [NOW])
    for m in exchange([replace(told(u, *part), degree=2) for u, part in enumerate(parts)], graph("complete", 3), 5):
        assert m.ids.tolist() == [3] and m.beliefs[0][0, 0] == pytest.approx(20.05, abs=0.06)
