"""Explanations: against geometry, the trackers' numbers, frames without trees, and later flight."""

import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.flights import IDEAL, recorded
from helpers.people_facts import spell_facts, with_views
from helpers.recordings import broken

from sim.facts.explain.explanation import explain_person, find_stretches
from sim.facts.explain.observation import Observer
from sim.facts.explain.person import make_person_facts
from sim.facts.flight import Flight
from sim.facts.people import PeopleFacts
from sim.facts.words import format_percent
from sim.mission.archive import save
from sim.views.frames.explain_picture import draw_explanation


@pytest.fixture(scope="module")
def mission():
    """A recording, its history and an observer."""
    alarms = ("sensing.false_alarms=3", "sensing.miss_probability=0.2", "tracking.clutter_density=1e-3")
    paper = ("tracking.motion=ncv", "tracking.sigma_a=0.6")  # by which tracks of lost people last longer
    recording = recorded("trees.density=60", *alarms, *paper)
    with Observer(Flight(recording)) as observer:
        yield recording, observer.flight.people, observer


@pytest.fixture(scope="module")
def all_facts(mission):
    """Those of each person at every third scan."""
    _, history, observer = mission
    return [make_person_facts(observer, k, m) for k, m in np.ndindex(history.recording.present.shape) if k % 3 == 0]


def test_the_whole_of_a_person_is_what_a_forest_without_trees_shows(all_facts):
    hidden = clear = 0
    for facts in all_facts:
        for w in facts.observations:
            assert (w.whole is None) == (not w.sighting.inside and not w.sighting.pixels)
            if w.whole is None:
                continue
            assert w.whole >= w.sighting.pixels
            hidden += w.sighting.pixels == 0 and bool(w.sighting.hidden_by)
            clear += w.sighting.pixels == w.whole
            assert w.whole > 0 or w.sighting.pixels == 0
    assert hidden >= 10 and clear >= 10
    bare = recorded("trees.density=0", duration=1)
    with Observer(Flight(bare)) as observer:
        shown = [(observer.observe(k, i, m).whole or 0, bare.visible[k, i, m])
                 for k, i, m in np.ndindex(*bare.visible.shape)]  # fmt: skip
    assert all(whole == pixels for whole, pixels in shown) and max(shown)[0] > 5


def test_detections_are_found_where_they_were_with_the_error_that_they_had(mission, all_facts):
    recording, count = mission[0], 0
    for facts in all_facts:
        for w in facts.observations:
            assert (w.found is not None) == recording.matched[facts.k, w.uav, facts.person]
            if w.found is None:
                continue
            scan = recording.scan_at(facts.k, w.uav)
            off = scan.measurements[w.found.measurement] - facts.place
            R = scan.covariances[w.found.measurement]
            assert w.found.error == pytest.approx(np.hypot(*off)) and w.found.error < 3.0
            assert w.found.sigmas == pytest.approx(np.sqrt(off @ np.linalg.inv(R) @ off))
            np.testing.assert_array_equal(w.found.pixel, recording.pixels_at(facts.k, w.uav)[w.found.measurement])
            assert w.owners[w.found.measurement] == facts.person
            count += 1
    assert count > 15


def test_in_ideal_sensing_measurements_are_the_nearest_persons_who_are_in_view():
    recording = recorded("sensing.mode=ideal", "sensing.false_alarms=2", duration=2)
    count = 0
    with Observer(Flight(recording)) as observer:
        for k, i, m in np.argwhere(recording.matched).tolist():
            w = observer.observe(k, i, m)
            gaps = np.hypot(*(w.association.measurements - recording.people[k, m]).T)
            assert w.whole is None and w.found.pixel is None and w.found.error == pytest.approx(gaps.min())
            count += len(w.owners) > 1
    assert count > 5
    recording = recorded("sensing.mode=ideal", "sensing.field_of_view=unlimited", duration=1)
    far = 0
    with Observer(Flight(recording)) as observer:
        for k, i, m in np.ndindex(*recording.matched.shape):
            w = observer.observe(k, i, m)
            assert w.sighting.status.startswith("seen" if recording.matched[k, i, m] else "hidden by tree")
            far += w.found is not None and w.away > recording.setting.uavs[i].footprint
        page = make_person_facts(observer, 0, 0)
        assert draw_explanation(page, explain_person(page)).std() > 10
    assert far > 5


