"""Parts of a fleet that meet: whoever both know, or one knows twice, is one person in the end; two people stay two."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.graphs import exchange, graph
from helpers.meetings import NOW, told
from helpers.scenes import scan, track, tracker

from tracking.fusion.consensus import fuse


def met(first, second, kind: str) -> list[dict[int, float]]:
    """Where UAVs 0 and 1, who say the first, and 2 and 3, who say the second, take whom for in the end."""
    adjacency = graph(kind, 4)
    said = [told(u, *(first if u < 2 else second)) for u in range(4)]
    said = [replace(m, degree=int(row.sum())) for m, row in zip(said, adjacency, strict=True)]
    out = exchange(said, adjacency, 5)
    return [dict(zip(m.ids.tolist(), m.beliefs()[0][:, 0].tolist(), strict=True)) for m in out]


KINDS = pytest.mark.parametrize("kind", ["complete", "line"])
KEPT = [0.0], [0.05], [3], [901], [NOW]


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_a_track_that_strayed_ends_and_the_one_made_of_its_person_goes_by_its_name(kind, swapped):
    """One part followed somebody; the other lost them half a second ago and has met them again as a newcomer."""
    strayed = [1.5, 0.2], [0.3, 0.05], [3, 50], [903, 904], [NOW - 0.6, NOW]
    sides = (strayed, KEPT) if swapped else (KEPT, strayed)
    for held in met(*sides, kind):
        assert list(held) == [3]
        assert 0.0 < held[3] < 0.2  # the average of those who saw the person, without the one that strayed


@KINDS
def test_two_people_whom_one_part_sees_and_of_whom_the_other_knows_one_stay_two(kind):
    both = [1.5, 0.2], [0.3, 0.05], [3, 50], [903, 904], [NOW, NOW]
    for held in met(KEPT, both, kind):
        assert len(held) == 2 and 3 in held
        np.testing.assert_allclose(sorted(held.values()), [0.1, 1.5], atol=0.15)


@KINDS
def test_a_name_decides_between_tracks_that_fit_about_as_well(kind):
    pair = [-0.3, 0.3], [0.05, 0.05], [3, 4], [903, 904], [NOW, NOW]
    other = [0.05, 0.55], [0.05, 0.05], [3, 4], [901, 902], [NOW, NOW]
    for held in met(pair, other, kind):
        assert held == pytest.approx({3: -0.125, 4: 0.425}, abs=0.1)


def meeting(known, people, scans: int) -> list[list[int]]:
    """How many tracks two UAVs have after each scan, who see everybody and hear each other from the third on."""
    trackers = [tracker(t, uav=u) for u, t in enumerate(known)]
    counts = []
    for k in range(scans):
        for t, own in zip(trackers, people, strict=True):
            seen = own if k < 2 else sorted({tuple(p) for side in people for p in side})
            t.step(scan(k, *seen, uav=t.uav))
        fuse(trackers, np.eye(2, dtype=bool) if k < 2 else np.ones((2, 2), bool), 5)
        counts.append([len(t.tracks) for t in trackers])
    return counts


def test_two_tracks_of_one_person_whose_velocities_differ_are_one_a_scan_after_they_met():
    known = track(3, 0, 0, 1.5, 0, variance=0.1), track(4, 0, 0, -1.5, 0, variance=0.1)
    assert meeting(known, [[(0, 0)], [(0, 0)]], 6) == [[1, 1], [1, 1], [2, 2], [1, 1], [1, 1], [1, 1]]


def test_two_people_side_by_side_of_whom_each_knew_one_stay_two():
    known = track(3, 0, 0, 0, 0, variance=0.01), track(4, 1.2, 0, 0, 0, variance=0.01)
    assert meeting(known, [[(0, 0)], [(1.2, 0)]], 20) == [[1, 1]] * 2 + [[2, 2]] * 18


@pytest.mark.parametrize("swapped", [False, True])
def test_a_lost_track_whose_name_somebody_else_has_of_late_ends_though_that_one_goes_by_another(swapped):
    """One part follows 3 and has lost 5; that person is whom the other part calls 5."""
    sees = [0.0], [0.05], [5], [901], [NOW]
    lost = [0.1, 20.0], [0.05, 1.0], [3, 5], [903, 0], [NOW, NOW - 3.0]
    for held in met(*((lost, sees) if swapped else (sees, lost)), "complete"):
        assert held == pytest.approx({3: 0.05}, abs=0.02)


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_of_two_who_were_taken_for_each_other_the_lost_one_is_kept(kind, swapped):
    """One part calls 5 whom the other calls 3, and each has lost its other one, who is the same person, too."""
    first = [0.0, 20.5], [0.05, 1.0], [3, 5], [901, 0], [NOW, NOW - 3.0]
    second = [20.0, 0.2], [1.0, 0.05], [3, 5], [0, 903], [NOW - 2.0, NOW]
    for held in met(*((second, first) if swapped else (first, second)), kind):
        assert held == pytest.approx({3: 0.1, 5: 20.25}, abs=0.15)


@pytest.mark.parametrize("swapped", [False, True])
def test_names_that_cross_say_as_much_as_common_ones(swapped):
    """As above, but both parts' 5 agree, too, and are the likelier pair by 2 in twice a log-likelihood."""
    first = [0.0, 2.0], [0.05, 1.0], [3, 5], [901, 0], [NOW, NOW - 3.0]
    second = [4.0, 1.1], [1.0, 0.05], [3, 5], [0, 903], [NOW - 2.0, NOW]
    for held in met(*((second, first) if swapped else (first, second)), "complete"):
        assert held == pytest.approx({3: 0.55, 5: 3.0}, abs=0.6)


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_who_is_seen_elsewhere_does_not_come_between_lost_ones_rightly_named(kind, swapped):
    """One part sees 5; where the other believes 5 to be, the first has lost 7, whom the other has lost nearby."""
    first = [0.0, 20.0, 26.0], [0.05, 1.0, 1.0], [5, 7, 8], [901, 0, 0], [NOW, NOW - 3.0, NOW - 3.0]
    second = [18.0, 22.5], [1.0, 1.0], [5, 7], [0, 0], [NOW - 2.0, NOW - 2.0]
    for held in met(*((second, first) if swapped else (first, second)), kind):
        assert held == pytest.approx({5: 0.0, 7: 21.25, 8: 26.0}, abs=0.7)


