"""A mission's page needs nothing but itself, and tells what the recording holds."""

import base64
import dataclasses
import hashlib
import html
import json
import os
import re
import shlex

import numpy as np
import pytest
from helpers.films import decoded
from helpers.flown_pages import EVIL, LOST, flown, lost_between_tenths
from helpers.html_pages import Page

from sim.__main__ import COMMANDS
from sim.facts.flight import Flight, find_scans
from sim.facts.metrics.holding import HOLDS
from sim.facts.people import BROKEN, PeopleFacts
from sim.facts.sightings import STATES
from sim.mission.fault import Fault
from sim.mission.recording import encode_faults
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario, encode_scenario
from sim.scenario.settings_text import list_changes
from sim.terminal.commands import load_command
from sim.views.drawing.film import lay_out_parts
from sim.views.page.data import make_page_data
from sim.views.page.page import describe_omission, make_page, write_page
from sim.views.palette import HIDDEN, HOLD_COLOURS, OUT_OF_VIEW, format_css, pale, uav_colour
from tracking.errors import InputError

OPTIONS = {"explain": ({"--time", "--target"}, {"--track"}), "frames": ({"--time", "--uav"},)}


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "mission.html").read_text()


def data_of(text):
    ((_, found),) = Page(text).of("script", type="application/json")
    return json.loads(found)


def resolved(marks, looks):
    """Marks, or rows of a table, with their looks."""
    marks = [mark if isinstance(mark, list) or mark is None else [mark] for mark in marks]
    return [mark and [looks[mark[0]], *mark[1:]] for mark in marks]


def test_nothing_comes_from_elsewhere_all_is_text_and_every_control_is_named(text):
    sheet = Page(text)
    rules = sheet.asks_for_nothing()
    assert not any("style" in given for _, given in sheet.elements)
    assert rules["default-src"] == "'none'" and rules["media-src"] == "data:" and rules["img-src"] == "data:"
    script = next(shown for given, shown in sheet.of("script") if "type" not in given)
    ((_, style),) = sheet.of("style")
    for name, shown in (("script-src", script), ("style-src", style)):
        assert rules[name] == f"'sha256-{base64.b64encode(hashlib.sha256(shown.encode()).digest()).decode()}'"
    assert "http" not in style + script and len(sheet.of("script")) == 2 and not sheet.of("img")
    assert [shown for _, shown in sheet.of("h1")] == [f"{EVIL}, seed 7"]
    assert EVIL in [shown for _, shown in sheet.of("p")]
    ids = [given["id"] for _, given in sheet.elements if "id" in given]
    assert len(ids) == len(set(ids))
    for given, shown in [*sheet.of("button"), *sheet.of("canvas"), *sheet.of("input"), *sheet.of("video")]:
        assert given.get("aria-label") or shown.strip(), given
    labelled = "".join(shown for _, shown in sheet.of("label"))
    assert len(sheet.of("select")) == len(sheet.of("label")) == 3 and "Speed" in labelled


def test_losses_are_those_made_and_commands_lead_to_them(mission, text):
    sheet = Page(text)
    items = [given for given, _ in sheet.of("li") if "data-person" in given]
    found = [tuple(int(given[f"data-{name}"]) for name in ("person", "first", "last")) for given in items]
    assert found == sorted(LOST, key=lambda loss: loss[1] - loss[2])  # the longest first, as all are as far off
    words = [shown for _, shown in sheet.of("button") if "lost" in shown]
    spans = ("0", "from 3.0 s to the end"), ("2", "1.0 to 2.0 s"), ("1", "1.6 to 1.8 s")
    assert words == [f"person {m} lost, outside the ellipse of the track {when}" for m, when in spans]
    assert "track 3 stands for no person 0.0 to 1.0 s" in [shown for _, shown in sheet.of("button")]
    known = {name: load_command(COMMANDS[name][0]) for name in ("explain", "frames")}
    lines = [shlex.split(shown) for _, shown in sheet.of("code") if shown.startswith("understory ")]
    assert {line[1] for line in lines} == {"explain", "frames"}
    for program, name, place, *options in lines:
        assert (program, place) == ("understory", "runs/it's here")
        allowed = {option for parameter in known[name].params for option in parameter.opts}
        assert set(options[::2]) in OPTIONS[name] and set(options[::2]) <= allowed
    explained = [line[4::2] for line in lines if line[1] == "explain" and "--target" in line]
    assert explained == [["3", "0"], ["1", "2"], ["1.6", "1"]]


def test_commands_name_the_scan_of_an_event_at_any_rate():
    recording = lost_between_tenths()
    sheet = Page(make_page(Flight(recording)))
    lines = [shlex.split(shown) for _, shown in sheet.of("code")]
    times = {line[line.index("--time") + 1] for line in lines if "--time" in line}
    assert "0.15" in times
    firsts = {int(given["data-first"]) for given, _ in sheet.of("li") if "data-person" in given}
    assert {find_scans(recording, float(time), None)[0] for time in times} == firsts


