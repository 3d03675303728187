"""The story of a track: against what its trackers tell, and for a mission made by hand."""

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.flights import IDEAL, recorded
from helpers.identities import FALSE, swapping
from msgspec import structs

from sim.facts.explain.explanation import explain_person
from sim.facts.explain.observation import Observer
from sim.facts.explain.person import make_person_facts
from sim.facts.explain.track_story import TrackFacts, tell_track_story
from sim.facts.flight import Flight
from sim.facts.metrics.score import find_reported_tracks
from sim.mission.archive import save
from sim.scenario.scenario import encode_scenario
from tracking.metrics.ospa import ospa


@pytest.fixture(scope="module")
def mission():
    """A recording in which false alarms become tracks, and an observer."""
    options = ("sensing.false_alarms=0.3", "tracking.initial_tracks=none", "trees.density=45")
    paper = ("tracking.motion=ncv", "tracking.sigma_a=0.6", "tracking.max_variance=400")
    recording = recorded(*IDEAL, *options, *paper, seed=3, duration=20)
    with Observer(Flight(recording)) as observer:
        yield recording, observer


def story(observer, number):
    return dict(tell_track_story(TrackFacts(observer, number)))


def test_tracks_are_born_from_the_measurements_that_their_trackers_had(mission):
    recording, observer = mission
    false = 0
    for id_, number in recording.track_numbers.items():
        facts = TrackFacts(observer, number)
        (measured,) = facts.births(facts.first, id_)
        assert measured[-1].k == facts.first and facts.first - 5 <= measured[0].k < facts.first
        for m in measured:
            np.testing.assert_array_equal(m.place, recording.scan_at(m.k, m.uav).measurements[m.measurement])
            assert observer.owners(m.k, m.uav)[m.measurement] == m.person
        false += measured[0].person < 0
    assert len(recording.track_numbers) >= 6 and false >= 2


def test_errors_in_flight_are_those_of_reported_tracks(mission):
    recording = mission[0]
    assert not recording.reported.all()
    told = find_reported_tracks(recording, 0).means[..., :2]
    for k, places in enumerate(told):
        error = ospa(places[~np.isnan(places[:, 0])], recording.people[k])
        np.testing.assert_array_equal(recording.ospa[k, 0], error)


def test_the_story_says_when_a_track_was_not_reported(mission):
    recording, observer = mission
    id_ = recording.track_ids[~recording.reported][0]
    facts = TrackFacts(observer, recording.track_numbers[id_])
    scans, _ = recording.cells(recording.track_offsets)
    own = np.unique(scans[~recording.reported & (recording.track_ids == id_)])  # on all UAVs alike
    (line,) = [line for line in dict(tell_track_story(facts))["kept"] if "reported" in line]
    first, last = recording.times[own[[0, -1]] + [0, 1]]
    assert line.startswith(f"not reported in {len(own)} scans, {first:.1f} to {last:.1f} s")


def test_the_story_of_a_false_track_has_birth_feeds_reason_and_end(mission):
    recording, observer = mission
    every = (TrackFacts(observer, number) for number in recording.track_numbers.values())
    births = ((facts, *facts.births(facts.first, facts.id)) for facts in every)
    facts, (begun, *_) = next((facts, born) for facts, born in births if all(m.person < 0 for m in born))
    groups = dict(tell_track_story(facts))
    assert list(groups)[1:] == ["born", "fed by", "kept", "deleted"]
    assert f"track {facts.number} stands for no person" in groups[f"track {facts.number}"][1]
    x, y = begun.place
    place, time = f"({x:.1f}, {y:.1f}) m", f"{recording.times[begun.k]:.1f} s"
    assert groups["born"][0] == f"at {time} from a false alarm at {place}, measured by UAV {begun.uav}"
    confirmed = f"{recording.times[facts.first]:.1f} s by UAV {begun.uav}"
    assert groups["born"][-1] == f"confirmed at {confirmed}"
    assert "that should have shown it; existence " in groups["kept"][0]


def test_the_end_of_a_track_has_the_reason_of_its_tracker(mission):
    recording, observer = mission
    ended = [event for event in Flight(recording).events if event.kind == "track deleted"]
    for event in ended:
        (line,) = [line for line in story(observer, event.track)["deleted"] if line.startswith("at ")]
        told = re.fullmatch(rf"at {event.time:.1f} s by UAVs 0, 1 and 2: existence (.+); a track is (.+)", line)
        assert float(told[1]) < 0.001 and told[2] == "deleted below 0.001"
    assert len(ended) >= 2


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("tracking.max_variance=9",), r"variance (9\.\d|1\d\.\d) m²; a track is deleted beyond 9 m²"),
        (("tracking.management=m_of_n",), "5 misses in 5 scans that should have shown its person"),
        ((), r"it shared its person with track \d+, which goes on"),
    ],
)
def test_tracks_end_for_each_reason(options, reason):
    alarms = ("sensing.false_alarms=2", "trees.density=45", "tracking.initial_tracks=none")
    recording = recorded(*IDEAL, *alarms, *options, seed=1, duration=10)
    with Observer(Flight(recording)) as observer:
        ends = [line for number in recording.track_numbers.values() for line in story(observer, number)["deleted"]]
    assert any(re.fullmatch(rf"at [\d.]+ s by UAVs? [\d, and]+: {reason}", line) for line in ends)


def test_a_track_whose_uavs_broke_down_was_not_deleted():
    recording = recorded(*IDEAL, "uavs=[{start=[-28,-14],fails_at=0.9}]", duration=2)
    with Observer(Flight(recording)) as observer:
        assert story(observer, 0)["deleted"] == ["at 1.0 s, as UAV 0 broke down"]


def test_the_story_of_an_outside_trackers_track_quotes_no_built_in_limits(mission):
    setting = mission[0].setting
    outside = structs.replace(setting, tracking=structs.replace(setting.tracking, tracker="soup:Jpda"))
    recording = replace(mission[0], scenario=encode_scenario(outside))
    with Observer(Flight(recording)) as observer:
        for number in recording.track_numbers.values():
            groups = story(observer, number)
            lines = [line for group in groups.values() for line in group]
            assert groups["note"][0].startswith("soup:Jpda is a plug-in, which is not run again")
            assert not any("a track is" in line or "its gate" in line or "no measurement" in line for line in lines)
        facts = make_person_facts(observer, 4, 0)
        assert dict(explain_person(facts))["note"] == groups["note"]


def test_a_mission_without_measurements_has_stories_too(tmp_path, call, refused):
    recording = swapping()
    with Observer(Flight(recording)) as observer:
        false = TrackFacts(observer, 2)
        assert (false.first, false.last, false.known) == (*FALSE, False)
        assert story(observer, 2)["born"] == ["first held at 0.4 s by UAVs 0, 1 and 2"]
        assert TrackFacts(observer, 0).known
    save(recording, tmp_path / "mission.npz")
    code, out, _ = call("explain", "mission.npz", "--track", "0")
    assert code == 0 and "  known at the start\n" in out and "not before the end of the mission" in out
    assert "--track: '4' is not allowed" in refused("explain", "mission.npz", "--track", "4")
    for other in (("--time", "1"), ("--target", "0"), ("--out", "a.png")):
        told = refused("explain", "mission.npz", "--track", "0", *other)
        assert f"{other[0]}: '{other[1]}' is not allowed with --track" in told
