"""A mission with a limit of wall time leaves a whole folder, or nothing and one line that says why."""

import json
import multiprocessing
import signal

import pytest

from sim.mission.archive import load_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.running.timed_run import run_with_timeout
from sim.scenario.loading import load_scenario
from tracking.errors import InputError
from tracking.plugins.plugin_error import PluginError

PLANNERS = """
import os
import time

from planning.baselines import Hover
from tracking.tracker import Tracker


class Hangs(Hover):
    def plan(self, team, rng):
        if team[0].time > 0.9:
            time.sleep(600)
        return super().plan(team, rng)


class Dies(Hover):
    def plan(self, team, rng):
        os._exit(3)


class Unmade:
    def __init__(self):
        raise KeyError("weights")


class Fails(Tracker):
    def step(self, scan):
        raise KeyError("table")
"""


@pytest.fixture
def fly(tmp_path, monkeypatch, without_pictures):
    """Flies a planner of a plug-in, with a limit of wall time, into a folder."""
    (tmp_path / "ailing_run.py").write_text(PLANNERS)
    monkeypatch.syspath_prepend(str(tmp_path))

    def started(planner="hover", *overrides, timeout=600.0, **options):
        trial = Trial(load_scenario("forest", ["duration=2", "sensing.mode=ideal", *overrides]), planner, 5)
        return run_with_timeout(trial, tmp_path / "runs" / "out", timeout, video=False, **options)

    yield started
    assert multiprocessing.active_children() == []


def test_ctrl_c_in_flight_keeps_the_scans_of_a_mission_that_is_else_as_without_a_limit(fly, tmp_path):
    times = []

    def progress(moment):
        times.append(moment.time)
        if len(times) == 4:
            signal.raise_signal(signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    summary = fly(progress=progress)
    assert signal.getsignal(signal.SIGINT) is before
    recording = load_recording(tmp_path / "runs" / "out" / "mission.npz")
    assert summary["interrupted"] and 4 <= len(recording.times) == len(times) < 11
    assert json.loads((tmp_path / "runs" / "out" / "summary.json").read_text()) == summary
    stop_at = len(times)

    def same(moment):
        if moment.time == times[stop_at - 1]:
            signal.raise_signal(signal.SIGINT)

    trial = Trial(load_scenario("forest", ["duration=2", "sensing.mode=ideal"]), "hover", 5)
    run_mission(trial, tmp_path / "here", video=False, progress=same)
    first, second = (tmp_path / name / "mission.npz" for name in ("runs/out", "here"))
    assert first.read_bytes() == second.read_bytes()


def interrupted(moment):
    for _ in range(2):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.slow  # starts a process each
@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        (
            ["ailing_run:Dies"],
            PluginError,
            "before its first scan was complete: its process ended by itself, with exit",
        ),
        (["ailing_run:Unmade"], InputError, "cannot be made: KeyError: 'weights'"),
        (["hover", "tracking.tracker=ailing_run:Fails"], Exception, "KeyError: 'table'"),
        (["nobody"], InputError, "'nobody' is unknown"),
    ],
)
def test_what_else_ends_a_mission_is_one_line(fly, tmp_path, given, error, words):
    with pytest.raises(error) as raised:
        fly(*given)
    assert words in str(raised.value) and "\n" not in str(raised.value) and not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_a_second_ctrl_c_leaves_nothing(fly, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        fly("ailing_run:Hangs", progress=interrupted)
    assert not (tmp_path / "runs").exists()
