"""A mission's page in a browser: slider, keys, lists and charts lead to the same scan of film and map."""

import dataclasses
import hashlib
import json
import re
import time

import av
import cv2
import numpy as np
import pytest
from helpers import synthetic
from helpers.browser import SMALL_WORDS, Browser, needs_browser
from helpers.flown_pages import EVIL
from helpers.identities import SWAP, swapping
from helpers.recordings import record

from sim.facts.event import IDENTITIES
from sim.facts.flight import Flight
from sim.facts.metrics.holding import HOLDS
from sim.facts.people import BROKEN
from sim.facts.sightings import STATES
from sim.views.drawing.film import lay_out_parts
from sim.views.page.page import write_page
from sim.views.palette import LOST
from tracking.geometry.camera import Pose

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
    """The state of the page: scan, time, and people with marked losses."""
    browser.until(STILL)
    rows = "[...document.querySelectorAll('#losses li[aria-current][data-person]')]"
    marked = f"{rows}.map(li => Number(li.dataset.person))"
    return browser.run(f"[Number(slider.value), document.getElementById('now').value, {marked}]")


@needs_browser
@pytest.mark.parametrize("people", [3, 60])
def test_on_paper_the_page_is_a_summary_of_one_sheet(tmp_path, mission, people):
    """Whatever the window, and however many people and faults there are; lists end with what they leave out."""
    if people > 3:
        faults = [{"time": k / 5, "uav": 0, "message": f"detector: {'long ' * 40}{k}", "trace": []} for k in range(9)]
        crowd = record(41, setting=synthetic.scenario(uavs=3, people=people, mode="ideal"))
        mission = dataclasses.replace(crowd, faults=json.dumps(faults), interrupted=True)
    write_page(Flight(mission), tmp_path / "mission.html")
    with Browser(tmp_path / "profile") as browser:
        for width in (1600, 500):
            browser.resize(width, 900)
            browser.open(tmp_path / "mission.html")
            assert browser.print() == 1
        listed = browser.run("document.querySelectorAll('#losses li').length")
        left = browser.run("document.querySelector('#losses + .paper')?.textContent ?? ''")
        assert left == (f"and {listed - 6} more, in mission.html" if listed > 6 else "") and (listed > 6) == (
            people > 3
        )


@needs_browser
def test_a_browser_follows_slider_keys_lists_and_charts(tmp_path, mission, folder):
    with Browser(tmp_path / "profile") as browser:
        browser.open(folder / "mission.html")
        assert now(browser) == [0, "0.0 s", []]
        _lists_what_is_drawn(browser, Flight(mission))
        _follows_the_slider(browser, mission, folder)
        _draws_scans_from_their_instants(browser)
        _follows_keys(browser)
        _follows_clicks(browser)
        _plays(browser)
        assert browser.run("document.title") == f"{EVIL}, seed 7"
        for width in (1280, 900):
            browser.resize(width, 800)
            assert browser.run("document.documentElement.scrollWidth") == width
        assert browser.run(SMALL_WORDS) == [] == browser.complaints
        assert browser.requests_elsewhere() == [(folder / "mission.html").as_uri()[:100]]
        _follows_switched_tracks(browser, tmp_path / "swap.html")
        _names_views_where_no_other_view_is(browser, tmp_path / "views.html")
        assert browser.complaints == []


def _follows_the_slider(browser, mission, folder):
    with av.open(str(folder / "mission.mp4")) as container:
        images = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    box = lay_out_parts(mission.setting).tiles[1]
    maps = []
    for k in (13, 6, 20, 0):
        browser.run(f"slider.value = {k}; slider.dispatchEvent(new Event('input'))")
        assert now(browser)[:2] == [k, f"{k / 5:.1f} s"]
        # The camera's picture becomes that of this scan's frame of the film, which may be presented after the seek.
        end = time.monotonic() + 20.0
        while (shown := _nearest_frame(browser, [image[box.slices] for image in images])) != k:
            assert time.monotonic() < end, shown
            time.sleep(0.02)
        # The cursor stands at the thumb of the slider, and the map has changed.
        left, start, wide = browser.run(
            "[cursor.getBoundingClientRect().left + 1, slider.getBoundingClientRect().left, slider.offsetWidth]"
        )
        assert left == pytest.approx(start + 8 + k / 20 * (wide - 16), abs=1.5)
        maps.append(hashlib.sha256(browser.run("map.toDataURL()").encode()).hexdigest())
    assert len(set(maps)) == 4


