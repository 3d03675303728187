"""Events of a mission: against events made by hand, and a mission's own links."""

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from helpers import synthetic
from helpers.flights import recorded as recorded_flight
from helpers.people_facts import with_views
from helpers.recordings import broken, record
from scipy.stats import chi2

from sim.facts.event import KINDS, UNHELD, format_times, sort_by_severity
from sim.facts.explain.explanation import find_stretches
from sim.facts.flight import Flight
from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.holding import HOLDS, INSIDE, NO_TRACK, OUTSIDE, find_gaps
from sim.facts.metrics.metric import Outcome
from sim.facts.mission_events import find_events
from sim.mission import mission
from sim.mission.radio import draw_links
from sim.mission.recorded_links import find_recorded_links
from sim.scenario.scenario import encode_scenario
from sim.scenario.uavs import Cut, Network
from tracking.filter.kalman import Gaussian
from tracking.parameters import Tracking
from tracking.track import Track

SETTING = synthetic.scenario(uavs=2, people=2)
PEOPLE = np.array([[0.0, 0.0], [20.0, 0.0]])


def held(*tracks):
    """Tracks by id and, in metres, where from west to east."""
    return tuple(Track(id_, Gaussian(np.array([x, 0.0, 0.0, 0.0]), np.eye(4))) for id_, x in tracks)


def recorded(tracks, setting=SETTING, **changes):
    """A mission of two people at rest; `tracks` are those of both UAVs at each scan."""
    held_by_both = iter(tracks)

    def still(snapshot):
        return replace(snapshot, people=PEOPLE, tracks=list(next(held_by_both)), contacts=())

    return replace(record(len(tracks), setting=setting, trees=0, change=still), **changes)


def told(recording, without=("link lost", "link restored")):
    return [(round(e.time, 6), e.kind, e.sentence) for e in Flight(recording).events if e.kind not in without]


def test_people_who_leave_and_come_back_are_told():
    none, gone = held(), np.full(2, np.nan)

    def wander(snapshot):
        k = round(5 * snapshot.time)
        people = np.array([gone if k in (1, 2, 5) else PEOPLE[0], gone if k < 2 else PEOPLE[1]])
        return replace(snapshot, people=people, tracks=[none, none], contacts=())

    found = told(record(7, setting=SETTING, trees=0, change=wander))
    assert [e for e in found if e[1] in ("person left", "person came")] == [
        (0.2, "person left", "person 0 left the area"),
        (0.4, "person came", "person 1 came"),
        (0.6, "person came", "person 0 came again after 0.4 s"),
        (1.0, "person left", "person 0 left the area"),
        (1.2, "person came", "person 0 came again after 0.2 s"),
    ]


def test_tracks_are_born_received_handed_over_swapped_and_deleted_by_number():
    one, none = held((70, 0.0), (30, 20.0)), held((30, 20.0))
    found = told(recorded([(one, none), (one, one), (none, one), (none, none)]))
    assert [e for e in found if e[1].startswith("track")] == [
        (0.0, "track born", "track 0 known at the start to UAV 0"),
        (0.0, "track born", "track 1 known at the start to UAVs 0 and 1"),
        (0.2, "track received", "track 0 received by UAV 1"),
        (0.4, "track dropped", "track 0 dropped by UAV 0"),
        (0.6, "track deleted", "track 0 deleted by UAV 1"),
    ]
    unknown = msgspec.structs.replace(SETTING, tracking=Tracking(initial_tracks="none"))
    found = told(recorded([(one, none), (held((70, 0.0), (30, 20.0), (80, 50.0)), none)], unknown))
    assert [e[2] for e in found if e[1] == "track born"] == [
        "track 0 born and confirmed by UAV 0",
        "track 1 born and confirmed by UAVs 0 and 1",
        "track 2 born and confirmed by UAV 0",
    ]
    found = told(recorded([(one, none), (held((70, 0.0), (30, 20.0), (80, 50.0)), none)]))
    assert [e[2] for e in found if e[1] == "track born"][2] == "track 2 born and confirmed by UAV 0"
    straight, crossed, fresh = held((0, 0.0), (2, 20.0)), held((2, 0.0), (0, 20.0)), held((2, 0.0), (5, 20.0))
    found = told(recorded([(straight, straight), (crossed, straight), (crossed, straight), (fresh, straight)]))
    assert [e[::2] for e in found if e[1] == "identity switch"] == [
        (0.2, "person 0 switched from track 0 to track 1, that of person 1, for UAV 0"),
        (0.2, "person 1 switched from track 1 to track 0, that of person 0, for UAV 0"),
        (0.6, "person 1 handed over from track 0 to track 2 for UAV 0"),
    ]


