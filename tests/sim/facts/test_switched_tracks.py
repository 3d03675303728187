"""False, duplicate and switched tracks of a mission made by hand, wherever events are shown."""

import json
import math

import numpy as np
import pytest
from helpers.html_pages import Page
from helpers.identities import standing_still, swapping

from sim.facts.event import IDENTITIES, UNMATCHED, Event, assign_lanes
from sim.facts.flight import Flight
from sim.mission.archive import save
from sim.views.page.page import make_page
from sim.views.palette import FALSE, format_css, pale

ALL = (0, 1, 2)


@pytest.fixture(scope="module")
def mission():
    return swapping()


def found(recording, kinds=(*UNMATCHED, *IDENTITIES)):
    return [event for event in Flight(recording).events if event.kind in kinds]


def test_events_and_their_lanes_are_exactly_those_made_by_hand(mission):
    rows = [(e.kind, e.text, e.when, e.first, e.last, e.track, e.person, e.former, e.uavs) for e in found(mission)]
    both = "for UAVs 0, 1 and 2"
    west = f"person 0 switched from track 0 to track 1, that of person 1, {both}"
    east = f"person 1 switched from track 1 to track 0, that of person 0, {both}"
    assert rows == [
        ("false track", "track 2 stands for no person", "0.4 to 3.4 s", 2, 16, 2, None, None, ALL),
        ("duplicate track", "track 3 is person 1's second one", "1.0 to 3.0 s", 5, 14, 3, 1, None, ALL),
        ("identity switch", west, "at 4.0 s", 20, 20, 1, 0, 1, ALL),
        ("identity switch", east, "at 4.0 s", 20, 20, 0, 1, 0, ALL),
    ]
    west, east = {7: (0.0, 0.0)}, {7: (20.0, 0.0)}
    recording = standing_still([[west] * 3, [west] * 3, [west, east, east], [east] * 3])
    rows = [(e.kind, e.text, e.first, e.person, e.former, e.uavs) for e in found(recording, IDENTITIES)]
    passed = "track 0 passed from person 0 to person 1 for"
    assert rows == [
        ("identity transfer", f"{passed} UAVs 1 and 2", 2, 1, 0, (1, 2)),
        ("identity transfer", f"{passed} UAV 0", 3, 1, 0, (0,)),
    ]
    one, two = {1: (0.0, 0.0)}, {1: (0.0, 0.0), 2: (0.5, 0.0)}
    (event,) = found(standing_still([[one], [two], [two], [two]], np.zeros((1, 2))))
    assert (event.kind, event.when, math.isinf(event.until)) == ("duplicate track", "from 0.2 s to the end", True)
    spans = ((0, 5), (2, 3), (4, 9), (6, 7), (7, 8))
    events = [Event("false track", "", first, last, first, last) for first, last in spans]
    assert [lane for _, lane in assign_lanes(events)] == [
        0,
        1,
        1,
        0,
        2,
    ]  # the last scan of the fourth is the first of the fifth


def test_the_page_lists_and_marks_them(mission):
    text = make_page(Flight(mission), place="runs/one")
    sheet = Page(text)
    items = [(given["data-first"], given["data-last"]) for given, _ in sheet.of("li") if "data-first" in given]
    assert items == [("2", "16"), ("5", "14"), ("20", "20"), ("20", "20")]
    buttons = [shown for _, shown in sheet.of("button")]
    assert "track 2 stands for no person 0.4 to 3.4 s" in buttons
    assert "track 3 is person 1's second one 1.0 to 3.0 s" in buttons
    assert "understory explain runs/one --track 2" in [shown for _, shown in sheet.of("code")]
    ((_, data),) = sheet.of("script", type="application/json")
    timeline = json.loads(data)["timeline"]
    bars = [[timeline["shades"][shade], *place] for shade, *place in timeline["unmatched"]["bars"]]
    assert bars == [[format_css(FALSE), 2, 16, 0], [format_css(pale(FALSE)), 5, 14, 1]]
    assert timeline["switches"] == [[20, 0], [20, 1]]


def test_explain_tells_them_and_where_to_read_on(mission, tmp_path, call):
    save(mission, tmp_path / "mission.npz")
    code, out, _ = call("explain", "mission.npz")
    assert code == 0
    assert "  0.4 to 3.4 s: track 2 stands for no person: held by UAVs 0, 1 and 2, 50.0 m from person 0; " in out
    assert "  1.0 to 3.0 s: track 3 is person 1's second one: " in out and out.count("  at 4.0 s: person ") == 2
    assert "The longest false track: understory explain mission.npz --track 2" in out.splitlines()
    out = call("explain", "mission.npz", "--target", "1", "--time", "4", "--out", "a.png")[1]
    assert out.count("switched from") == 2  # that of the person, and where the person's track went