def test_the_data_are_those_of_the_recording(mission, text):
    recording, history = mission, PeopleFacts(mission)
    data = data_of(text)
    numbers = list(dict.fromkeys(recording.track_ids.tolist()))
    for k, i in np.argwhere(recording.working).tolist():
        scan = data["tracks"][k]
        rows = [scan["rows"][n] for n in scan["held"][i]]
        tracks = recording.tracks_at(k, i)
        for row, track in zip(rows, tracks, strict=True):
            number = numbers.index(track.id)
            assert data["looks"]["tracks"][int(row[0])][0] == f"{number}{'' if track.reported else '?'}"
            np.testing.assert_allclose(row[1:3], track.belief.mean[:2], atol=0.0051)
            along = np.array([np.cos(row[5]), np.sin(row[5])])
            spread = float(along @ track.belief.covariance[:2, :2] @ along)
            assert row[3] >= row[4] and row[3] == pytest.approx(np.sqrt(5.991 * spread), abs=0.02)
    for k, people in enumerate(data["people"]):
        assert [person is None for person in people] == [not here for here in recording.present[k]]
        rings = {m: data["looks"]["people"][person[0]][4] for m, person in enumerate(people) if person}
        assert {m for m, ring in rings.items() if ring == data["colours"]["lost"]} == {
            m for m, first, last in LOST if first <= k <= last
        }
        now = {row[0]: row[1:] for row in (data["looks"]["rows"][n] for n in data["now"][k])}
        for m in range(4):
            assert now[m][1] == (history.view_texts(m)[k] or "not there")
            assert (now[m][0] == "lost") == (now[m][2] == "lost") == (rings.get(m) == data["colours"]["lost"])
    first = [data["looks"]["rows"][n][0] for n in data["now"][16]]
    assert first[0] == 0  # the worst off is at the top
    works = [[data["looks"]["uavs"][uav[0]][3] is None for uav in row] for row in data["uavs"]]
    assert works == recording.working.tolist() and data["owner"] == [0] * 21
    assert all(row[2][4:] == [None] * 3 for row in data["uavs"][10:])
    assert data["ospa"][10][2] is None and data["ospa"][9][2] is not None
    assert data["film"]["tiles"] == [
        [b.x, b.y, b.width, b.height] for b in lay_out_parts(recording.setting).tiles.values()
    ]


def test_the_page_of_a_long_mission_has_scans_at_equal_gaps_and_says_so(monkeypatch, mission):
    monkeypatch.setattr("sim.views.page.charts.MOST_SCANS", 6)  # of 21: each fourth
    text = make_page(Flight(mission), video=None)
    data = data_of(text)
    monkeypatch.undo()
    whole = json.loads(json.dumps(make_page_data(Flight(mission), None)))
    assert data["times"] == whole["times"][::4] and data["rate"] == 5 / 4
    for k, trails in enumerate(data["trails"]):  # 3 s are 15 scans, of which at most four are shown
        assert all(until - first <= min(k + 1, 4) for _, _, first, until in trails)
    for name in ("owner", "ospa", "mean", "detections"):
        assert data[name] == whole[name][::4], name
    for kind, name in (("people", "people"), ("uavs", "uavs"), ("now", "rows")):
        for row, other in zip(data[kind], whole[kind][::4], strict=True):
            assert resolved(row, data["looks"][name]) == resolved(other, whole["looks"][name])
    firsts = {(int(g["data-person"]), int(g["data-first"]), int(g["data-last"]))
              for g, _ in Page(text).of("li") if "data-person" in g}  # fmt: skip
    assert firsts == {(2, 2, 2), (1, 2, 2), (0, 4, 5)}  # scans 5 to 9, 8, and 15 to 20
    said = "The page shows 6 of 21 scans, one each 0.8 s, and no film, because the mission is long"
    assert said in text and describe_omission(mission) == ""