def test_losses_say_where_the_track_is_and_finds_how_long_it_took():
    on, off, gone = held((7, 0.0), (9, 20.0)), held((7, 3.0), (9, 20.0)), held((9, 20.0))
    recording = recorded([(on, on), (on, off), (off, off), (gone, gone), (on, gone)])
    recording = replace(recording, matched=np.zeros_like(recording.matched), visible=np.zeros_like(recording.visible))
    lost, found = [e for e in Flight(recording).events if e.kind.startswith("person")]
    text = "person 0 lost, without a track within 10 m for 0.2 s"
    assert (lost.kind, lost.text, lost.when, lost.person) == ("person lost", text, "0.4 to 0.8 s", 0)
    assert lost.why.endswith("; track 0 is 3.0 m off at first")
    assert found.text == "person 0 found again by UAV 0 after 0.4 s" and (found.first, found.uavs) == (4, (0,))


def test_losses_are_graded_by_the_tracks_that_hold_nobody_and_told_the_worst_first():
    """The covariances are 1 m², so ellipses reach 2.4 m; at the first scan both people are held."""
    on, off, outside, gone = (held(*one, (9, 20.0)) for one in ([(7, 0.0)], [(7, 2.0)], [(7, 3.0)], []))
    scans = [on, off, off, on, outside, on, gone, on, off, off, outside, on, off, gone, on]
    flight = Flight(recorded([(scan, scan) for scan in scans]))
    states = [HOLDS[state] for state in flight.people.hold_states[:, 0]]
    assert states == [{on: "held", off: "off the track"}.get(scan, "lost") for scan in scans]
    unheld = sort_by_severity(e for e in flight.events if e.person == 0 and e.kind in UNHELD)
    assert [(e.text, e.when) for e in unheld] == [
        ("person 0 lost, without a track within 10 m", "1.2 to 1.4 s"),
        ("person 0 lost, without a track within 10 m", "2.6 to 2.8 s"),
        ("person 0 lost, outside the ellipse of the track", "0.8 to 1.0 s"),
        ("person 0 lost, outside the ellipse of the track", "2.0 to 2.2 s"),
        ("person 0 off the track", "0.2 to 0.6 s"),
        ("person 0 off the track", "1.6 to 2.0 s"),
        ("person 0 off the track", "2.4 to 2.6 s"),
    ]
    again = [(e.time, e.text.partition(" after ")[2]) for e in flight.events if e.kind == "person found"]
    assert again == [
        (pytest.approx(t), f"{d:.1f} s") for t, d in ((0.6, 0.4), (1.0, 0.2), (1.4, 0.2), (2.2, 0.6), (2.8, 0.4))
    ]
    losses = flight.columns("losses")
    assert losses["scans_without_track"].sum() == 2 and losses["scans_outside_ellipse"].sum() == 2
    one = [(on, on), (outside, off), (off, outside)]  # the nearest track of any UAV counts
    assert [e.kind for e in Flight(recorded(one)).events if e.person == 0] == ["person off the track"]
    other = [(on, on), (held((7, 20.0)), held((7, 20.0)))]  # the track nearby holds the other person
    assert [e.text for e in Flight(recorded(other)).events if e.kind == "person lost"] == [
        "person 0 lost, without a track within 10 m"
    ]