@KINDS
def test_two_whom_both_parts_have_lost_under_each_others_name_stay_apart(kind):
    held = met(
        ([0.0, 20.0], [1.0, 1.0], [3, 5], [0, 0], [NOW] * 2), ([20.0, 0.0], [1.0, 1.0], [3, 5], [0, 0], [NOW] * 2), kind
    )
    for places in held:
        np.testing.assert_allclose(sorted(places.values()), [0.0, 20.0], atol=1e-6)


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_of_whom_all_have_lost_the_last_to_see_them_tell(kind, swapped):
    """However much the others weigh: they have looked where the person is not, and know no better for it."""
    last, before = ([2.0], [0.3], [3], [0], [NOW - 1.2]), ([0.0], [4.0], [3], [0], [NOW - 4.0])
    adjacency, said = graph(kind, 4), []
    for u in range(4):
        part = last if (u < 2) ^ swapped else before
        sighting, weight = np.array([(part[0][0], 0.0, part[-1][0])]), 1.0 if part is last else 1e5
        m = told(u, *part)
        said.append(replace(m, degree=int(adjacency[u].sum()), sightings=sighting, shares=weight * m.shares))
    for m in exchange(said, adjacency, 5):
        assert m.ids.tolist() == [3]
        assert m.beliefs()[0][0, 0] == pytest.approx(2.0, abs=0.01)


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_a_name_that_both_parts_have_lost_keeps_no_track_from_whom_it_fits(kind, swapped):
    """Both have lost 5, one of them hardly knows where. Where the other lost it, the first sees 3."""
    first = [0.0, 90.0], [0.05, 100.0], [3, 5], [901, 0], [NOW, NOW - 3.0]
    second = [40.0, 0.5], [1.0, 1.0], [3, 5], [0, 0], [NOW - 3.0, NOW - 2.0]
    for held in met(*((second, first) if swapped else (first, second)), kind):
        assert [place for place in held.values() if abs(place) < 5.0] == pytest.approx([0.25], abs=0.25)