def _nearest_frame(browser, pictures):
    """The number of the picture that the camera's view on the page is most like."""
    seen = np.array(browser.run(PROBE), dtype=float).reshape(SMALL, SMALL, 3)
    return int(np.argmin([np.abs(_small(picture) - seen).mean() for picture in pictures]))


COLUMNS = """(name) => {
  const c = document.getElementById(name), d = document.createElement('canvas').getContext('2d');
  const x = Math.round(cursor.getBoundingClientRect().left + 1 - c.getBoundingClientRect().left);
  [d.canvas.width, d.canvas.height] = [9, c.height];
  d.drawImage(c, 4 - x, 0);
  const all = [...d.getImageData(0, 0, 9, c.height).data];
  const pixel = (n) => all.slice(4 * n, 4 * n + 4);
  return [0, 4, 8].map((dx) => [...Array(c.height).keys()].map((y) => pixel(9 * y + dx)));
}"""


def _draws_scans_from_their_instants(browser):
    """The loss that begins at scan 15 is red from the cursor on, where the tick of 3 s stands."""
    browser.run("slider.value = 15; slider.dispatchEvent(new Event('input'))")
    before, _, after = np.array(browser.run(f"({COLUMNS})('timeline')"))[..., :3]
    red = np.all(after == LOST, axis=1)
    assert red.any() and not np.all(before == LOST, axis=1)[red].any()
    ticks = np.array(browser.run(f"({COLUMNS})('ospa')"))[:, -20, 3]  # in the middle of a tick
    assert (ticks > 0).tolist() == [False, True, False]
    browser.press("Home")


def _small(image):
    return cv2.resize(image, (SMALL, SMALL), interpolation=cv2.INTER_AREA).astype(float)


def _follows_keys(browser):
    def after(*keys):
        for key in keys:
            browser.press(key)
        return now(browser)

    assert after("ArrowRight", "ArrowRight", "ArrowLeft") == [1, "0.2 s", []]
    assert after("n") == [5, "1.0 s", [2]] and after("n") == [8, "1.6 s", [2, 1]]
    assert after("n", "n") == [15, "3.0 s", [0]] and after("p") == [8, "1.6 s", [2, 1]]
    assert after("End")[0] == 20 and after("ArrowRight")[0] == 20 and after("Home")[0] == 0
    # By tabs alone to the slider, which then moves a scan at a time.
    for _ in range(40):
        browser.press("Tab")
        if browser.run("document.activeElement.id") == "slider":
            break
    assert browser.run("getComputedStyle(slider).outlineStyle") == "solid" and after("ArrowRight")[0] == 1


def _follows_clicks(browser):
    _click(browser, "document.querySelector('#losses li[data-person=\"0\"] button')")
    assert now(browser) == [15, "3.0 s", [0]]
    assert browser.run("document.querySelector('#losses li[data-person=\"0\"] details').open")
    # A false track leads to its time as a loss does.
    browser.run("document.querySelector('#losses li:not([data-person]) button').click()")
    assert now(browser)[1] == "0.0 s"
    for chart in ("timeline", "ospa"):
        for k in (4, 17):
            x, y = browser.run(
                f"(() => {{ const c = document.getElementById('{chart}'); c.scrollIntoView({{block: 'center'}});"
                "const s = slider.getBoundingClientRect(), r = c.getBoundingClientRect();"
                f"return [s.x + 8 + {k} / 20 * (s.width - 16), r.y + r.height / 2]; }})()"
            )
            browser.point(x, y, click=True)
            assert now(browser)[0] == k
    # The pointer over a person tells the number.
    browser.run("follow.value = 'people 1'; follow.dispatchEvent(new Event('change')); map.scrollIntoView()")
    box = browser.run("(() => { const r = map.getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; })()")
    browser.point(box[0] + box[2] / 2, box[1] + box[3] / 2)
    assert re.match(r"person 1: .*track \d of ", browser.run("tip.textContent"))