def test_the_loss_distance_of_a_scenario_decides_who_is_held():
    on, off = held((7, 0.0), (9, 20.0)), held((7, 2.0), (9, 20.0))
    far, shares = msgspec.structs.replace(SETTING, loss_distance=2.5), []
    for setting in (SETTING, far):
        flight = Flight(recorded([(on, on), (off, off)], setting))
        shares.append((METRICS["share_held"](Outcome(flight.recording)), len(flight.people.unheld)))
    assert shares == [(0.75, 1), (1.0, 0)]
    assert encode_scenario(SETTING) == encode_scenario(far).replace('"loss_distance":2.5,', "")


def test_gaps_to_tracks_are_those_of_the_cut_off_and_of_chi_square():
    rng = np.random.default_rng(0)
    people, means = rng.uniform(-12, 12, (400, 2)), np.array([[0.0, 0.0, 1.0, 0.0], [6.0, 0.0, 0.0, 0.0]])
    covariances = np.array([np.diag([9.0, 1.0, 1.0, 1.0]), np.diag([0.2, 60.0, 1.0, 1.0])])
    covariances[0, 0, 1] = covariances[0, 1, 0] = 2.0
    expected = []
    for person in people:
        errors = person - means[:, :2]
        squares = [e @ np.linalg.inv(P[:2, :2]) @ e for e, P in zip(errors, covariances, strict=True)]
        near = np.linalg.norm(errors, axis=1) < 10.0
        inside = near & (chi2.cdf(squares, 2) <= 0.95)
        expected.append(INSIDE if inside.any() else OUTSIDE if near.any() else NO_TRACK)
    assert set(expected) == {INSIDE, OUTSIDE, NO_TRACK}
    assert find_gaps(np.array([[6.0, 15.0]]), means, covariances) == NO_TRACK  # in an ellipse, but too far away
    np.testing.assert_array_equal(find_gaps(people, means, covariances), expected)
    assert (find_gaps(people, means[:0], covariances[:0]) == NO_TRACK).all()


@pytest.mark.parametrize(("last", "when"), [(3, "0.4 to 0.8 s"), (4, "from 0.4 s to the end")])
def test_a_loss_lasts_until_the_scan_after_it_wherever_it_is_told(last, when):
    on, off = held((7, 0.0), (9, 20.0)), held((7, 3.0), (9, 20.0))
    flight = Flight(recorded([(off, off) if 2 <= k <= last else (on, on) for k in range(5)]))
    (lost,) = (e for e in flight.events if e.kind == "person lost")
    length = 0.2 * (min(last, 3) - 1)  # the mission ends with its last scan
    losses = flight.columns("losses")
    assert lost.when == when and losses["until_s"] - losses["from_s"] == pytest.approx([length])
    assert f"; lost once, at worst person 0 for {length:.1f} s from 0.4 s>" in repr(flight)
    assert [format_times(*row[:2]) for row in find_stretches(flight.people, 0) if row[2] == "lost"] == [when]
    again = [e.text for e in flight.events if e.kind == "person found"]
    assert again == ([f"person 0 found again by UAVs 0 and 1 after {length:.1f} s"] if last < 4 else [])


def test_a_track_that_is_not_reported_holds_no_person_and_is_not_false():
    on, off = held((7, 0.0), (9, 20.0)), held((7, 50.0), (9, 20.0))
    recording = recorded([(on, on), (on, on), (off, off)])
    existence = np.where(recording.track_ids == 7, np.repeat([0.51, 0.5, 0.34], 4), np.nan)
    (lost,) = (e for e in Flight(replace(recording, track_existence=existence)).events if e.kind == "person lost")
    assert lost.why.endswith("; track 0 is 0.0 m off at first, but not reported (existence 0.50)")
    assert lost.when == "from 0.2 s to the end"
    likely = [e.kind for e in Flight(recording).events]
    unlikely = [e.kind for e in Flight(replace(recording, track_existence=existence)).events]
    assert "false track" in likely and "false track" not in unlikely


