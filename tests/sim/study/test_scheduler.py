"""Whatever ends a trial, the others fly on, and it has a second chance; any executor gives the same rows."""

import multiprocessing
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from helpers.flights import mission_of
from helpers.studies import SHORT, Serial, plain, short

from planning.planner import Plan
from sim.study.definition import Study
from sim.study.executors import Pool
from sim.study.scheduler import Options, complete, fly_trials
from sim.study.store import Store, StoreError, read_rows
from sim.study.trial_flight import fly_trial
from sim.study.trials import list_trials

# Planners that end their process, hang, take long or raise, always or but once (a file tells).
AILING = """
import ctypes, os, time
from pathlib import Path
from planning.baselines import Hover

class Dies:
    def __init__(self, marks="", once=True):
        self.mark, self.once = Path(marks) / f"{type(self).__name__}", once
    def plan(self, team, rng):
        if not (self.once and self.mark.exists()):
            self.mark.touch()
            self.fail()
        return Hover().plan(team, rng)
    def fail(self):
        os._exit(3)

class Crashes(Dies):
    def fail(self):
        ctypes.string_at(0)

class Hangs(Dies):
    def fail(self):
        time.sleep(3600)
"""


@pytest.fixture
def ailing(tmp_path, monkeypatch):
    """Makes the names of ailing planners."""
    (tmp_path / "ailing_study.py").write_text(AILING)
    monkeypatch.syspath_prepend(str(tmp_path))
    return lambda name, once=True: f"ailing_study:{name}(marks={str(tmp_path)!r}, once={once})"


def run(tmp_path, tasks, executor, *given, **named):
    with Store.open(tmp_path / "study", "short") as store:
        return complete(tasks, store, executor, *given, **named)


def test_trials_that_fail_are_failed_rows_with_reasons(tmp_path):
    task = short(["hover"], "0", factors={"x": {"y": {"trees": {"density": 160}}}})[0]
    row = fly_trial(task).row
    assert row.status == "failed" and row.error.startswith("InputError: trees.density = 160")
    assert len(row.ospa) == len(row.times) == 0 and row.metrics == {}
    (task,) = short(["hover"], "0")
    row = fly_trial(msgspec.structs.replace(task, version="0.0.9")).row
    assert row.status == "failed" and "not 0.0.9" in row.error
    with ThreadPoolExecutor(1) as executor:
        (row,) = run(tmp_path, short(["hover"], "0"), executor, Options(timeout=1e-6))
    assert row.status == "failed" and row.error == "TimeoutError: took longer than the timeout of 1e-06 s"


def test_a_row_holds_what_the_mission_came_to():
    (task,) = short(["greedy"], "4")
    row = fly_trial(task).row
    mission = mission_of(task.setting, "greedy", 4)
    snapshots = list(mission.fly())
    errors = [snapshot.error for snapshot in snapshots]
    distance = np.array([snapshot.ospa[:, 0] for snapshot in snapshots])
    assert row.ospa.tolist() == pytest.approx(errors, rel=1e-6) and row.ospa.dtype == "float32"
    assert row.times.tolist() == task.setting.scan_times
    assert row.metrics["ospa.mean_m"] == distance.mean() and row.metrics["ospa.median_m"] == np.median(distance)
    assert row.metrics["ospa.share_under_1m"] == np.mean(distance < 1) and row.metrics["faults"] == 0
    assert row.metrics["planning_s_per_decision"] == row.metrics["seconds.planning"] / 2
    assert row.metrics["planning_cpu_s_per_decision"] > 0
    assert (
        row.metrics["detection.precision"] != row.metrics["detection.precision"]
    )  # NaN: ideal sensing has no detections
    assert (row.status, row.error, row.seed, row.planner) == ("done", "", 4, "greedy")


@pytest.mark.parametrize(
    ("settings", "worlds"),
    [
        ({"trees.file": "stems.csv", "people.trajectories": "plaza"}, 1),
        ({"trees.density": "0", "people.trajectories": "plaza"}, 1),
        ({"trees.file": "stems.csv"}, 3),
        ({"people.trajectories": "plaza"}, 3),
    ],
)
def test_rows_tell_the_seeds_that_share_a_world_whatever_the_planner(settings, worlds, tmp_path):
    (tmp_path / "stems.csv").write_text("x,y\n5,5\n-20,3\n")
    own = {key: str(tmp_path / value) if value == "stems.csv" else value for key, value in settings.items()}
    tasks = list_trials(Study("w", ("hover", "random"), seeds="0-2", settings={**SHORT, **own}))
    found = [fly_trial(task).row.metrics["world"] for task in tasks]
    assert len(set(found)) == worlds and found[::2] == found[1::2]