def _follows_switched_tracks(browser, path):
    """Two people swap their tracks in a mission without a film: each switch leads to its scan and its commands."""
    recording = swapping()
    write_page(Flight(recording), path)
    browser.open(path)
    _lists_what_is_drawn(browser, Flight(recording))
    for person in (1, 0):
        place = f'[data-first="{SWAP}"][data-person="{person}"]'
        item = f"document.querySelector('#losses li{place}')"
        _click(browser, f"{item}.querySelector('button')")
        opened = "document.querySelectorAll('#losses details[open]').length"
        state = f"[Number(slider.value), {item}.ariaCurrent, {item}.querySelector('details').open, {opened}]"
        assert browser.run(state) == [SWAP, "true", True, 1]
        browser.press("Home")
        assert browser.run(f"[Number(slider.value), {item}.ariaCurrent]") == [0, None]


def _lists_what_is_drawn(browser, flight):
    """Legends have what the mission shows at some scan: states of people that it has, tracks, plans and switches."""
    history, kinds = flight.people, {event.kind for event in flight.events}
    holds = {HOLDS[hold] for hold in history.hold_states.ravel()}
    states = {STATES[state] for state in history.camera_states.ravel() if state != BROKEN}
    best = {STATES[state] for state in history.camera_states.max(axis=1)[history.recording.present]}
    on_map = {
        "person": best & {"seen", "missed"},
        "hidden": "hidden" in best,
        "out of view": "out of view" in best,
        "lost": "lost" in holds,
        "not found yet": "not found yet" in holds,
        "track, 95 %": len(flight.recording.track_ids),
        "view of a UAV": True,
        "intent": len(flight.recording.plan_times),
    }
    in_charts = {
        **{("seen by " if (history.camera_states[:, i] == STATES.index("seen")).any() else "") + f"UAV {i}": True
           for i in range(3)},
        "missed": "missed" in states,
        "hidden": "hidden" in states,
        "out of view": "out of view" in states,
        "held by all": "held" in holds,
        "held by some UAVs": "held by some" in holds,
        "lost": "lost" in holds,
        "not found yet": "not found yet" in holds,
        "false track": "false track" in kinds,
        "duplicate track": "duplicate track" in kinds,
        "track switched": kinds & set(IDENTITIES),
    }  # fmt: skip
    for name, entries in (("map-legend", on_map), ("chart-legend", in_charts)):
        found = browser.run(f"[...document.querySelectorAll('#{name} li')].map(li => li.textContent)")
        assert found == [text for text, shown in entries.items() if shown]


def _names_views_where_no_other_view_is(browser, path):
    """The top left corner of the first UAV's view lies in that of the second, and the third is at the map's corner."""
    recording = record(2, uavs=3)
    places = np.array([(0.0, 0.0, 17.32), (-8.0, 8.0, 17.32), (-73.0, 48.0, 17.32)])
    level = np.array([[*place, *Pose.level(*place).quaternion] for place in places])
    cameras = np.broadcast_to(level, recording.cameras.shape)
    write_page(Flight(dataclasses.replace(recording, poses=cameras, cameras=cameras)), path)
    browser.open(path)
    browser.run("words = []; CanvasRenderingContext2D.prototype.fillText = (...written) => { words.push(written); }")
    browser.run("slider.value = 1; slider.dispatchEvent(new Event('input'))")
    words, data, *size = browser.run(
        "[words.map(([text, x, y]) => [text, x, y]), JSON.parse(document.getElementById('data').textContent),"
        " map.clientWidth, map.clientHeight]"
    )
    room = np.array(data["area"]) + 2 * data["margin"]
    scale = np.min(size / room)
    views = [np.array(size) / 2 + scale * np.reshape(uav[4], (4, 2)) * (1, -1) for uav in data["uavs"][1]]
    for i in range(3):
        ((x, y),) = ([x, y] for text, x, y in words if text == f"UAV {i}")
        low, high = np.array([x - 20, y - 6]), np.array([x + 20, y + 6])
        assert np.all(low > 0) and np.all(high < size)
        for view in views:
            assert np.any((high <= view.min(axis=0)) | (low >= view.max(axis=0))), (i, x, y)


def _click(browser, element):
    x, y = browser.run(
        f"(() => {{ const b = {element}; b.scrollIntoView({{block: 'center'}});"
        "const r = b.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()"
    )
    browser.point(x, y, click=True)


def _plays(browser):
    browser.press("Home")
    now(browser)
    browser.run("speed.value = 4; speed.dispatchEvent(new Event('change'))")
    browser.run("document.activeElement.blur()")
    browser.press(" ", " ")
    browser.until("Number(slider.value) > 3")
    browser.until("Number(slider.value) === 20 && film.paused")
    assert browser.run("play.textContent") == "Play"