def test_the_words_of_an_explanation_agree_with_history_views_and_association(mission, all_facts):
    recording, history, _ = mission
    seen = set()
    for facts in all_facts:
        groups = dict(explain_person(facts))
        heading = f"person {facts.person} at {recording.times[facts.k]:.1f} s"
        assert list(groups)[:4] == [heading, "UAV 0", "UAV 1", "UAV 2"] and list(groups)[-1] == "intents"
        assert len(groups["intents"]) == 3
        text = "\n".join(groups[heading])
        assert ("held by UAV" in text) == (history.held[facts.k, facts.person] > 0) != ("lost since" in text)
        for w in facts.observations:
            made, text = w.association, "\n".join(groups[f"UAV {w.uav}"])
            numbers, weights, gated = recording.numbers_of(made.ids).tolist(), made.weights(), made.gated()
            trees = re.findall(r"^tree (\d+) stands", text, flags=re.M)
            assert [int(tree) for tree in trees] == list(w.sighting.hidden_by)
            assert ("detected at pixel" in text) == (w.found is not None)
            assert (f"shows {w.sighting.pixels} of {w.whole} pixels" in text) == bool(w.whole)
            seen |= {word for word in ("in the gate of track", "missed", "too, weight") if word in text}
            found, own = w.found.measurement if w.found else -1, numbers.index(facts.holders[0].number)
            told = re.findall(r"in the gate of track (\d+) at ([\d.]+) σ, weight (.+)", text)
            assert len(told) == (np.count_nonzero(gated[:, found]) if w.found else 0)
            for number, sigmas, weight in told:
                t = numbers.index(int(number))
                assert weight == format_percent(weights[t, found])
                assert float(sigmas) == pytest.approx(made.distances()[t, found] ** 0.5, abs=0.051)
            assert f"in plain view with {format_percent(made.before.visible[own])}" in text
            others = gated[own] & (weights[own] >= 0.005) & (np.arange(len(made.measurements)) != found)
            assert text.count("too, weight") == np.count_nonzero(others)
    assert seen == {"in the gate of track", "missed", "too, weight"}


def test_the_track_is_the_one_that_stands_for_the_person_or_did_last(mission, all_facts):
    recording, history, _ = mission
    order = list(dict.fromkeys(recording.track_ids.tolist()))
    lost = 0
    for facts in all_facts:
        k, m, holder = facts.k, facts.person, facts.holders[0]
        held = [(j, t) for j in range(k + 1) for t in history.tracks[j, :, m].tolist() if t >= 0]
        last = held[-1][0]
        assert order[holder.number] in {t for j, t in held if j == last}
        assert holder.until == recording.times[last]
        assert set(holder.holds) == {i for i in range(3) if history.tracks[k, i, m] == order[holder.number]}
        first = next(j for j in range(k + 1) for i in range(3)
                     if order[holder.number] in [t.id for t in recording.tracks_at(j, i)])  # fmt: skip
        assert holder.since == recording.times[first]
        lost += last < k
        uav = holder.holds[0] if holder.holds else 0
        (track,) = (t for t in recording.tracks_at(k, uav) if t.id == order[holder.number])
        off, P = track.belief.mean[:2] - facts.place, track.belief.covariance[:2, :2]
        told = dict(explain_person(facts))[f"track {holder.number}"]
        square = off @ np.linalg.inv(P) @ off
        assert f"error {np.hypot(*off):.2f} m, {square**0.5:.1f} σ (NEES {square:.1f}, 2 expected)" in told
    assert lost > 2


def test_stretches_have_no_gaps_differ_in_words_and_name_uavs_and_trees(mission):
    recording, history, _ = mission
    for m in range(4):
        rows = find_stretches(history, m)
        assert rows[0][0] == 0.0 and math.isinf(rows[-1][1])
        assert all(before[1] == after[0] for before, after in pairwise(rows))
        for begin, end, held, seen in rows:
            for k in np.flatnonzero((recording.times >= begin) & (recording.times < end)):
                assert (held == "lost") == (history.held[k, m] == 0)
                assert ("seen by" in seen) == history.detected[k, :, m].any()
                trees = {int(tree) for tree in re.findall(r"tree (\d+)", seen)}
                blind = ~history.shown[k, :, m] & ~history.detected[k, :, m]
                assert trees == set(history.views.hidden_by[k, blind, m].tolist()) - {-1}
    recording = mission[0]
    history = PeopleFacts(broken(recording, 1, 20))
    for m in range(recording.person_count):
        rows = find_stretches(history, m)
        assert all(one[2:] != other[2:] for one, other in pairwise(rows))
        assert (rows[0][0], rows[-1][1]) == (recording.times[0], math.inf)
    first = np.array([True, False, False, False])[:, None]
    hidden_by = np.where(first, 7, -1)[:, :, None]
    held = spell_facts(["x---"], ["----"], ["----"], [[3, 3, 3, 3]], looked=first)
    slow = with_views(held.recording, held.views.inside, hidden_by)
    assert find_stretches(slow, 0) == [(0.0, math.inf, "held", "hidden by tree 7 from UAV 0")]


@pytest.mark.parametrize(
    "options",
    [
        ("uavs.0.fails_at=0.4", "uavs.2.fails_at=0.4", "uavs.1.rate=1"),
        ("sensing.mode=ideal", "sensing.field_of_view=unlimited", "tracking.initial_tracks=none"),
        ("uavs.0.pixels=200", "uavs.1.tilt_deg=30", "tracking.management=existence", "uavs.2.mount=body"),
    ],
    ids=["broken and slow", "unlimited", "cameras"],
)
def test_pages_of_any_fleet_can_be_drawn(options):
    recording = recorded(*options, duration=1)
    gone = recording.people.copy()
    gone[4, 1] = np.nan
    shown, matched = recording.visible.copy(), recording.matched.copy()
    shown[4, :, 1] = matched[4, :, 1] = 0
    recording = replace(recording, people=gone, visible=shown, matched=matched)
    with Observer(Flight(recording)) as observer:
        for k, m in ((4, 1), (5, 3)):
            facts = make_person_facts(observer, k, m)
            groups = explain_person(facts)
            assert len(groups) == 1 if (k, m) == (4, 1) else len(groups) >= 5
            page = draw_explanation(facts, groups)
            assert page.shape[1] > 1000 and page.std() > 10