class Lazy:
    """Fails in every second decision: it raises, or one plan is none, or too fast, which is no failure."""

    def __init__(self, fault="raises"):
        self.fault, self.calls = fault, 0

    def plan(self, team, rng):
        self.calls += 1
        if self.calls % 2 == 0 and self.fault == "raises":
            raise RuntimeError("detector: no")
        speed = {"speeds": 99.0, "lacks": np.nan}.get(self.fault, 0.0) if self.calls % 2 == 0 else 0.0
        return [Plan(np.full((1, 2), speed if s.own.id == 1 else 0.0)) for s in team]


@pytest.mark.parametrize(("fault", "share"), [("raises", 0.4), ("lacks", 0.4), ("speeds", 0.0)])
def test_decisions_that_failed_are_counted(fault, share, monkeypatch):
    monkeypatch.setitem(sys.modules, "lazy", SimpleNamespace(Lazy=Lazy, __name__="lazy"))
    settings = {**SHORT, "duration": "4"}
    (task,) = list_trials(Study("w", (f"lazy:Lazy(fault={fault})",), seeds="0", settings=settings))
    assert fly_trial(task).row.metrics["failed_decisions"] == share


def test_trials_that_fail_once_are_tried_again_and_twice_are_recorded(tmp_path):
    tasks = short(["hover", "greedy", "lawnmower"], "0-1")
    executor = Serial({"greedy": ["ValueError: one"], "lawnmower": [OSError("gone"), "ValueError: two", "x", "y"]})
    heard = []
    rows = run(tmp_path, tasks, executor, on_row=lambda row, fresh: heard.append((row.planner, row.seed, fresh)))
    assert [row.status for row in rows] == ["done", "done", "failed"] * 2
    assert [rows[2].error, rows[5].error] == ["x", "y"]  # seconds tries come after all first ones
    assert len(executor.flown) == 6 + 1 + 2
    assert sorted(heard) == sorted((task.planner, task.seed, True) for task in tasks)
    assert sorted(map(str, map(plain, read_rows(tmp_path / "study")))) == sorted(map(str, map(plain, rows)))


def test_an_executor_that_takes_no_more_ends_the_study_and_keeps_what_there_is(tmp_path):
    executor = Serial({"hover": [None, OSError("gone"), RuntimeError]})
    with pytest.raises(StoreError, match="no more trials can be flown: RuntimeError"):
        run(tmp_path, short(["hover"], "0-1"), executor)
    assert len(read_rows(tmp_path / "study")) == 1


def test_threads_give_the_rows_of_a_single_one_in_the_order_of_tasks(tmp_path):
    tasks = short(["hover", "greedy"], "2,0")[::-1]
    alone = [plain(fly_trial(task).row) for task in tasks]
    with ThreadPoolExecutor(3) as executor:
        assert list(map(plain, run(tmp_path, tasks, executor))) == alone
        assert list(map(plain, fly_trials(tasks, executor))) == alone
    errors = [row.error for row in fly_trials(tasks, Serial({"hover": ["ValueError: no"] * 4}))]
    assert errors == ["ValueError: no" if task.planner == "hover" else "" for task in tasks]


@pytest.mark.parametrize("ill", ["Dies", pytest.param("Hangs", marks=pytest.mark.slow)])
def test_processes_that_die_or_hang_lose_no_trial_and_change_no_row(tmp_path, ailing, ill):
    tasks = short(["hover", ailing(ill)], "0")
    before = dict(os.environ)
    limit = {"Dies": 300.0, "Hangs": 10.0}[ill]  # s
    with Pool(1, timeout=limit) as flying:
        rows = run(tmp_path, tasks, flying, Options(timeout=limit))
    assert list(map(plain, rows)) == [plain(fly_trial(task).row) for task in tasks]
    assert {row.status for row in rows} == {"done"} and (tmp_path / ill).exists()
    assert dict(os.environ) == before and multiprocessing.active_children() == []


@pytest.mark.slow
def test_trials_that_always_die_or_hang_are_recorded_with_their_error_and_line(tmp_path, ailing):
    tasks = short([ailing("Crashes", once=False), "hover", ailing("Hangs", once=False)], "0-1")
    with Pool(2, timeout=3.0) as flying:
        rows = run(tmp_path, tasks, flying, Options(timeout=3.0))
    assert [row.status for row in rows] == ["failed", "done", "failed"] * 2
    calls = ("ctypes.string_at", "time.sleep(3600)")
    crash, hang = (
        f"({tmp_path / 'ailing_study.py'}:{AILING[: AILING.index(call)].count(chr(10)) + 1}, in fail)" for call in calls
    )
    assert rows[0].error == f"ProcessExpired: its process was killed by SIGSEGV {crash}"
    assert rows[2].error == f"TimeoutError: took longer than the timeout of 3 s {hang}"


def test_a_pool_has_a_process_for_each_core_that_it_may_use(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 64)
    monkeypatch.setattr("os.sched_getaffinity", lambda process: {3, 5}, raising=False)
    assert Pool().count == 2
    monkeypatch.delattr("os.sched_getaffinity")
    assert Pool().count == 64
