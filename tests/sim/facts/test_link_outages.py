"""Times without a link: against the links of each scan, and in few sentences for large fleets."""

import math
import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from helpers import synthetic
from helpers.recordings import broken, record

from sim.facts import mission_events as events
from sim.facts.event import Event, list_outages_at, summarise_outages
from sim.facts.flight import Flight
from sim.mission.archive import save
from sim.mission.radio import RadioLinks
from sim.views.page.page import make_page

CAUSES = "too far, cut or not there"
PAIRS = list(combinations(range(4), 2))


def at(kind, k, *uavs):
    return Event(kind, "", k, k, 0.2 * k, 0.2 * k, uavs=uavs)


def named(event):
    """The pairs of UAVs in an event's text."""
    return [(int(i), int(j)) for i, j in re.findall(r"(\d+) and (\d+)(?=,|$)", event.text)]


@pytest.mark.parametrize("seed", range(4))
def test_outages_are_the_scans_at_which_uavs_that_work_have_no_link(seed, monkeypatch):
    rng, scans = np.random.default_rng(seed), 12
    up = np.cumsum(rng.random((scans, 4, 4)) < 0.3, axis=0) % 2 == 1
    up = np.triu(up, 1) | np.triu(up, 1).transpose(0, 2, 1)
    recording = broken(record(scans, setting=synthetic.scenario(uavs=4, people=1), trees=0), 2, 7)
    works, times = recording.working, recording.times
    up &= works[:, None] & works[:, :, None]
    monkeypatch.setattr(events, "find_recorded_links", lambda _: [RadioLinks(links, None) for links in up])
    flight = Flight(recording)
    down = {(i, j): works[:, i] & works[:, j] & ~up[:, i, j] for i, j in PAIRS}
    for k in range(scans):
        now = list_outages_at(flight.events, times, k)
        assert sorted(pair for event in now for pair in named(event)) == [pair for pair in PAIRS if down[pair][k]]
        for event in now:
            for pair in named(event):
                assert down[pair][event.first : event.last + 1].all()
                assert event.first == 0 or not down[pair][event.first - 1]
                assert event.last == scans - 1 or not down[pair][event.last + 1]
    told = summarise_outages(flight.events, times)
    assert sorted(pair for event in told for pair in named(event)) == [pair for pair in PAIRS if down[pair].any()]
    for event in told:
        for pair in named(event):
            rows = np.flatnonzero(down[pair])
            assert (event.first, event.last) == (rows[0], rows[-1]) and event.why == CAUSES
            assert event.time == times[rows[0]]
            assert event.until == (math.inf if rows[-1] == scans - 1 else times[rows[-1] + 1])
            count = 1 + np.count_nonzero(np.diff(rows) > 1)
            several = f", {count} times, {0.2 * len(rows):.1f} s in all" if count > 1 else ""
            assert event.text.endswith(several) and (", 1 times" not in event.text)
    assert [event.time for event in told] == sorted(event.time for event in told)


def test_a_large_fleet_whose_links_come_and_go_is_told_of_in_few_sentences():
    times, pairs = 0.2 * np.arange(100), list(combinations(range(20), 2))
    (whole,) = summarise_outages([at("link lost", 0, *pair) for pair in pairs], times)
    assert whole.sentence == f"no link between UAVs 0 and 1, {', '.join(f'0 and {j}' for j in range(2, 7))}, " + (
        f"and 184 more pairs: {CAUSES}"
    )
    assert whole.when == "from 0.0 s to the end"
    flapping = [at(kind, k + late, *pair) for n, pair in enumerate(pairs) for k in range(0, 80, 20)
                for kind, late in (("link lost", 0), ("link restored", 1 + n % 15))]  # fmt: skip
    told = summarise_outages(flapping, times)
    assert len(told) == 10
    alike = [pair for n, pair in enumerate(pairs) if n % 15 == 14]
    assert f"and {len(alike) - 6} more pairs, 4 times, 12.0 s in all" in told[0].text
    rest = sum(n % 15 < 6 for n in range(len(pairs)))
    assert [e.text for e in told if "at times" in e.text] == [f"no link at times between {rest} more pairs of UAVs"]


def test_explain_and_the_page_tell_of_links_that_were_lost(tmp_path, call, monkeypatch):
    setting = synthetic.scenario(uavs=3, people=1)
    recording = record(6, setting=setting, trees=0, change=lambda now: replace(now, contacts=()))
    up = np.repeat(~np.eye(3, dtype=np.bool_)[None], 6, axis=0)
    up[2:4, 0, 2] = up[2:4, 2, 0] = False
    monkeypatch.setattr(events, "find_recorded_links", lambda _: [RadioLinks(links, None) for links in up])
    save(recording, tmp_path / "mission.npz")
    line = f"0.4 to 0.8 s: no link between UAVs 0 and 2: {CAUSES}"
    assert f"  {line}\n" in call("explain", "mission.npz")[1]
    for time, told in (("0.2", False), ("0.4", True), ("0.6", True), ("0.8", False)):
        out = call("explain", "mission.npz", "--target", "0", "--time", time, "--out", f"{time}.png")[1]
        assert (line in out) == told
    shown = make_page(Flight(recording))
    assert f"no link between UAVs 0 and 2 0.4 to 0.8 s</button><p>{CAUSES}</p></li>" in shown
