"""A recording tells what went wrong: the mission's faults, in the same bytes for the same mission."""

import json

import numpy as np
import pytest
from helpers.flights import fly, recording_of
from helpers.studies import task_of

from planning.planner_loading import load_planner
from sim.mission.archive import load_recording, save
from sim.mission.fault import Fault
from sim.mission.recorder import Recorder
from sim.mission.recording import LONGEST_FAULT, MOST_FAULTS, decode_faults, encode_faults
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.study.trial_flight import fly_trial

OPTIONS = ("sensing.mode=ideal", "uavs.1.fails_at=1.1")
SETTING = load_scenario("forest", ["duration=2", *OPTIONS])


class Faulty:
    """Fails at every other decision, in words that differ from one process to the next and break lines."""

    def __init__(self):
        self._good, self._calls = load_planner("hover"), 0

    def plan(self, team, rng):
        self._calls += 1
        if self._calls % 2:
            raise ValueError(f"bad\n\x1b[31mday\u202e {object()}")
        return self._good.plan(team, rng)


def flown():
    mission, snapshots = fly(*OPTIONS, planner=Faulty(), seed=4, duration=2)
    return mission, recording_of(mission, snapshots, seed=4)


def test_faults_are_recorded_and_come_back_at_their_scans(tmp_path):
    mission, recording = flown()
    bad = "ValueError: bad [31mday <object object at 0x...>"
    broke = Fault(1.1, 1, "broke down, hovers from now on")
    assert decode_faults(recording.faults) == (Fault(0.0, None, bad), broke, Fault(2.0, None, bad))
    assert [f.time for f in mission.faults] == [0.0, 1.1, 2.0]
    at = {k: [f.time for f in recording.faults_at(k)] for k in range(len(recording.times))}
    assert {k: times for k, times in at.items() if times} == {0: [0.0], 6: [1.1], 10: [2.0]}
    save(recording, tmp_path / "a.npz")
    save(flown()[1], tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    again = Recorder()
    for k in range(len(recording.times)):
        again.add(load_recording(tmp_path / "a.npz").snapshot(k))
    assert again.recording(scenario="{}", planner="p", seed=0, forest=mission.forest).faults == recording.faults


def test_a_planner_that_faults_always_fills_no_disk():
    many = [Fault(k / 5, k % 3, f"{k} " + "x" * 5000) for k in range(3 * MOST_FAULTS)]
    text = encode_faults(many)
    kept = decode_faults(text)
    assert len(kept) == MOST_FAULTS and len(text) < MOST_FAULTS * (LONGEST_FAULT + 60)
    assert [(f.time, f.uav) for f in kept[:-1]] == [(f.time, f.uav) for f in many[: MOST_FAULTS - 1]]
    assert all(len(f.message) <= LONGEST_FAULT and " ... xx" in f.message for f in kept[:-1])
    assert kept[-1] == Fault((MOST_FAULTS - 1) / 5, None, f"{2 * MOST_FAULTS + 1} more faults are not recorded")
    assert encode_faults(kept) == text
    all_kept = decode_faults(encode_faults(many[:MOST_FAULTS]))
    assert len(all_kept) == MOST_FAULTS and all_kept[-1].uav is not None


def test_runs_and_studies_keep_faults_and_runs_the_time_of_each_decision(tmp_path, without_pictures):
    run_mission(Trial(SETTING, "hover", 4), tmp_path / "run", video=False)
    kept = load_recording(tmp_path / "run" / "mission.npz")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    faults = decode_faults(kept.faults)
    assert [{"time": f.time, "uav": f.uav, "message": f.message} for f in faults] == summary["faults"] != []
    assert len(summary["planning_s"]) == len(kept.plan_times) == 3
    assert sum(summary["planning_s"]) == pytest.approx(summary["seconds"]["planning"], abs=1e-5)
    assert np.all(np.array(summary["planning_s"]) > 0)
    trial = fly_trial(task_of(SETTING, "hover", 4), keep=True)
    assert trial.recording == (tmp_path / "run" / "mission.npz").read_bytes()
