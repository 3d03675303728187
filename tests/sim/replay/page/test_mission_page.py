"""A mission's page needs nothing but itself, tells what the recording holds, and works in a browser by keys alone."""

import base64
import dataclasses
import hashlib
import json
import os
import re
import shlex

import av
import cv2
import numpy as np
import pytest
from helpers import synthetic
from helpers.browser import CHROMIUM, Browser
from helpers.html_pages import Page
from typer.main import get_command
from typer.testing import CliRunner

from sim.__main__ import app
from sim.drawing.video import Film, Video, parts_of
from sim.mission.mission import Trial
from sim.recording.fault_text import recorded
from sim.recording.recording import Recorder
from sim.replay.event import INCIDENTS
from sim.replay.events import events_of
from sim.replay.frames.sightings import Sight
from sim.replay.history import History
from sim.replay.page.data import HIDDEN, OUT, SEEN, codes, page_data
from sim.replay.page.page import page, write_page
from sim.running.run import run
from sim.scenario.errors import InputError
from sim.scenario.loading import load
from sim.scenario.scenario import resolved
from sim.sensing.fault import Fault

EVIL = "</script><script>document.title='taken'</script><img src=x onerror=alert(1)> & \"it's\""
LOST = ((2, 5, 9), (1, 8, 8), (0, 15, 20))  # person, first and last scan
OPTIONS = {"explain": {"--time", "--target"}, "frames": {"--time", "--uav"}}
FAULTS = [Fault(0.0, None, EVIL), Fault(1.0, None, EVIL), Fault(2.0, 2, "broke down, hovers from now on")]


class Sheet(Page):
    VOID = (*Page.VOID, "input")


def flown(scans=21, planner=EVIL, **changes):
    """A made-up mission, and its scenario."""
    setting = synthetic.scenario(**changes)
    trees, recorder = synthetic.forest(setting), Recorder()
    for snapshot in synthetic.snapshots(setting, trees, scans):
        recorder.add(snapshot)
    recording = recorder.recording(scenario=resolved(setting), planner=planner, seed=7, forest=trees)
    return recording, setting


def eventful():
    """A mission with losses known beforehand, a UAV that breaks down at scan 10, contacts and faults."""
    recording, setting = flown()
    means, ospa = recording.track_means.copy(), recording.ospa.copy()
    scan = np.repeat(np.arange(63), np.diff(recording.track_offsets)) // 3
    for person, first, last in LOST:
        means[(recording.track_ids == person + 1) & (first <= scan) & (scan <= last), :2] += 4.0
    ospa[10:, 2] = np.nan
    return dataclasses.replace(recording, track_means=means, ospa=ospa, faults=recorded(FAULTS)), setting


def film_of(path, recording, setting):
    with Video(path, Film(setting, recording.forest, planner="hover"), fps=5) as video:
        for k in range(len(recording.times)):
            snapshot = recording.snapshot(k)
            video.add(snapshot, synthetic.frames(setting, recording.forest, snapshot))
    return path


@pytest.fixture(scope="module")
def mission():
    return eventful()


@pytest.fixture(scope="module")
def folder(tmp_path_factory, mission):
    folder = tmp_path_factory.mktemp("run")
    film = film_of(folder / "mission.mp4", *mission)
    write_page(*mission, folder / "mission.html", video=film, place="runs/it's here")
    return folder


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "mission.html").read_text()


def data_of(text):
    ((_, found),) = Sheet(text).of("script", type="application/json")
    return json.loads(found)


