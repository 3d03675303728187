"""Losses of every grade: timeline, page, explanations, tables and the flight in one line tell of the same spans."""

import json
import re

import numpy as np
import pytest
from helpers.html_pages import Page
from helpers.people_facts import with_views
from helpers.recordings import bare
from matplotlib.collections import PolyCollection

from sim.facts.event import UNHELD
from sim.facts.explain.explanation import find_stretches
from sim.facts.flight import Flight
from sim.views.drawing.plots import rgb
from sim.views.page.page import make_page
from sim.views.palette import HOLD_COLOURS, format_css
from tracking.geometry.camera import Pose

GRADES = {"-": "not found yet", "x": "held", "o": "off the track", "l": "lost", "g": "lost", " ": "absent"}
OFFSETS = {"x": 0.0, "o": 2.0, "l": 3.0}  # m, from the person, of a track whose ellipse reaches 2.4 m


@pytest.mark.parametrize(
    "story",
    ["--xoolgx", "--xoolg", "xlooollx", "x llo", "xgxlgxoxo", "-----", "xxxxl"],
    ids=["held again", "lost to the end", "off within a loss", "gone a while", "many", "never", "in the last scan"],
)
def test_all_outputs_tell_of_the_same_losses(story):
    times, people = np.arange(len(story)) / 5, np.zeros((len(story), 1, 2))
    people[[c == " " for c in story]] = np.nan
    tracks = [[{7: (OFFSETS[c], 0.0, 0.0, 0.0)} if c in OFFSETS else {}] for c in story]
    none = np.zeros((len(story), 1, 1))
    poses = np.tile([0.0, 0.0, 20.0, *Pose.level(0, 0, 0).quaternion], (len(story), 1, 1))
    flight = Flight(bare(people, tracks, poses=poses, cameras=poses))
    flight.people = with_views(flight.recording, none > 0, none.astype(int) - 1)
    runs = [m.span() for m in re.finditer(r"-+|x+|o+|[lg]+| +", story)]
    spans = [(GRADES[story[a]], a, b - 1) for a, b in runs if story[a] in "-olg"]
    ends = {(grade, a, b): (times[a], times[min(b + 1, len(story) - 1)]) for grade, a, b in spans}

    events = [e for e in flight.events if e.kind in UNHELD]
    assert [(e.kind.removeprefix("person "), e.first, e.last) for e in events] == spans
    rows = [[begin, end, held] for begin, end, held, _ in find_stretches(flight.people, 0)]
    assert [row for row in rows if f"person {row[2]}" in UNHELD] == [[e.time, e.until, e.kind[7:]] for e in events]

    losses = flight.columns("losses")
    told = [*zip(losses["grade"], losses["from_s"], losses["until_s"], strict=True)]
    assert told == [(grade, *ends[grade, a, b]) for grade, a, b in spans]

    (boxes,) = (c for c in flight.timeline_figure().axes[0].collections if isinstance(c, PolyCollection))
    for grade in {grade for grade, *_ in spans}:
        faces = [tuple(face[:3]) == pytest.approx(rgb(HOLD_COLOURS[grade])) for face in boxes.get_facecolors()]
        edges = [path.vertices[:, 0] for path, same in zip(boxes.get_paths(), faces, strict=True) if same]
        drawn = [(x.min(), x.max()) for x in edges]
        assert drawn == [pytest.approx(ends[span]) for span in spans if span[0] == grade]

    sheet = Page(make_page(flight))
    items = [
        (int(given["data-first"]), int(given["data-last"])) for given, _ in sheet.of("li") if "data-person" in given
    ]
    assert sorted(items) == [span[1:] for span in spans]
    ((_, data),) = sheet.of("script", type="application/json")
    timeline = json.loads(data)["timeline"]
    bars = [(timeline["shades"][shade], first, last) for shade, first, last, *_ in timeline["rows"][0]["holds"]]
    shades = {format_css(HOLD_COLOURS[grade]): grade for grade in GRADES.values()}
    assert [(shades[s], a, b) for s, a, b in bars if f"person {shades[s]}" in UNHELD] == spans

    lost = [span for span in spans if span[0] == "lost"]
    often = {0: "never lost", 1: "lost once", 2: "lost twice"}[len(lost)]
    title = flight.timeline_figure().axes[0].get_title(loc="left")
    assert often in title and f"; {often}" in repr(flight)
    if lost:
        worst = max(lost, key=lambda span: (story[span[1] : span[2] + 1].count("g"), span[2] - span[1]))
        begin, end = ends[worst]
        words = f"at worst person 0 for {end - begin:.1f} s from {begin:.1f} s"
        assert words in title and words in repr(flight)
