"""False tracks and duplicates: by hand, against CLEAR MOT and GOSPA, and as metrics count them."""

import dataclasses

import numpy as np
import pytest
from helpers.identities import DUPLICATE, FALSE, SCANS, at_random, standing_still, swapping
from helpers.summaries import shown, summary

from sim.facts.flight import Flight
from sim.facts.metrics.holding import FAR, find_holding
from sim.facts.metrics.score import find_reported_tracks
from sim.facts.metrics.unmatched import find_unmatched_tracks
from tracking.metrics.clearmot import find_correspondence
from tracking.metrics.ospa import gospa

YOUNG = 6  # scans in the first second of a track, both ends included


def alone(recording):
    """Number of tracks (K, n) that stand for no person."""
    found = np.zeros(recording.working.shape, dtype=int)
    for track in find_unmatched_tracks(recording):
        found[track.first : track.last + 1] += track.alone
    return found


def test_false_tracks_and_duplicates_are_those_made_by_hand():
    found = {track.id: track for track in find_unmatched_tracks(swapping())}
    assert sorted(found) == [90, 95]
    assert (found[90].first, found[90].last, found[90].duplicate, found[90].nearest) == (*FALSE, False, 0)
    assert found[90].gap == 50.0
    assert (found[95].first, found[95].last, found[95].duplicate, found[95].nearest) == (*DUPLICATE, True, 1)
    assert found[95].gap == pytest.approx(0.6) and found[95].alone.all()


@pytest.mark.parametrize("seed", range(20))
def test_tracks_are_matched_near_or_unmatched_as_gospa_and_clear_mot_say(seed):
    recording = at_random(seed)
    counts = alone(recording)
    for i in range(2):
        held = find_reported_tracks(recording, i)
        stand = find_holding(recording).tracks[:, i]
        matched = find_correspondence(held.means[:, :, :2], recording.people, 1.0)
        np.testing.assert_array_equal(stand >= 0, matched >= 0)
        rest = held.means[:, :, :2].copy()
        rest[(held.ids == stand[:, :, None]).any(axis=1)] = np.nan
        near = find_correspondence(rest, np.where((stand >= 0)[:, :, None], np.nan, recording.people), FAR)
        there = np.count_nonzero(~np.isnan(held.means[:, :, 0]), axis=1)
        np.testing.assert_array_equal(there, (stand >= 0).sum(axis=1) + (near >= 0).sum(axis=1) + counts[:, i])
    for k, i in np.ndindex(counts.shape):
        tracks = np.array([t.belief.mean[:2] for t in recording.tracks_at(k, i)]).reshape(-1, 2)
        people = recording.people[k][~np.isnan(recording.people[k, :, 0])]
        assert counts[k, i] == round(gospa(tracks, people, FAR)[3] ** 2 / (FAR**2 / 2))
    found = [event for event in Flight(recording).events if event.kind == "identity switch"]
    for i, row in enumerate(summary(recording)["uavs"]):
        assert row["switches"] == sum(i in event.uavs for event in found)
    assert found


def test_metrics_count_events_and_the_share_of_scans_and_working_uavs():
    result = summary(swapping())
    shares = (15 / SCANS, 10 / SCANS)
    assert result["tracks"] == {
        "false": 1,
        "false_share": pytest.approx(shares[0]),
        "false_old_share": pytest.approx(shares[0] - YOUNG / SCANS),
        "duplicate": 1,
        "duplicate_share": pytest.approx(shares[1]),
        "duplicate_old_share": pytest.approx(shares[1] - YOUNG / SCANS),
    }
    text = " ".join(shown(result).split())
    assert "false tracks │ 1, 48.4 % of scans" in text and "duplicate tracks │ 1, 32.3 % of scans" in text
    assert result["identity"]["switches"] == 2
    ospa = np.ones((SCANS, 3, 3))
    ospa[FALSE[0] :, 0] = np.nan  # broken down before the false track begins
    result = summary(swapping(ospa=ospa))["tracks"]
    assert result["false_share"] == pytest.approx(2 * 15 / (2 * SCANS + FALSE[0]))
    none = summary(dataclasses.replace(standing_still([[{}]]), ospa=np.full((1, 1, 3), np.nan)))["tracks"]
    shares = dict.fromkeys(f"{what}_{share}" for what in ("false", "duplicate") for share in ("share", "old_share"))
    assert none == {"false": 0, "duplicate": 0} | shares


def test_a_false_track_is_old_by_the_time_since_it_began():
    scans, leaves = 15, 3
    tracks = [[{70: (0.0 if k < leaves else -40.0, 0.0), 80: (20.0, 0.0)}] for k in range(scans)]
    result = summary(dataclasses.replace(standing_still(tracks), ospa=np.ones((scans, 1, 3))))["tracks"]
    assert result["false_share"] == pytest.approx((scans - leaves) / scans)
    assert result["false_old_share"] == pytest.approx((scans - YOUNG) / scans)


def test_a_duplicate_is_so_by_its_median_distance_where_the_first_uav_has_it():
    """Track 90 beside a person with track 70: at one of five scans 9 m off, and to the second UAV alone."""

    def found(usual, once):
        scans = [[{70: (0.0, 0.0)}, {70: (0.0, 0.0), 90: (once if k == 2 else usual, 0.0)}] for k in range(5)]
        (track,) = find_unmatched_tracks(standing_still(scans, np.zeros((1, 2))))
        return track

    near, far = found(0.9, 9.0), found(9.0, 0.9)
    assert (near.duplicate, near.gap, near.nearest) == (True, 0.9, 0)
    assert (far.duplicate, far.gap, far.nearest) == (False, 9.0, 0)


def test_a_false_track_tells_that_its_person_left():
    recording = standing_still([[{70: (0.0, 0.0), 80: (20.0, 0.0)}]] * 12, np.array([[0.0, 0.0], [20.0, 0.0]]))
    recording.people[6:, 1] = np.nan
    (track,) = find_unmatched_tracks(recording)
    assert (track.id, track.first, track.last, track.left) == (80, 6, 11, 1)
    (event,) = (e for e in Flight(recording).events if e.kind == "false track")
    assert "after its person 1 left" in event.why
    assert all(track.left is None for track in find_unmatched_tracks(swapping()))