def test_nothing_comes_from_elsewhere_and_no_other_script_may_run(text):
    sheet = Sheet(text)
    for tag, given in sheet.elements:
        for name in ("src", "href", "srcset", "action", "data", "poster"):
            assert given.get(name, "#").startswith(("#", "data:")), (tag, name)
        assert not any(name.startswith("on") for name in given) and "style" not in given
    policy = next(g["content"] for g, _ in sheet.of("meta") if g.get("http-equiv") == "Content-Security-Policy")
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'" and rules["media-src"] == "data:" and rules["img-src"] == "data:"
    script = next(shown for given, shown in sheet.of("script") if "type" not in given)
    ((_, style),) = sheet.of("style")
    for name, shown in (("script-src", script), ("style-src", style)):
        assert rules[name] == f"'sha256-{base64.b64encode(hashlib.sha256(shown.encode()).digest()).decode()}'"
    assert "url(" not in style and "http" not in style + script


def test_whatever_was_typed_is_text(text):
    sheet = Sheet(text)
    assert len(sheet.of("script")) == 2 and not sheet.of("img")
    assert [shown for _, shown in sheet.of("h1")] == [f"{EVIL}, seed 7"]
    assert EVIL in [shown for _, shown in sheet.of("p")]


def test_every_id_is_there_once_and_every_control_has_a_name(text):
    sheet = Sheet(text)
    ids = [given["id"] for _, given in sheet.elements if "id" in given]
    assert len(ids) == len(set(ids))
    for given, shown in [*sheet.of("button"), *sheet.of("canvas"), *sheet.of("input"), *sheet.of("video")]:
        assert given.get("aria-label") or shown.strip(), given
    labelled = "".join(shown for _, shown in sheet.of("label"))
    assert len(sheet.of("select")) == len(sheet.of("label")) == 3 and "Speed" in labelled


def test_losses_are_those_made_and_commands_lead_to_them(mission, text):
    sheet = Sheet(text)
    items = [given for given, _ in sheet.of("li") if "data-person" in given]
    found = [tuple(int(given[f"data-{name}"]) for name in ("person", "first", "last")) for given in items]
    assert found == sorted(LOST, key=lambda loss: loss[1])
    words = [shown for _, shown in sheet.of("button") if "lost" in shown]
    assert words == ["person 2 lost 1.0 to 1.8 s", "person 1 lost at 1.6 s", "person 0 lost from 3.0 s to the end"]
    assert "track 3 stands for no person 0.0 to 0.8 s" in [shown for _, shown in sheet.of("button")]
    known = get_command(app).commands
    lines = [shlex.split(shown) for _, shown in sheet.of("code")]
    assert {line[1] for line in lines} == {"explain", "frames"}
    for program, name, place, *options in lines:
        assert (program, place) == ("understory", "runs/it's here")
        assert set(options[::2]) == OPTIONS[name] <= {o for parameter in known[name].params for o in parameter.opts}
    explained = [line[4::2] for line in lines if line[1] == "explain"]
    assert explained == [["1.0", "2"], ["1.6", "1"], ["3.0", "0"]]


def test_the_data_are_those_of_the_recording(mission, text):
    recording, setting = mission
    data = data_of(text)
    numbers = list(dict.fromkeys(recording.track_ids.tolist()))
    for k, i in ((0, 0), (7, 1), (20, 1)):
        rows = data["tracks"][k][i]
        tracks = recording.tracks_at(k, i)
        assert [numbers[int(row[0])] for row in rows] == [track.id for track in tracks]
        for row, track in zip(rows, tracks, strict=True):
            np.testing.assert_allclose(row[1:3], track.belief.mean[:2], atol=0.0051)
            along = np.array([np.cos(row[5]), np.sin(row[5])])
            spread = float(along @ track.belief.covariance[:2, :2] @ along)
            assert row[3] >= row[4] and row[3] == pytest.approx(np.sqrt(5.991 * spread), abs=0.02)
        for m, person in enumerate(Sight.of(recording, setting, k, i).people):
            code = data["codes"][k][i][m]
            if code >= HIDDEN:
                assert not person.detected and person.hidden_by[:1] == ((code - HIDDEN - 1,) if code > HIDDEN else ())
            assert (code == SEEN) == person.detected
    assert [people[3] is None for people in data["people"]] == [k < 5 for k in range(21)]
    assert data["works"] == [[1, 1, int(k < 10)] for k in range(21)]
    assert data["ospa"][10][2] is None and data["ospa"][9][2] is not None
    assert data["film"]["tiles"] == [[b.x, b.y, b.width, b.height] for b in parts_of(setting).tiles.values()]


