"""Explanations: against geometry, the trackers' numbers, frames without trees, and later flight."""

import math
import re
from dataclasses import replace
from itertools import combinations, pairwise

import cv2
import numpy as np
import pytest
from helpers.flights import IDEAL, recorded
from helpers.people_facts import spell_facts, with_views
from helpers.recordings import broken

from sim.facts.explain.explanation import explain_person, find_stretches
from sim.facts.explain.observation import Observer
from sim.facts.explain.person import make_person_facts
from sim.facts.explain.planned_visibility import find_planned_visibility
from sim.facts.explain.track_story import TrackFacts
from sim.facts.flight import Flight
from sim.facts.people import PeopleFacts
from sim.facts.rerender import Rerenderer
from sim.facts.sightings import make_frame_facts
from sim.facts.tracking_replay import replay_tracking
from sim.facts.words import format_percent
from sim.mission.archive import save
from sim.views import explain_picture as picture
from sim.views.drawing.lettering import measure_width
from sim.views.explain_picture import draw_explanation
from sim.views.frames.annotation import TRACK, annotate


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


def test_stories_of_tracks_render_each_frame_once(mission, monkeypatch):
    recording = mission[0]
    asked, rendered = [], Rerenderer.rendered
    monkeypatch.setattr(Rerenderer, "rendered", lambda self, *frame: asked.append(frame) or rendered(self, *frame))
    with Observer(Flight(recording)) as observer:
        detections = [d for n in range(len(recording.track_numbers)) for d in TrackFacts(observer, n).detections]
    assert len(detections) > len(asked) == len(set(asked)) > 5


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
            assert w.sighting.status.startswith("in view" if recording.matched[k, i, m] else "hidden by tree")
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
            seen |= {word for word in ("in the gate of track", "not detected", "too, weight") if word in text}
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
    assert seen == {"in the gate of track", "not detected", "too, weight"}


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
        (axes,) = (
            re.fullmatch(r"standard deviations ([\d.]+) × ([\d.]+) m", line) for line in told if "deviat" in line
        )
        spread, parting = (np.trace(P) / 2, np.hypot((P[0, 0] - P[1, 1]) / 2, P[0, 1]))
        assert float(axes[1]) == pytest.approx(np.sqrt(spread + parting), abs=0.0051)
        assert float(axes[2]) == pytest.approx(np.sqrt(spread - parting), abs=0.0051)
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


def test_a_person_smaller_than_a_pixel_is_said_to_be_so(call, tmp_path):
    far = ("trees.density=0", "uavs=[{start=[-28,0],footprint=300}]")
    recording = recorded(*far, "tracking.initial_tracks=none", duration=0.2)
    with Observer(Flight(recording)) as observer:
        (of_uav,) = explain_person(make_person_facts(observer, 1, 0))[1:2]
    assert "a person covers 0.049 pixels of its image" in of_uav.sentences
    save(recording, tmp_path / "mission.npz")
    code, out, err = call("explain", ".")
    assert code == 0 and "not shown to UAV 0, though no tree is in the way" in out
    assert err.startswith("understory: uavs: a person covers 0.049 pixels of the image of UAV 0, which will seldom")


def test_a_track_that_is_not_reported_is_said_to_be_so(all_facts):
    facts = next(a for a in all_facts if a.holders and a.holders[0].belief)
    for existence, told in ((0.51, "existence 0.5100"), (0.5, "existence 0.5000, so it is not reported")):
        doubted = replace(facts, holders=(replace(facts.holders[0], existence=existence),))
        assert told in [line for _, lines in explain_person(doubted) for line in lines]


def test_the_page_shows_whole_frames_and_the_pixels_round_the_person(mission, all_facts):
    recording, _, observer = mission
    facts = next(a for a in all_facts if any(w.found for w in a.observations))
    page = draw_explanation(facts, explain_person(facts))
    first = min((w for w in facts.observations if w.found), key=lambda w: w.away)
    image = observer.again.image(facts.k, first.uav)
    frame, _ = annotate(image, make_frame_facts(recording, facts.k, first.uav), 512)
    tiles, words = np.split(page, [1060], axis=1)
    found = cv2.matchTemplate(tiles, frame, cv2.TM_SQDIFF)
    y, x = np.unravel_index(found.argmin(), found.shape)
    np.testing.assert_array_equal(tiles[y : y + 512, x : x + 512], frame)  # nothing stands on its names and marks
    inset = cv2.resize(image, None, fx=10, fy=10, interpolation=cv2.INTER_NEAREST)
    u, v = np.floor(first.found.pixel).astype(int)
    part = inset[10 * (v - 2) : 10 * (v + 3), 10 * (u - 2) : 10 * (u + 3)]
    assert cv2.matchTemplate(np.ascontiguousarray(words), part, cv2.TM_SQDIFF).min() < 1.0