def test_a_person_who_leaves_before_being_found_is_not_said_to_be_held_then(tmp_path):
    (tmp_path / "people.csv").write_text("t,id,x,y\n0,0,40,0\n0.6,0,41,0\n0,1,-28,0\n2,1,-26,0\n", encoding="utf-8")
    recording = recorded(
        *IDEAL, "tracking.initial_tracks=none", f"people.trajectories='{tmp_path / 'people.csv'}'", duration=1
    )
    with Observer(Flight(recording)) as observer:
        lines = [explain_person(make_person_facts(observer, 0, m))[0][1] for m in (0, 1)]
    assert "absent from 0.8 s on" in lines[0] and "held from 0.2 s on" in lines[1]


@pytest.mark.parametrize(("start", "told"), [("none", "not held by the end"), ("known", "not held again by the end")])
def test_only_a_person_who_was_held_is_said_not_to_be_held_again(tmp_path, start, told):
    (tmp_path / "people.csv").write_text("t,id,x,y\n0,0,40,30\n1,0,43,30\n3,0,43,40\n", encoding="utf-8")
    path = f"people.trajectories='{tmp_path / 'people.csv'}'"
    recording = recorded(
        *IDEAL, f"tracking.initial_tracks={start}", path, "trees.density=0", planner="hover", duration=3
    )
    with Observer(Flight(recording)) as observer:
        lines = explain_person(make_person_facts(observer, recording.scan_count - 1, 0))[0][1]
    assert f"{told} of the mission" in "; ".join(lines).split("; ")


def test_a_person_smaller_than_a_pixel_is_said_to_be_so(call, tmp_path):
    far = ("trees.density=0", "uavs=[{start=[-28,0],footprint=300}]")
    recording = recorded(*far, "tracking.initial_tracks=none", duration=0.2)
    with Observer(Flight(recording)) as observer:
        (of_uav,) = explain_person(make_person_facts(observer, 1, 0))[1:2]
    assert "a person covers 0.049 pixels of its image" in of_uav.sentences
    save(recording, tmp_path / "mission.npz")
    code, out, err = call("explain", ".")
    assert code == 0 and "hidden from UAV 0, though no tree is in the way" in out
    assert err.startswith("understory: uavs: a person covers 0.049 pixels of the image of UAV 0, which will seldom")


def test_a_track_that_is_not_reported_is_said_to_be_so(all_facts):
    facts = next(a for a in all_facts if a.holders and a.holders[0].belief)
    for existence, told in ((0.51, "existence 0.5100"), (0.5, "existence 0.5000, so it is not reported")):
        doubted = replace(facts, holders=(replace(facts.holders[0], existence=existence),))
        assert told in [line for _, lines in explain_person(doubted) for line in lines]


def test_a_lost_track_is_told_of_as_long_as_any_uav_has_it(mission):
    recording, history, observer = mission
    k, m = next((k, m) for k, m in np.argwhere((history.held == 0) & history.recording.present).tolist()
                if np.any(history.held[:k, m]))  # fmt: skip
    (whole,) = make_person_facts(observer, k, m).holders
    rows = np.flatnonzero(recording.track_ids_at(k, 0) == list(recording.track_numbers)[whole.number])
    assert whole.belief is not None and len(rows) == 1
    ids = recording.track_ids.copy()
    ids[recording.track_offsets[k * 3] + rows[0]] = ids.max() + 1  # UAV 0 has it under another name
    renamed = replace(recording, track_ids=ids)
    with Observer(Flight(renamed)) as other:
        (holder,) = make_person_facts(other, k, m).holders
    assert holder.belief is not None and holder.number == whole.number


def test_of_several_tracks_of_a_person_that_of_most_uavs_is_told(mission):
    recording, history, _ = mission
    k, m = np.argwhere(history.held == 3)[0].tolist()
    row = np.flatnonzero(recording.track_ids_at(k, 0) == history.tracks[k, 0, m]) + recording.track_offsets[3 * k]
    ids = recording.track_ids + 1
    ids[row] = 0
    with Observer(Flight(replace(recording, track_ids=ids))) as observer:
        facts = make_person_facts(observer, k, m)
        groups = explain_person(facts)
    assert [holder.holds for holder in facts.holders] == [(1, 2), (0,)]
    numbers = [holder.number for holder in facts.holders]
    said = [f"held by UAVs 1 and 2 as track {numbers[0]}", f"held by UAV 0 as track {numbers[1]}"]
    assert [line for line in groups[0][1] if line.startswith("held")] == said
    assert [name for name, _ in groups if name.startswith("track")] == [f"track {number}" for number in numbers]