def test_five_uavs_have_five_colours_and_people_states_of_their_own():
    data = data_of(page(*flown(uavs=5)))
    assert len(set(data["colours"]["uavs"][:5])) == 5
    history = History.of(*flown(uavs=5))
    assert data["holds"] == history.hold_states.tolist()
    assert data["texts"][data["told"][0][0]].startswith("seen by UAV")


def test_between_two_frames_of_a_slow_camera_the_first_counts(mission):
    history = History.of(*mission)
    looked = history.looked & (np.arange(21) % 5 == 0)[:, None]
    slow = dataclasses.replace(
        history,
        looked=looked,
        **{n: getattr(history, n) & looked[:, :, None] for n in ("inside", "shown", "detected")},
    )
    every = codes(history)
    for k in range(21):
        expected = np.where(history.present[k] & history.working[k][:, None], every[k - k % 5], OUT)
        there = history.present[k - k % 5]
        np.testing.assert_array_equal(codes(slow)[k][:, there], expected[:, there])


def test_what_broke_and_what_was_touched_is_told_once(mission):
    told = [event for event in events_of(*mission) if event.kind in INCIDENTS]
    assert [(event.first, event.last, f"{event.text} {event.when}") for event in told] == [
        (0, 5, "2 faults of the team 0.0 to 1.0 s"),
        (3, 5, "UAV 0 touched the canopy of tree 4 0.6 to 1.0 s"),
        (3, 5, "UAV 2 touched the ground 0.6 to 1.0 s"),
        (10, 10, "UAV 2 broke down at 2.0 s"),
    ]


def test_a_film_of_another_mission_is_refused_and_leaves_nothing(tmp_path, mission, folder):
    shorter, setting = flown(scans=20)
    for film in (folder / "mission.mp4", b"no film"):
        with pytest.raises(InputError, match="video: "):
            write_page(shorter, setting, tmp_path / "mission.html", video=film)
    assert os.listdir(tmp_path) == []


def test_replay_makes_the_page_of_the_run_again(tmp_path, monkeypatch):
    setting = load("forest", ["duration=0.6", "people.count=2", "trees.density=5"])
    run(Trial(setting, "hover", 2), tmp_path / "out")
    text = (tmp_path / "out" / "mission.html").read_text()
    assert len(data_of(text)["times"]) == 4
    runner = CliRunner()
    monkeypatch.chdir(tmp_path)
    assert runner.invoke(app, ["replay", "out", "--page"]).exit_code == 0  # with the film beside
    assert (tmp_path / "out" / "mission-2.html").read_text() == text
    (tmp_path / "out" / "mission.mp4").unlink()
    told = runner.invoke(app, ["replay", "out", "--page", "--out", "again.html"])  # drawn again
    assert told.exit_code == 0, told.output
    assert (tmp_path / "again.html").read_text() == text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.html", "out"]
    for wrong in (["--page", "--gui"], ["--page", "--time", "0:1"], ["--page", "--out", "x.mp4"]):
        assert isinstance(runner.invoke(app, ["replay", "out", *wrong]).exception, InputError)


@pytest.mark.parametrize(
    "changes",
    [{"people": 0}, {"scans": 1}, {"people": 20, "uavs": 10, "scans": 3}, {"mode": "ideal"}, {"uavs": 1}],
    ids=["nobody", "one scan", "many", "ideal", "one UAV"],
)
def test_odd_missions_have_a_page_too(changes):
    recording, setting = flown(**{"scans": 6, **changes})
    text = page(dataclasses.replace(recording, interrupted=True), setting)
    data = data_of(text)
    assert Sheet(text).of("h1") and data["film"] is None
    assert (len(data["times"]), len(data["people"][0]), len(data["uavs"][0])) == (
        changes.get("scans", 6),
        changes.get("people", 4),
        changes.get("uavs", 3),
    )
    assert "Interrupted at " in text