def test_causes_of_a_loss_are_told_in_order_of_time():
    on, off = held((7, 0.0), (9, 20.0)), held((9, 20.0))
    recording = recorded([(on, on)] + [(off, off)] * 5)
    inside, shown, none = np.zeros((3, 6, 2, 2), dtype=np.bool_)
    hidden_by = np.full(inside.shape, -1)
    inside[1:3, 0, 0], hidden_by[1:3, 0, 0] = True, 31
    inside[2:4, 1, 0], hidden_by[2:4, 1, 0] = True, 31
    shown[4, 1, 0] = True
    found = find_events(with_views(recording, inside, hidden_by, shown, none))
    (lost,) = (e for e in found if e.kind == "person lost")
    # The last scan has no time.
    assert lost.why == "hidden by tree 31 from UAVs 0 and 1 (0.6 s); missed by UAV 1 (0.2 s); track 0 is gone"
    assert lost.when == "from 0.2 s to the end" and lost.uavs == (0,)  # whose frame at 0.2 s has the person


def test_a_cause_names_the_uavs_that_had_it_at_its_scans():
    on, off = held((7, 0.0), (9, 20.0)), held((9, 20.0))
    recording = recorded([(on, on)] + [(off, off)] * 3 + [(on, on)])
    trees = np.full((5, 2, 2), -1)
    inside, none = np.zeros(trees.shape, dtype=np.bool_), np.zeros(trees.shape, dtype=np.bool_)
    inside[1, 0, 0] = inside[2:4, :, 0] = True
    trees[1, 0, 0], trees[2, :, 0], trees[3, 1, 0] = 31, (32, 31), 32
    facts = with_views(recording, inside, trees, none, none)
    (lost,) = (e for e in find_events(facts) if e.kind == "person lost")
    assert lost.why == (
        "hidden by tree 31 from UAV 0 (0.2 s); hidden by tree 31 from UAV 1, by tree 32 from UAV 0 (0.2 s); "
        "hidden by tree 32 from UAV 1; hidden from UAV 0, though no tree is in the way (0.2 s); track 0 is gone"
    )


def test_of_a_person_in_no_frame_the_nearest_uav_that_works_comes_first():
    on, off = held((7, 0.0), (9, 20.0)), held((9, 20.0))
    recording = recorded([(on, on), (off, off), (off, ())])
    poses, unseen = recording.poses.copy(), np.zeros_like(recording.visible)
    poses[:, 0, :2], poses[:, 1, :2] = (40.0, 40.0), (30.0, 30.0)
    recording = replace(recording, poses=poses, cameras=poses, visible=unseen, matched=unseen > 0)
    for flown, uav in ((recording, 1), (broken(recording, 1, 1), 0)):
        lost = [e for e in Flight(flown).events if e.kind == "person lost" and e.person == 0]
        assert [e.uavs for e in lost] == [(uav,)] and "out of view" in lost[0].why


def test_the_longest_three_causes_of_a_loss_are_told():
    on, off = held((7, 0.0), (9, 20.0)), held((9, 20.0))
    recording = recorded([(on, on)] + [(off, off)] * 7 + [(on, on)])
    trees = np.full((9, 2, 2), -1)
    trees[1:8, 0, 0] = 4, 5, 5, 6, 6, 7, 7
    none, inside = np.zeros(trees.shape, dtype=np.bool_), trees >= 0
    facts = with_views(recording, inside, trees, none, none)
    (lost,) = (e for e in find_events(facts) if e.kind == "person lost")
    causes = [f"hidden by tree {tree} from UAV 0 (0.4 s)" for tree in (5, 6, 7)]
    assert lost.why == "; ".join([*causes, "track 0 is gone"])


def test_tracks_that_stand_for_no_person_are_told_as_false_or_duplicates():
    plain, double = held((1, 0.0), (2, 20.0)), held((1, 0.0), (2, 20.0), (3, 0.5))
    false, drifted = held((1, 0.0), (2, 20.0), (4, 50.0)), held((1, 5.0), (2, 20.0))
    recording = recorded([(plain, plain), (double, plain), (double, double), (plain, false), (drifted, drifted)])
    found = [e for e in Flight(recording).events if e.kind in ("false track", "duplicate track")]
    assert [(e.kind, e.text, e.when, e.uavs, e.person) for e in found] == [
        ("duplicate track", "track 2 is person 0's second one", "0.2 to 0.6 s", (0, 1), 0),
        ("false track", "track 3 stands for no person", "0.6 to 0.8 s", (1,), None),
    ]
    for cost, part in ((3.33, "; OSPA's cardinality part is up to 3.3 m"), (0.0, "")):
        ospa = np.zeros_like(recording.ospa)
        ospa[3, 1, 2] = cost
        (event,) = (e for e in Flight(replace(recording, ospa=ospa)).events if e.kind == "false track")
        assert event.why == f"held by UAV 1, 30.0 m from person 1{part}"


