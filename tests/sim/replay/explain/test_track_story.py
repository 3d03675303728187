"""The story of a track: against the trackers' own tentative tracks, the association, and a mission made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.flights import IDEAL, recorded
from helpers.identities import FALSE, swapping
from helpers.recordings import broken
from msgspec import structs
from sim.replay.explain.association import Association

from sim.evaluation.score import held_by
from sim.recording.archive import save
from sim.replay.explain.explanation import explanation
from sim.replay.explain.observation import Observer
from sim.replay.explain.person import PersonFacts
from sim.replay.explain.track_story import TrackFacts, track_story
from sim.replay.flight import Flight
from sim.scenario.scenario import resolved
from tracking.metrics.ospa import ospa
from tracking.parameters import EXPECTED, SEEN


@pytest.fixture(scope="module")
def mission():
    """A recording in which false alarms become tracks, an observer, and tentative tracks in flight."""
    tentative = []

    def see(mission):
        # Scans so far and place of each tentative track of each UAV.
        fleet = mission._knowledge._trackers
        tentative.append([[(t.scans, t.belief.mean[:2]) for t in tracker._tentative] for tracker in fleet])

    options = ("sensing.false_alarms=0.3", "tracking.initial_tracks=none", "trees.density=45")
    paper = ("tracking.motion=ncv", "tracking.sigma_a=0.6", "tracking.max_variance=400")
    recording = recorded(*IDEAL, *options, *paper, seed=3, duration=20, see=see)
    with Observer(Flight(recording)) as observer:
        yield recording, observer, tentative


def test_tracks_are_born_from_the_measurements_that_their_trackers_had(mission):
    recording, observer, tentative = mission
    false = 0
    for id_, number in recording.track_numbers.items():
        facts = TrackFacts(observer, number)
        k, (uav,) = facts.scans[0], facts.makers
        (track,) = (t for t in recording.tracks_at(k, uav) if t.id == id_)
        scans, _ = min(tentative[k - 1][uav], key=lambda t: np.hypot(*(t[1] - track.belief.mean[:2])))
        first, last = facts.origins[0], facts.origins[-1]
        assert (first.k, last.k) == (k - scans, k)
        for origin in facts.origins:
            np.testing.assert_array_equal(
                origin.place, recording.scan_at(origin.k, uav).measurements[origin.measurement]
            )
            assert observer.owners(origin.k, uav)[origin.measurement] == origin.person
        false += first.person < 0
    assert len(recording.track_numbers) >= 6 and false >= 2


def test_errors_in_flight_are_those_of_reported_tracks(mission):
    recording = mission[0]
    assert not recording.reported.all()
    told = held_by(recording, 0).means[..., :2]
    for k, places in enumerate(told):
        error = ospa(places[~np.isnan(places[:, 0])], recording.people[k])
        np.testing.assert_array_equal(recording.ospa[k, 0], error)


def test_the_story_says_when_a_track_was_not_reported(mission):
    recording, observer, _ = mission
    id_ = recording.track_ids[~recording.reported][0]
    facts = TrackFacts(observer, recording.track_numbers[id_])
    scans, _ = recording.cells(recording.track_offsets)
    own = np.unique(scans[~recording.reported & (recording.track_ids == id_)])  # on all UAVs alike
    (line,) = [line for line in dict(track_story(facts))["kept"] if "reported" in line]
    first, last = recording.times[own[[0, -1]] + [0, 1]]
    assert line.startswith(f"not reported in {len(own)} scans, {first:.1f} to {last:.1f} s")


def test_a_track_is_fed_by_what_its_trackers_counted_as_detections(mission):
    recording, observer, _ = mission
    id_ = next(iter(recording.track_numbers))
    facts, count = TrackFacts(observer, 0), 0
    for detection in facts.detections:
        a = Association.of(recording, detection.k, detection.uav)
        weights = a.beta[a.ids.tolist().index(id_), 1:]
        assert detection.weight in weights[weights >= SEEN]
        assert detection.person < 0 or recording.matched[detection.k, detection.uav, detection.person]
        count += detection.person >= 0
    assert count > 10 and len(facts.observations) > len(facts.detections)


def test_the_story_of_a_false_track_has_birth_feeds_reason_and_end(mission):
    recording, observer, _ = mission
    every = (TrackFacts(observer, number) for number in recording.track_numbers.values())
    facts = next(facts for facts in every if all(origin.person < 0 for origin in facts.origins))
    groups, begun = dict(track_story(facts)), facts.origins[0]
    assert list(groups)[1:] == ["born", "fed by", "kept", "ended"]
    assert f"track {facts.number} stands for no person" in groups[f"track {facts.number}"][1]
    x, y = begun.place
    place, time = f"({x:.1f}, {y:.1f}) m", f"{recording.times[begun.k]:.1f} s"
    assert groups["born"][0] == f"at {time} from a false alarm at {place}, measured by UAV {begun.uav}"
    confirmed = f"{recording.times[facts.scans[0]]:.1f} s by UAV {begun.uav}"
    assert groups["born"][-1] == f"confirmed at {confirmed}"
    assert "that should have shown it; existence " in groups["kept"][0]


def test_the_end_of_a_track_stands_beside_the_limits_of_its_tracker(mission):
    recording, observer, _ = mission
    events = Flight(recording).events
    ended = [event for event in events if event.kind == "track deleted"]
    for event in ended:
        facts = TrackFacts(observer, event.track)
        lines = dict(track_story(facts))["ended"]
        existence, variance = (float(line.split()[1]) for line in lines[1:3])
        assert lines[0] == f"deleted at {event.time:.1f} s"
        assert "a track is deleted below 0.001" in lines[1] and "a track is deleted beyond 400 m²" in lines[2]
        assert existence < 0.1 or variance > 390.0
    assert len(ended) >= 2


def test_a_track_whose_uavs_broke_down_was_not_deleted():
    recording = recorded(*IDEAL, "uavs=[{start=[-28,-14],fails_at=0.9}]", duration=2)
    with Observer(Flight(recording)) as observer:
        story = dict(track_story(TrackFacts(observer, 0)))
    assert story["ended"] == ["ended at 1.0 s, as UAV 0 broke down"]


def test_a_track_that_a_uav_ends_as_another_breaks_down_was_deleted():
    recording = recorded(*IDEAL, duration=2)
    offsets, uavs = recording.track_offsets, recording.poses.shape[1]
    last = 4
    kept = np.ones(len(recording.track_ids), dtype=np.bool_)
    kept[offsets[(last + 1) * uavs] :] = recording.track_ids[offsets[(last + 1) * uavs] :] != 0
    rows = np.concatenate([[0], np.cumsum(kept)])[offsets]
    names = ("track_ids", "track_means", "track_covariances", "track_existence", "track_sightings")
    tables = {name: getattr(recording, name)[kept] for name in names}
    ended = broken(replace(recording, track_offsets=rows, **tables), 0, last + 1)
    with Observer(Flight(ended)) as observer:
        story = dict(track_story(TrackFacts(observer, 0)))
    assert story["ended"][0] == "deleted at 1.0 s"


def test_misses_of_a_false_track_are_frames_that_should_have_shown_it(mission):
    recording, observer, _ = mission
    counted = 0
    for event in (e for e in observer.flight.events if e.kind == "false track"):
        id_ = list(recording.track_numbers)[event.track]
        found = [Association.of(recording, k, i) for k in range(event.first, event.last + 1) for i in range(3)]
        rows = [(a, a.ids.tolist().index(id_)) for a in found if id_ in a.ids]
        without = [float(a.before.visible[t]) for a, t in rows if a.beta[t, 0] > 1.0 - SEEN]
        missed = sum(visible >= EXPECTED for visible in without)
        (line,) = (n for n in dict(track_story(TrackFacts(observer, event.track)))["kept"] if n.startswith(event.when))
        assert f"missed in {missed} that should have shown it" in line
        counted += missed < len(without)
    assert counted > 0


def test_the_story_of_an_outside_trackers_track_quotes_no_built_in_limits(mission):
    setting = mission[0].setting
    outside = structs.replace(setting, tracking=structs.replace(setting.tracking, tracker="soup:Jpda"))
    recording = replace(mission[0], scenario=resolved(outside))
    with Observer(Flight(recording)) as observer:
        for number in recording.track_numbers.values():
            groups = dict(track_story(TrackFacts(observer, number)))
            lines = [line for group in groups.values() for line in group]
            assert groups["note"][0].startswith("soup:Jpda does not tell its associations")
            assert not any("a track ends" in line or "its gate" in line for line in lines)
        facts = PersonFacts.of(observer, 4, 0)
        assert dict(explanation(facts))["note"] == groups["note"]


def test_a_mission_without_measurements_has_stories_too(tmp_path, call, refused):
    recording = swapping()
    with Observer(Flight(recording)) as observer:
        false = TrackFacts(observer, 2)
        assert (false.scans, false.known, false.makers) == (FALSE, False, (0, 1, 2))
        assert TrackFacts(observer, 0).known
    save(recording, tmp_path / "mission.npz")
    code, out, _ = call("explain", "mission.npz", "--track", "0")
    assert code == 0 and "  known at the start\n" in out and "still there at the end of the mission" in out
    assert "--track: '4' is not allowed" in refused("explain", "mission.npz", "--track", "4")
    for other in (("--time", "1"), ("--target", "0"), ("--out", "a.png")):
        told = refused("explain", "mission.npz", "--track", "0", *other)
        assert f"{other[0]}: '{other[1]}' is not allowed with --track" in told