def test_faults_stand_at_the_top_each_kind_once_breakdowns_do_not():
    recording, setting = flown(scans=6)
    faults = [Fault(0.2 * k, None, message) for k, message in enumerate(["<i>a</i>", "<i>a</i>", "b", "c", "d"])]
    text = page(dataclasses.replace(recording, faults=recorded(faults)), setting)
    header = text.partition("</header>")[0]
    assert re.findall(r'<p class="warning">(.*?)</p>', header) == [
        "2 faults of the team 0.0 to 0.2 s: &lt;i&gt;a&lt;/i&gt;",
        "fault of the team at 0.4 s: b",
        "fault of the team at 0.6 s: c",
        "1 more kinds of fault are listed below.",
    ]
    broken = Fault(0.0, 1, "broke down, hovers from now on")
    still = dataclasses.replace(recording, ospa=np.where(np.arange(3)[:, None] == 1, np.nan, recording.ospa))
    assert (
        'class="warning"'
        not in page(dataclasses.replace(still, faults=recorded([broken])), setting).partition("</header>")[0]
    )


def test_the_data_of_forty_seconds_weigh_less_than_a_megabyte():
    recording, setting = flown(scans=201)
    data = page_data(recording, setting, History.of(recording, setting), events_of(recording, setting), None)
    assert len(json.dumps(data, separators=(",", ":"))) < 500_000


SMALL = 24  # pixels of a camera's picture that are compared, across
PROBE = f"""(() => {{ const c = document.createElement('canvas'); c.width = c.height = {SMALL};
  const d = c.getContext('2d'); d.imageSmoothingQuality = 'high';
  d.drawImage(document.querySelectorAll('#cameras canvas')[1], 0, 0, {SMALL}, {SMALL});
  return [...d.getImageData(0, 0, {SMALL}, {SMALL}).data].filter((_, i) => i % 4 < 3); }})()"""
STILL = (
    "!film.seeking && Math.abs(film.currentTime - (Number(slider.value) + .5) / 5) < 1e-3 &&"
    " Number(document.getElementById('cameras').dataset.time) === film.currentTime"
)


def now(browser):
    """The state of the page: scan, time, and people whose losses are marked."""
    browser.until(STILL)
    marked = (
        "[...document.querySelectorAll('#losses li[aria-current][data-person]')].map(li => Number(li.dataset.person))"
    )
    return browser.run(f"[Number(slider.value), document.getElementById('now').value, {marked}]")


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
def test_a_browser_follows_slider_keys_lists_and_charts(tmp_path, mission, folder):
    with Browser(tmp_path / "profile") as browser:
        browser.open(folder / "mission.html")
        assert now(browser) == [0, "0.0 s", []]
        _follows_the_slider(browser, mission, folder)
        _follows_keys(browser)
        _follows_clicks(browser)
        _plays(browser)
        assert browser.run("document.title") == f"{EVIL}, seed 7"
        for width in (1280, 900):
            browser.resize(width, 800)
            assert browser.run("document.documentElement.scrollWidth") == width
        small = (
            "[...document.querySelectorAll('main *')].filter(e => e.textContent.trim() && "
            "parseFloat(getComputedStyle(e).fontSize) < 13).map(e => e.outerHTML)"
        )
        assert browser.run(small) == []
        assert browser.complaints == []
        assert [url for url in browser.requests if not url.startswith("data:")] == [
            (folder / "mission.html").as_uri()[:100]
        ]