def test_a_name_without_alias_is_no_sign_that_two_companies_mean_the_same():
    """UAVs 0 and 2 take each other's 3 and 4 for the other, and 2 has just met again whom it had lost."""
    lost = [0.0, 20.0], [1.0, 1.0], [3, 4], [0, 0], [NOW, NOW]
    sees = [0.1, 20.1], [0.05, 0.05], [3, 4], [901, 902], [NOW, NOW]
    other = [20.2, 0.2], [0.05, 0.05], [3, 4], [903, 0], [NOW, NOW]
    said = [replace(told(u, *part), degree=2, company=(u, NOW)) for u, part in enumerate([lost, sees, other])]
    for m in exchange(said, graph("complete", 3), 5):
        assert m.ids.tolist() == [3, 4]
        np.testing.assert_allclose(m.beliefs()[0][:, 0], [0.1, 20.1], atol=0.1)


@KINDS
@pytest.mark.parametrize("swapped", [False, True])
def test_the_name_of_a_lost_track_does_not_outweigh_a_newcomer_who_fits_better(kind, swapped):
    """The newcomer is likelier by 1.9 in twice a log-likelihood, which is less than a common name is worth."""
    again = [0.0, 0.3], [0.15, 0.05], [3, 50], [0, 904], [NOW - 3.0, NOW]
    for held in met(*((again, KEPT) if swapped else (KEPT, again)), kind):
        assert held == pytest.approx({3: 0.15}, abs=0.1)


def test_who_hears_the_same_decides_the_same():
    rng = np.random.default_rng(0)
    adjacency = graph("complete", 4)
    for _ in range(40):
        said = []
        for u in range(4):
            ids = np.sort(rng.choice(6, 3, replace=False))
            late = rng.random(3) < 0.7
            seen = np.where(late, NOW, NOW - 3.0)
            part = rng.normal(scale=1.5, size=3), rng.uniform(0.05, 1.0, 3), ids, late * (900 + 10 * u + ids), seen
            said.append(replace(told(u, *part), degree=3, company=(u, NOW)))
        assert len({m.called for m in exchange(said, adjacency, 1)}) == 1


@pytest.mark.parametrize("first", [0, 1])
def test_what_others_lost_does_not_stand_between_two_who_see_the_person(first):
    """UAVs 1 and 2 lost the person; 0 never did, and 3 has met them again as a newcomer."""
    sees = [0.0], [0.05], [3], [901], [NOW]
    lost = [20.0], [1.0], [3], [0], [NOW - 3.0]
    again = [20.0, 0.2], [1.0, 0.05], [3, 50], [0, 904], [NOW - 3.0, NOW]
    parts = [sees, lost, lost, again] if first == 0 else [lost, again, lost, sees]
    said = []
    for u, part in enumerate(parts):
        sightings = np.array([(0.0, 0.0, seen) for seen in part[-1]])
        said.append(replace(told(u, *part), degree=3, company=(u, NOW), sightings=sightings))
    for m in exchange(said, graph("complete", 4), 5):
        assert m.ids.tolist() == [3]
        assert 0.0 < m.beliefs()[0][0, 0] < 0.2


def test_of_two_tracks_in_reach_the_likelier_matches_not_the_wider():
    """The wide one is nearer in its own standard deviations, the other is the likelier."""
    vague = [4.0, 0.6], [9.0, 0.05], [60, 61], [0, 905], [NOW - 3.0, NOW]
    for m in met(([0.0], [0.05], [40], [901], [NOW]), vague, "complete"):
        assert len(m) == 2 and m[40] == pytest.approx(0.3, abs=0.05)