def test_the_legend_of_the_page_lists_the_marks_of_map_and_frames(mission, all_facts, monkeypatch):
    recording = mission[0]
    written = []
    monkeypatch.setattr(picture, "write", lambda image, text, at, style, align=0.0: written.append(text))
    monkeypatch.setattr(picture, "annotate", lambda image, sight, size: (image, {f"mark {sight.uav}"}))
    monkeypatch.setattr(picture, "find_marks", lambda names: [(name, lambda image, at: None) for name in sorted(names)])
    gone = replace(recording, track_means=recording.track_means + 1000.0)
    for flown, tracks in ((recording, {TRACK}), (gone, set())):  # which the map may have, though no frame has
        written.clear()
        with Observer(Flight(flown)) as observer:
            draw_explanation(replace(all_facts[0], observer=observer), ())
        assert {text for text in written if "mark" in text or text == TRACK} == {f"mark {i}" for i in range(3)} | tracks


def test_names_on_the_map_keep_clear_of_one_another(tmp_path, monkeypatch):
    near = "t,id,x,y\n0,0,-28,0\n2,0,-27,0\n0,1,-25,0\n2,1,-24,0\n"  # person 1 stands where a name of person 0 would
    (tmp_path / "people.csv").write_text(near, encoding="utf-8")
    recording = recorded(*IDEAL, f"people.trajectories='{tmp_path / 'people.csv'}'", duration=1)
    boxes = {}

    def written(image, text, at, style, align=0.0):
        if len(image) > 512:  # no frame
            reach = np.array([0.0, style.size / 2])
            boxes[text] = (at - reach, at + reach + (measure_width(text, style), 0.0))

    monkeypatch.setattr("sim.views.drawing.labels.write", written)
    with Observer(Flight(recording)) as observer:
        draw_explanation(make_person_facts(observer, 2, 0), ())
    assert {"person 0", "0", "1", "UAV 0"} <= boxes.keys()
    for (low, high), (left, right) in combinations(boxes.values(), 2):
        assert (np.minimum(high, right) - np.maximum(low, left)).min() < 1.0


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


def test_lines_of_a_uav_are_about_its_own_track_of_the_person():
    recording = recorded(*IDEAL, "network.range=1", "sensing.false_alarms=3", "tracking.clutter_density=1e-3")
    replay = replay_tracking(recording)
    ids, others = recording.track_ids.copy(), recording.cells(recording.track_offsets)[1] > 0
    swapped = dict(zip(ids[others][:2].tolist(), ids[others][1::-1].tolist(), strict=True))
    ids[others] = [swapped.get(id_, id_) for id_ in ids[others].tolist()]  # ids of tracks that UAV 0 does not share
    recording = replace(recording, track_ids=ids)
    for account in [account for k in range(1, len(recording.times)) for i, account in replay.accounts_at(k) if i > 0]:
        renamed = np.array([swapped.get(id_, id_) for id_ in account.association.ids.tolist()])
        account.association = replace(account.association, ids=renamed)
    kinds = {"several": 0, "own": 0, "none": 0, "too": 0}
    with Observer(Flight(recording)) as observer:
        observer.replay = replay
        tracks, numbers = observer.flight.people.tracks, recording.track_numbers
        held_at = np.argwhere((tracks >= 0).any(axis=1)).tolist()
        for k, m in ((k, m) for k, m in held_at if k > 0):  # tracks known at the start have their old ids
            facts = make_person_facts(observer, k, m)
            groups, fleet = dict(explain_person(facts)), tracks[k, :, m]
            held = {id_: np.flatnonzero(fleet == id_) for id_ in fleet[fleet >= 0].tolist()}
            assert {f"track {numbers[id_]}" for id_ in held} == {name for name in groups if name.startswith("track")}
            kinds["several"] += len(held) > 1
            for id_, uavs in held.items():
                (track,) = (t for t in recording.tracks_at(k, int(uavs[0])) if t.id == id_)
                off, P = track.belief.mean[:2] - recording.people[k, m], track.belief.covariance[:2, :2]
                square = off @ np.linalg.inv(P) @ off
                words = f"error {np.hypot(*off):.2f} m, {square**0.5:.1f} σ (NEES {square:.1f}, 2 expected)"
                assert words in groups[f"track {numbers[id_]}"]
            most = max(held, key=lambda id_: (len(held[id_]), -id_))
            for i in range(3):
                own = int(fleet[i]) if fleet[i] >= 0 else most
                named = set(tracks[k, i].tolist()) - {-1}
                a, lines = replay.association(k, i), "\n".join(groups[f"UAV {i}"])
                if fleet[i] < 0 and most in named:
                    other = tracks[k, i].tolist().index(most)
                    assert f"holds person {other} as track {numbers[most]}" in lines and "expected" not in lines
                    assert f"track {numbers[most]}" not in groups["intents"][i]
                    kinds["none"] += 1
                    continue
                rows = np.flatnonzero(a.ids == own)
                told = [(str(numbers[own]), format_percent(a.before.visible[t])) for t in rows]
                assert re.findall(r"expected track (\d+) in plain view with (.+)", lines) == told
                assert set(re.findall(r"the gate of track (\d+) too", lines)) <= {str(numbers[own])}
                kinds["too"] += "too, weight" in lines
                beliefs = [t.belief for t in recording.tracks_at(k, i) if t.id == own]
                if beliefs and facts.planned[i]:
                    plan = find_planned_visibility(recording, k, i, m, beliefs[0])
                    np.testing.assert_array_equal(facts.planned[i].track, plan.track)
                    assert f": track {numbers[own]} " in groups["intents"][i]
                    kinds["own"] += own != most
    assert min(kinds.values()) > 2, kinds
