"""The facts about people, scan by scan, against one camera's sight and against counting by hand."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.people_facts import make_facts
from helpers.recordings import broken, record

import understory
from sim.facts.metrics.holding import HOLDS, Holding, list_reports
from sim.facts.people import PeopleFacts
from sim.facts.sightings import STATES
from sim.views.frames.frame_facts import make_frame_facts


@pytest.fixture(scope="module")
def recording():
    return record(21)


def test_views_and_holders_are_those_of_each_camera_and_track(recording):
    facts = PeopleFacts(recording)
    hidden = 0
    for k in range(len(recording.times)):
        for i in range(3):
            for m, person in enumerate(make_frame_facts(recording, k, i).people):
                assert facts.views.inside[k, i, m] == person.inside
                assert facts.views.hidden_by[k, i, m] == min(person.hidden_by, default=-1)
                hidden += bool(person.hidden_by)
    assert hidden > 5 and facts.views.inside.any() and not facts.views.inside.all()
    count = 0
    for k, i, m in np.argwhere(facts.tracks >= 0).tolist():
        (track,) = (t for t in recording.tracks_at(k, i) if t.id == facts.tracks[k, i, m])
        assert np.hypot(*(track.belief.mean[:2] - recording.people[k, m])) <= 1.0
        count += 1
    assert count > 100
    facts = PeopleFacts(broken(recording, 1, 10))
    assert (
        not facts.recording.frames_taken[10:, 1].any()
        and not facts.views.inside[10:, 1].any()
        and not facts.detected[10:, 1].any()
    )
    assert facts.recording.frames_taken[:, [0, 2]].all()


@pytest.mark.parametrize("occlusion", ["line_of_sight", "disc"])
def test_ideal_sensing_shows_exactly_those_inside_whom_no_tree_hides(occlusion):
    settings = {"duration": 10, "sensing.mode": "ideal", "sensing.occlusion": occlusion, "trees.density": 75}
    flight = understory.run("forest", "greedy", seed=1, settings=settings)
    facts = flight.people
    np.testing.assert_array_equal(facts.shown, facts.views.inside & (facts.views.hidden_by < 0))
    assert facts.shown.any() and (facts.views.hidden_by >= 0).any()
    last = make_frame_facts(flight.recording, flight.recording.scan_count - 1, 1).people
    assert [min(person.hidden_by, default=-1) for person in last] == facts.views.hidden_by[-1, 1].tolist()


def test_between_frames_a_slow_camera_has_what_its_last_frame_had():
    uavs = [{"start": [-28.0, y], "footprint": 25.0, "rate": rate} for y, rate in ((-10.0, 1), (10.0, 5))]
    settings = {"duration": 10, "sensing.mode": "ideal", "trees.density": 75, "uavs": uavs}
    facts = understory.run("forest", "greedy", seed=5, settings=settings).people
    last = np.arange(51) // 5 * 5
    for m in range(4):
        for table in (facts.camera_states, facts.hiding_trees):
            np.testing.assert_array_equal(table[:, 0, m], table[last, 0, m])
    hidden = facts.camera_states[:, 0] == STATES.index("hidden")
    assert (hidden == (facts.hiding_trees[:, 0] >= 0)).all() and hidden[last != np.arange(51)].any()


def test_a_lone_person_too_small_for_a_pixel_is_not_said_to_be_covered():
    fleet = [{"start": [-28.0, -14.0], "footprint": 20.0, "pixels": 16}]
    settings = {"duration": 2, "people.count": 1, "trees.density": 0, "uavs": fleet}
    flight = understory.run("forest", "hover", seed=1, settings=settings)
    unshown = flight.people.views.inside[:, 0, 0] & ~flight.people.shown[:, 0, 0]
    assert unshown.any()
    words = "hidden from UAV 0, though no tree is in the way"
    np.testing.assert_array_equal([text == words for text in flight.people.view_texts(0)], unshown)
    k = int(unshown.argmax())
    assert make_frame_facts(flight.recording, k, 0).people[0].status == "hidden, though no tree is in the way"


def test_states_losses_and_holders_are_those_counted_by_hand(recording):
    facts = PeopleFacts(recording)
    shape = facts.tracks.shape
    for k, m in np.ndindex(shape[0], shape[2]):
        told = [s for s, by in (("hidden", facts.views.inside), ("missed", facts.shown), ("seen", facts.detected))
                if by[k, :, m].any()]  # fmt: skip
        expected = told[-1] if told else "out of view"
        assert STATES[facts.states[k, m]] == (expected if facts.recording.present[k, m] else "absent")
    nothing = np.zeros((6, 2, 1), bool)
    tracks = np.array([[[7], [7]], [[-1], [7]], [[-1], [-1]], [[-1], [-1]], [[9], [-1]], [[-1], [-1]]])
    present = np.array([[True], [True], [True], [True], [True], [False]])
    few = make_facts(nothing, nothing, nothing, tracks, present=present)
    np.testing.assert_array_equal(few.held[:, 0], [2, 1, 0, 0, 1, 0])
    assert [(span.person, span.first, span.last, span.found) for span in few.unheld] == [(0, 2, 3, True)]
    never = make_facts(nothing, nothing, nothing, np.full((6, 2, 1), -1), present=present)
    assert [(span.first, span.last, span.found) for span in never.unheld] == [(0, 4, False)]


def test_states_of_a_film_are_those_of_the_recording():
    recording = record(21)
    means, rng = recording.track_means.copy(), np.random.default_rng(0)
    means[:, :2] += rng.normal(0.0, 0.5, (len(means), 2))
    far = rng.random(len(means)) < 0.3
    means[far, :2] += 3.0
    means[(recording.track_ids == 1) & (np.arange(len(means)) < 60), :2] += 50.0
    existence = np.where(rng.random(len(means)) < 0.1, 0.5, 0.6)
    recording = replace(recording, track_means=means, track_existence=existence)
    expected, holding = PeopleFacts(recording).hold_states, Holding(4, 3, 1.0)
    rows = [recording.snapshot(k) for k in range(recording.scan_count)]
    found = [holding.step(row.people, list_reports(row.tracks), len(row.working)).states for row in rows]
    np.testing.assert_array_equal(found, expected)
    certain = replace(recording, track_existence=np.ones(len(means)))
    assert (PeopleFacts(certain).hold_states != expected).any()
    assert set(np.unique(expected)) == set(range(len(HOLDS)))