def test_a_large_film_is_on_the_page_in_fewer_bytes_with_the_same_pictures(monkeypatch, tmp_path, mission, folder):
    film = (folder / "mission.mp4").read_bytes()
    monkeypatch.setattr("sim.views.page.page._LARGE_FILM", len(film) - 1)
    monkeypatch.setattr("sim.views.page.page._FILM", len(film) // 3)
    ((given, _),) = Page(make_page(Flight(mission), video=film)).of("video")
    small = base64.b64decode(given["src"].partition(",")[2])
    assert len(small) < len(film) / 2
    (tmp_path / "small.mp4").write_bytes(small)
    one, other = (decoded(path) for path in (folder / "mission.mp4", tmp_path / "small.mp4"))
    assert one[1] == pytest.approx(other[1])
    for before, after in zip(one[0], other[0], strict=True):
        assert np.abs(before.astype(float) - after).mean() < 6.0


def test_a_film_of_another_mission_is_refused_and_leaves_nothing(tmp_path, mission, folder):
    shorter = flown(scans=20)
    for film in (folder / "mission.mp4", b"no film"):
        with pytest.raises(InputError, match="video: "):
            write_page(Flight(shorter), tmp_path / "mission.html", video=film)
    assert os.listdir(tmp_path) == []


def test_replay_makes_the_page_of_the_run_again(tmp_path, call, refused):
    setting = load_scenario("forest", ["duration=0.6", "people.count=2", "trees.density=5"])
    run_mission(Trial(setting, "hover", 2), tmp_path / "out")
    text = (tmp_path / "out" / "mission.html").read_text()
    assert len(data_of(text)["times"]) == 4
    assert call("replay", "out", "--page")[0] == 0  # with the film beside
    assert (tmp_path / "out" / "mission-2.html").read_text() == text
    (tmp_path / "out" / "mission.mp4").unlink()
    assert call("replay", "out", "--page", "--out", "again.html")[0] == 0  # drawn again
    assert (tmp_path / "again.html").read_text() == text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.html", "out"]
    for wrong in (["--page", "--gui"], ["--page", "--time", "0:1"], ["--page", "--out", "x.mp4"]):
        refused("replay", "out", *wrong)


@pytest.mark.parametrize(
    "changes",
    [{"people": 0}, {"scans": 1}, {"people": 20, "uavs": 10, "scans": 3}, {"mode": "ideal"}, {"uavs": 1}],
    ids=["no people", "one scan", "many", "ideal", "one UAV"],
)
def test_missions_of_any_size_and_sensing_have_a_page(changes):
    recording = flown(**{"scans": 6, **changes})
    text = make_page(Flight(dataclasses.replace(recording, interrupted=True)))
    data = data_of(text)
    assert Page(text).of("h1") and data["film"] is None
    sizes = len(data["times"]), len(data["people"][0]), len(data["uavs"][0])
    assert sizes == (changes.get("scans", 6), changes.get("people", 4), changes.get("uavs", 3))
    assert "Interrupted at " in text


def test_settings_other_than_the_defaults_stand_on_the_page():
    recording = flown(scans=6)
    text = make_page(Flight(recording)).partition("</header>")[0]
    own = list_changes(recording.setting)
    assert own and re.findall("<code>(.*?)</code>", text) == list(map(html.escape, own))
    assert f"Settings other than the defaults: {len(own)}<" in text
    plain = dataclasses.replace(recording, scenario=encode_scenario(Scenario()))
    assert "All settings are the defaults." in make_page(Flight(plain)).partition("</header>")[0]


def test_faults_stand_at_the_top_each_kind_once_breakdowns_do_not():
    recording = flown(scans=6)
    faults = [Fault(0.2 * k, None, message) for k, message in enumerate(["<i>a</i>", "<i>a</i>", "b", "c", "d"])]
    text = make_page(Flight(dataclasses.replace(recording, faults=encode_faults(faults))))
    header = text.partition("</header>")[0]
    assert re.findall(r'<p class="warning">(.*?)</p>', header) == [
        "2 faults of the team 0.0 to 0.2 s: &lt;i&gt;a&lt;/i&gt;",
        "fault of the team at 0.4 s: b",
        "fault of the team at 0.6 s: c",
        "1 more kind of fault is listed below.",
    ]
    broken = Fault(0.0, 1, "broke down, hovers from now on")
    still = dataclasses.replace(recording, ospa=np.where(np.arange(3)[:, None] == 1, np.nan, recording.ospa))
    header = make_page(Flight(dataclasses.replace(still, faults=encode_faults([broken])))).partition("</header>")[0]
    assert 'class="warning"' not in header


def test_bars_of_the_timeline_are_the_states_of_the_history(mission, text):
    timeline, history = data_of(text)["timeline"], PeopleFacts(mission)
    shades = [*timeline["shades"]]
    for m, row in enumerate(timeline["rows"]):
        for i, lane in enumerate(row["lanes"]):
            states = [STATES[state] if state != BROKEN else None for state in history.camera_states[:, i, m]]
            drawn = {k: shades[bar[0]] for bar in lane for k in range(bar[1], bar[2] + 1)}
            colours = (OUT_OF_VIEW, HIDDEN, pale(uav_colour(i)), uav_colour(i))
            known = dict(zip(STATES[1:], map(format_css, colours), strict=True))
            assert drawn == {k: known[state] for k, state in enumerate(states) if state in known}
        drawn = {k: shades[bar[0]] for bar in row["holds"] for k in range(bar[1], bar[2] + 1)}
        holds = {k: HOLDS[hold] for k, hold in enumerate(history.hold_states[:, m]) if HOLDS[hold] != "absent"}
        assert drawn == {k: format_css(HOLD_COLOURS[hold]) for k, hold in holds.items()}