def _follows_the_slider(browser, mission, folder):
    with av.open(str(folder / "mission.mp4")) as container:
        images = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    box = parts_of(mission[1]).tiles[1]
    maps = []
    for k in (13, 6, 20, 0):
        browser.run(f"slider.value = {k}; slider.dispatchEvent(new Event('input'))")
        assert now(browser)[:2] == [k, f"{k / 5:.1f} s"]
        # The camera's picture is that of this scan's frame of the film.
        seen = np.array(browser.run(PROBE), dtype=float).reshape(SMALL, SMALL, 3)
        gaps = [np.abs(_small(image[box.slices]) - seen).mean() for image in images]
        assert int(np.argmin(gaps)) == k, gaps
        # The cursor stands at the thumb of the slider, and the map has changed.
        left, start, wide = browser.run(
            "[cursor.getBoundingClientRect().left + 1, slider.getBoundingClientRect().left, slider.offsetWidth]"
        )
        assert left == pytest.approx(start + 8 + k / 20 * (wide - 16), abs=1.5)
        maps.append(hashlib.sha256(browser.run("map.toDataURL()").encode()).hexdigest())
    assert len(set(maps)) == 4


def _small(image):
    return cv2.resize(image, (SMALL, SMALL), interpolation=cv2.INTER_AREA).astype(float)


def _follows_keys(browser):
    def after(*keys):
        for key in keys:
            browser.press(key)
        return now(browser)

    assert after("ArrowRight", "ArrowRight", "ArrowLeft") == [1, "0.2 s", []]
    assert after("n") == [5, "1.0 s", [2]]
    assert after("n") == [8, "1.6 s", [2, 1]]
    assert after("n", "n") == [15, "3.0 s", [0]]
    assert after("p") == [8, "1.6 s", [2, 1]]
    assert after("End")[0] == 20 and after("ArrowRight")[0] == 20 and after("Home")[0] == 0
    # By tabs alone to the slider, which then moves a scan at a time.
    for _ in range(40):
        browser.press("Tab")
        if browser.run("document.activeElement.id") == "slider":
            break
    assert browser.run("getComputedStyle(slider).outlineStyle") == "solid"
    assert after("ArrowRight")[0] == 1


def _follows_clicks(browser):
    x, y = browser.run(
        "(() => { const b = document.querySelector('#losses li[data-person=\"0\"] button');"
        "b.scrollIntoView({block: 'center'}); const r = b.getBoundingClientRect();"
        "return [r.x + r.width / 2, r.y + r.height / 2]; })()"
    )
    browser.point(x, y, click=True)
    assert now(browser) == [15, "3.0 s", [0]]
    assert browser.run("document.querySelector('#losses li[data-person=\"0\"] details').open")
    for chart in ("timeline", "ospa"):
        for k in (4, 17):
            x, y = browser.run(
                f"(() => {{ const c = document.getElementById('{chart}'); c.scrollIntoView({{block: 'center'}});"
                "const s = slider.getBoundingClientRect(), r = c.getBoundingClientRect();"
                f"return [s.x + 8 + {k} / 20 * (s.width - 16), r.y + r.height / 2]; }})()"
            )
            browser.point(x, y, click=True)
            assert now(browser)[0] == k
    # The pointer over a person tells who that is.
    browser.run("follow.value = 'person 1'; follow.dispatchEvent(new Event('change')); map.scrollIntoView()")
    box = browser.run("(() => { const r = map.getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; })()")
    browser.point(box[0] + box[2] / 2, box[1] + box[3] / 2)
    assert re.match(r"person 1: .*track \d of ", browser.run("tip.textContent"))


def _plays(browser):
    browser.press("Home")
    now(browser)
    browser.run("speed.value = 4; speed.dispatchEvent(new Event('change'))")
    browser.run("document.activeElement.blur()")
    browser.press(" ", " ")
    browser.until("Number(slider.value) > 3")
    browser.until("Number(slider.value) === 20 && film.paused", seconds=10)
    assert browser.run("play.textContent") == "Play"
