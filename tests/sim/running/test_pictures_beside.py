"""Pictures that a second process draws while a mission flies."""

import math
import os
import signal

import pytest
from helpers.films import frames_of

from planning.catalogue import DEFAULT_PLANNER
from sim.mission.archive import load_recording
from sim.mission.trial import ScanProgress, Trial
from sim.processes.companion import Companion
from sim.running import beside
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario

PICTURES = ["mission.html", "mission.mp4", "mission.npz", "ospa.png", "timeline.png"]


def fly(out, *overrides, planner="greedy", duration=1, **options):
    trial = Trial(load_scenario("forest", [f"duration={duration}", *overrides]), planner, 3)
    return run_mission(trial, out, **options)


def at_scan(number, act):
    """A progress function that acts at one scan."""
    scans = []

    def progress(moment):
        scans.extend([moment] if isinstance(moment, ScanProgress) else [])
        if len(scans) == number and isinstance(moment, ScanProgress):
            act()

    return progress


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "summary.json"}


@pytest.mark.parametrize(
    ("planner", "overrides"),
    [
        (DEFAULT_PLANNER, ("mapping.forest=mapped",)),
        ("greedy", ("sensing.mode=ideal", "network.loss=0.3", "tracking.initial_tracks=none")),
        ("greedy", ("uavs=[{start=[-2,0]}, {start=[2,0], fails_at=0.5}]", "network.plan_delay=0.2")),
    ],
)
def test_a_second_process_leaves_the_bytes_of_one_that_does_it_all(tmp_path, monkeypatch, planner, overrides):
    fly(tmp_path / "two" / "out", *overrides, planner=planner)
    monkeypatch.setattr(beside, "count_cores", lambda: 1)
    fly(tmp_path / "one" / "out", *overrides, planner=planner)
    two, one = (contents(tmp_path / name / "out") for name in ("two", "one"))
    assert sorted(two) == PICTURES
    two["mission.html"] = two["mission.html"].replace(b"/two/out", b"/one/out")  # the commands in it name the folder
    assert two == one


def test_ctrl_c_keeps_pictures_of_what_was_flown(tmp_path):
    summary = fly(tmp_path / "out", duration=20, progress=at_scan(4, lambda: signal.raise_signal(signal.SIGINT)))
    assert summary["interrupted"] and len(load_recording(tmp_path / "out" / "mission.npz").times) == 4
    assert sorted(contents(tmp_path / "out")) == PICTURES and frames_of(tmp_path / "out" / "mission.mp4") == ("h264", 4)


@pytest.mark.parametrize("scan", [1, 6], ids=["at take-off", "at landing"])
def test_pictures_of_a_process_that_died_are_drawn_again(tmp_path, scan):
    fly(tmp_path / "whole" / "out")
    said = []
    with Companion("sim.running.pictures:draw_beside") as painter:
        kill = at_scan(scan, lambda: os.kill(painter.pid, signal.SIGKILL))
        fly(tmp_path / "again" / "out", painter=painter, progress=kill, say=said.append)
    assert said == ["The process that draws film and page was killed by SIGKILL; they are drawn again."]
    whole, again = (contents(tmp_path / name / "out") for name in ("whole", "again"))
    again["mission.html"] = again["mission.html"].replace(b"/again/out", b"/whole/out")
    assert whole == again


def test_an_error_of_the_second_process_is_that_of_the_run(tmp_path):
    with (
        Companion("helpers.companions:fail_at_the_third") as painter,
        pytest.raises(OSError, match="No space left on device"),
    ):
        fly(tmp_path / "out", painter=painter)
    assert list(tmp_path.iterdir()) == []


def test_without_video_there_is_neither_film_nor_page(tmp_path):
    fly(tmp_path / "out", video=False)
    assert sorted(contents(tmp_path / "out")) == ["mission.npz", "ospa.png", "timeline.png"]


def test_seconds_add_up_to_the_wall_clock(tmp_path):
    summary = fly(tmp_path / "out", duration=3)
    seconds = summary["seconds"]
    assert math.fsum(seconds.values()) == pytest.approx(summary["wall_s"])
    assert 0.0 <= seconds["other"] <= 0.1 * summary["wall_s"]
