"""Times without a link: against the links of each scan, and in few sentences for large fleets."""

import math
import re
from dataclasses import replace
from itertools import combinations

import msgspec
import numpy as np
import pytest
from helpers import synthetic
from helpers.flights import recorded
from helpers.recordings import broken, record

from sim.facts.event import Event, list_outages_at, summarise_outages
from sim.facts.flight import Flight
from sim.facts.metrics.holding import find_episodes
from sim.mission.archive import save
from sim.mission.recorded_links import find_recorded_links
from sim.scenario.scenario import encode_scenario
from sim.scenario.uavs import Cut, Network
from sim.views.page.page import make_page

PAIRS = list(combinations(range(4), 2))


def lost(first, last, *uavs, why="cut"):
    return Event("link lost", "", first, last, 0.2 * first, 0.2 * last, why, uavs=uavs)


def with_cuts(setting, down):
    """The setting with links that are cut as masks (K,) of pairs say."""
    spans = [(pair, *span[:2]) for pair, mask in down.items() for span in find_episodes(mask.astype(int)) if span.value]
    cuts = tuple(Cut((pair,), max(0.2 * first - 0.1, 0.0), 0.2 * last + 0.1) for pair, first, last in spans)
    return msgspec.structs.replace(setting, network=Network(cuts=cuts))


def named(event):
    """The pairs of UAVs in an event's text."""
    return [(int(i), int(j)) for i, j in re.findall(r"(\d+) and (\d+)(?=,|$)", event.text)]


@pytest.mark.parametrize("seed", range(4))
def test_outages_are_the_scans_at_which_uavs_that_work_have_no_link(seed):
    rng, scans = np.random.default_rng(seed), 12
    down = {pair: np.cumsum(rng.random(scans) < 0.3) % 2 == 0 for pair in PAIRS}
    recording = broken(record(scans, setting=with_cuts(synthetic.scenario(uavs=4, people=1), down), trees=0), 2, 7)
    works, times = recording.working, recording.times
    flight = Flight(recording)
    down = {(i, j): works[:, i] & works[:, j] & down[i, j] for i, j in PAIRS}
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
            assert (event.first, event.last) == (rows[0], rows[-1]) and event.why == "cut"
            assert event.time == times[rows[0]]
            assert event.until == (math.inf if rows[-1] == scans - 1 else times[rows[-1] + 1])
            count = 1 + np.count_nonzero(np.diff(rows) > 1)
            seconds = 0.2 * np.count_nonzero(rows < scans - 1)
            several = f", {count} times, {seconds:.1f} s in all" if count > 1 else ""
            assert event.text.endswith(several) and (", 1 times" not in event.text)
    assert [event.time for event in told] == sorted(event.time for event in told)


def test_a_large_fleet_whose_links_come_and_go_is_told_of_in_few_sentences():
    times, pairs = 0.2 * np.arange(100), list(combinations(range(20), 2))
    (whole,) = summarise_outages([lost(0, 99, *pair) for pair in pairs], times)
    assert whole.sentence == f"no link between UAVs 0 and 1, {', '.join(f'0 and {j}' for j in range(2, 7))}, " + (
        "and 184 more pairs: cut"
    )
    assert whole.when == "from 0.0 s to the end"
    flapping = [lost(k, k + n % 15, *pair, why="cut" if k else "out of range")
                for n, pair in enumerate(pairs) for k in range(0, 80, 20)]  # fmt: skip
    told = summarise_outages(flapping, times)
    assert len(told) == 10
    alike = [pair for n, pair in enumerate(pairs) if n % 15 == 14]
    assert f"and {len(alike) - 6} more pairs, 4 times, 12.0 s in all: out of range, cut" in told[0].sentence
    rest = [0.2 * (1 + n % 15) for n in range(len(pairs)) if n % 15 < 6]
    summed = f"{len(rest)} more pairs of UAVs, {4 * len(rest)} times, {4 * sum(rest):.1f} s in all"
    assert [e.text for e in told if "at times" in e.text] == [f"no link at times between {summed}"]


@pytest.mark.parametrize("why", ["cut", "out of range", "not linked"])
def test_explain_and_the_page_tell_of_links_that_were_lost_and_why(tmp_path, call, why):
    setting, down = synthetic.scenario(uavs=3, people=1), np.isin(np.arange(6), (2, 3))
    setting = with_cuts(setting, {(0, 2): down if why == "cut" else ~down & down})
    ends = "0.4 to 0.8 s"
    if why == "not linked":
        setting, ends = (
            msgspec.structs.replace(setting, network=Network(links=((0, 1), (1, 2)))),
            "from 0.0 s to the end",
        )
    recording = record(6, setting=setting, trees=0, change=lambda now: replace(now, contacts=()))
    if why == "out of range":
        setting = msgspec.structs.replace(setting, network=Network(range=100.0, links=((0, 1), (0, 2))))
        recording.poses[2:4, 2, 2] += 150.0
        recording = replace(recording, scenario=encode_scenario(setting))
    save(recording, tmp_path / "mission.npz")
    line = f"{ends}: no link between UAVs 0 and 2: {why}"
    assert f"  {line}\n" in call("explain", "mission.npz")[1]
    for time, told in (("0.2", False), ("0.4", True), ("0.6", True), ("0.8", False)):
        out = call("explain", "mission.npz", "--target", "0", "--time", time, "--out", f"{time}.png")[1]
        assert (line in out) == (told or why == "not linked")
    assert f"no link between UAVs 0 and 2 {ends}</button><p>{why}</p></li>" in make_page(Flight(recording))


def test_messages_that_are_lost_are_listed_as_links_are():
    recording = recorded("sensing.mode=ideal", "network.loss=0.6", "network.rounds=1", duration=2)
    events, times = Flight(recording).events, recording.times
    silent = np.array([links.up & ~links.contact for links in find_recorded_links(recording)])
    told = {e.text.partition(",")[0]: e for e in summarise_outages(events, times)}
    for i, j in np.argwhere(silent.any(axis=0)).tolist():
        event = told[f"UAV {i} hears nothing of UAV {j}"]
        assert f", {0.2 * np.count_nonzero(silent[:-1, i, j]):.1f} s in all" in event.text
        for k in range(len(times)):
            now = [e.text for e in list_outages_at(events, times, k) if f"UAV {i} hears nothing of UAV {j}" in e.text]
            assert len(now) == silent[k, i, j]