def test_breakdowns_faults_contacts_and_links_are_told_once():
    first, second = SETTING.uavs
    setting = msgspec.structs.replace(SETTING, uavs=(first, msgspec.structs.replace(second, fails_at=0.3)))
    on = held((1, 0.0), (2, 20.0))
    recording = broken(recorded([(on, on), (on, on), (on, ()), (on, ())], setting), 1, 2)
    faults = [{"time": time, "uav": None, "message": "ValueError: no"} for time in (0.2, 0.4)]
    faults.insert(1, {"time": 0.3, "uav": 1, "message": "broke down"})
    contacts = np.array([[1, 0, 1, 4], [2, 0, 1, 4], [3, 1, 4, 0]])
    recording = replace(recording, faults=json.dumps(faults), contacts=contacts)
    assert [e for e in told(recording) if not e[1].startswith("person") and e[0]] == [
        (0.2, "fault", "2 faults of the team: ValueError: no"),
        (0.2, "contact", "UAV 0 touched the canopy of tree 4"),
        (0.3, "breakdown", "UAV 1 broke down"),
        (0.6, "contact", "UAV 1 touched the ground"),
    ]
    lasting = [e.when for e in Flight(recording).events if e.kind in ("fault", "contact")]
    assert lasting == ["0.2 to 0.4 s", "0.2 to 0.4 s", "at 0.6 s"]
    cut = Network(cuts=(Cut(links=((0, 1),), start=0.3, end=0.5),))
    setting = msgspec.structs.replace(SETTING, network=cut)
    on = held((1, 0.0), (2, 20.0))
    assert [e for e in told(recorded([(on, on)] * 4, setting), ()) if e[1].startswith("link")] == [
        (0.4, "link lost", "UAV 0 and UAV 1: cut"),
        (0.6, "link restored", "UAV 0 and UAV 1"),
    ]


def test_links_and_lost_messages_are_those_of_the_mission(monkeypatch):
    flown = []
    monkeypatch.setattr(mission, "draw_links", lambda *given: flown.append(draw_links(*given)) or flown[-1])
    options = ("sensing.mode=ideal", "network.loss=0.7", "network.rounds=2", "network.range=22", "uavs.1.fails_at=2.1")
    recording = recorded_flight(*options, seed=5, duration=4)
    again = find_recorded_links(recording)
    assert len(again) == len(flown) == 21
    silent = 0
    for now, then, working in zip(again, flown, recording.working, strict=True):
        both = working[:, None] & working
        np.testing.assert_array_equal(now.lost, then.lost)
        np.testing.assert_array_equal(now.up, then.up & both)
        silent += np.count_nonzero(now.up & ~now.contact)
    assert silent > 5 and not recording.working[-1, 1]
    found = Flight(recording).events
    assert all(e.kind in KINDS for e in found)
    began = [e for e in found if e.kind == "messages lost"]
    first = next(k for k, now in enumerate(again) if (now.up & ~now.contact).any())
    i, j = np.argwhere(again[first].up & ~again[first].contact)[0]
    assert (began[0].time, began[0].text) == (recording.times[first], f"UAV {i} hears nothing of UAV {j}")
    ended = [e for e in found if e.kind == "messages heard"]
    assert 0 < len(ended) <= len(began) <= silent


def test_a_track_that_another_uav_still_has_is_not_said_to_be_gone():
    on, off, gone = held((7, 0.0), (9, 20.0)), held((7, 3.0), (9, 20.0)), held((9, 20.0))
    for after, words in (((gone, off), "track 0 is 3.0 m off at first"), ((gone, gone), "track 0 is gone")):
        (lost,) = (e for e in Flight(recorded([(on, off), after])).events if e.kind == "person lost")
        assert lost.why.endswith(f"; {words}")
