"""Whatever ends a trial, the others fly on, and it has a second chance; any executor gives the same rows."""

import multiprocessing
import os
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from unittest.mock import Mock

import msgspec
import numpy as np
import pytest
from helpers.flights import mission_of
from helpers.studies import Serial, plain, short

from sim.study import backends, scheduler, trial_flight
from sim.study.backends import ExecutorBackend, Pool, connect
from sim.study.scheduler import Options, complete, fly_tasks
from sim.study.store import Store, StoreError, read_rows
from sim.study.trial_flight import fly_trial

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

class Sleeps(Dies):
    def fail(self):
        time.sleep(0.15)
"""


@pytest.fixture
def ailing(tmp_path, monkeypatch):
    """Makes the names of ailing planners."""
    (tmp_path / "ailing_study.py").write_text(AILING)
    monkeypatch.syspath_prepend(str(tmp_path))
    return lambda name, once=True: f"ailing_study:{name}(marks={str(tmp_path)!r}, once={once})"


def run(tmp_path, tasks, backend, *given, **named):
    with Store.open(tmp_path / "study", "short") as store:
        return complete(tasks, store, backend, *given, **named)


def test_trials_that_fail_are_failed_rows_with_reasons(tmp_path):
    task = short(["hover"], "0", factors={"x": {"y": {"trees": {"density": 160}}}})[0]
    row = fly_trial(task).row
    assert row.status == "failed" and row.error.startswith("InputError: trees.density = 160")
    assert len(row.ospa) == len(row.times) == 0 and row.metrics == {}
    (task,) = short(["hover"], "0")
    row = fly_trial(msgspec.structs.replace(task, version="0.0.9")).row
    assert row.status == "failed" and "not 0.0.9" in row.error
    with ThreadPoolExecutor(1) as executor:
        (row,) = run(tmp_path, short(["hover"], "0"), ExecutorBackend(executor), Options(timeout=1e-6))
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
    assert 0 < row.metrics["planning_cpu_s_per_decision"] < row.metrics["planning_s_per_decision"] + 0.01
    assert (
        row.metrics["detection.precision"] != row.metrics["detection.precision"]
    )  # NaN: ideal sensing has no detections
    assert (row.status, row.error, row.seed, row.planner) == ("done", "", 4, "greedy")


def test_trials_that_fail_once_are_tried_again_and_twice_are_recorded(tmp_path):
    tasks = short(["hover", "greedy", "lawnmower"], "0-1")
    backend = Serial({"greedy": ["ValueError: one"], "lawnmower": [OSError("gone"), "ValueError: two", "x", "y"]})
    heard = []
    rows = run(tmp_path, tasks, backend, on_row=lambda task, row, fresh: heard.append((task.key, row.status, fresh)))
    assert [row.status for row in rows] == ["done", "done", "failed"] * 2
    assert [rows[2].error, rows[5].error] == ["x", "y"]  # seconds tries come after all first ones
    assert len(backend.flown) == 6 + 1 + 2
    assert sorted(key for key, *_ in heard) == sorted(task.key for task in tasks)
    assert sorted(map(str, map(plain, read_rows(tmp_path / "study")))) == sorted(map(str, map(plain, rows)))


def test_trials_that_hang_are_dropped_and_the_rest_flies_on(tmp_path, monkeypatch):
    monkeypatch.setattr(scheduler, "GRACE", 0.0)
    monkeypatch.setattr(scheduler, "_TICK", 0.01)
    backend = Serial({"greedy": [..., ...]})
    rows = run(tmp_path, short(["hover", "greedy"], "0"), backend, Options(timeout=0.05))
    assert [row.status for row in rows] == ["done", "failed"]
    assert rows[1].error == "TimeoutError: took longer than the timeout of 0.05 s"
    assert len(backend.flown) == 3


@pytest.fixture
def cluster():
    """Connects to a cluster of one worker of a thread, of the given kind: in this process or in one with a nanny."""
    distributed = pytest.importorskip("distributed")

    @contextmanager
    def started(kind):
        workers = {0: {"cls": getattr(distributed, kind), "options": {"nthreads": 1}}}
        scheduler = {"cls": distributed.Scheduler, "options": {"dashboard_address": None}}
        with (
            distributed.SpecCluster(workers, scheduler, silence_logs=50) as local,
            connect(local.scheduler_address) as backend,
        ):
            backend.submit = Mock(wraps=backend.submit)
            yield backend

    return started


def test_trials_that_wait_for_a_worker_or_its_warm_up_do_not_hang(ailing, cluster, tmp_path, monkeypatch):
    monkeypatch.setattr(scheduler, "GRACE", 0.0)
    warm_up = Mock()
    warm_up.side_effect = lambda: time.sleep(1.0 if warm_up.call_count == 1 else 0.0)
    monkeypatch.setattr(trial_flight, "warm_up", warm_up)
    tasks = short([ailing("Sleeps", once=False)], "0-2")
    with cluster("Worker") as backend:
        rows = run(tmp_path, tasks, backend, Options(timeout=0.8))  # all three take longer
        assert backend.submit.call_count == len(tasks) and backend._names == backend._begun == {}
    assert [row.error for row in rows] == [""] * len(tasks)


@pytest.mark.slow
def test_a_trial_that_hangs_in_a_worker_ends_with_it_and_is_flown_again(ailing, cluster, tmp_path, monkeypatch):
    monkeypatch.setattr(scheduler, "GRACE", 0.0)
    tasks = short([ailing("Hangs"), "hover"], "0")
    with cluster("Nanny") as backend:
        rows = run(tmp_path, tasks, backend, Options(timeout=2.0))
        assert backend.submit.call_count == len(tasks) + 1 and backend._names == backend._begun == {}
    assert [row.error for row in rows] == [""] * len(tasks)


def test_an_executor_that_takes_no_more_ends_the_study_and_keeps_what_there_is(tmp_path):
    backend = Serial({"hover": [None, OSError("gone"), RuntimeError]})
    with pytest.raises(StoreError, match="no more trials can be flown: RuntimeError"):
        run(tmp_path, short(["hover"], "0-1"), backend)
    assert len(read_rows(tmp_path / "study")) == 1


def test_threads_give_the_rows_of_a_single_one_in_the_order_of_tasks(tmp_path):
    tasks = short(["hover", "greedy"], "2,0")[::-1]
    alone = [plain(fly_trial(task).row) for task in tasks]
    with ThreadPoolExecutor(3) as executor:
        assert list(map(plain, run(tmp_path, tasks, ExecutorBackend(executor)))) == alone
        assert list(map(plain, fly_tasks(tasks, ExecutorBackend(executor)))) == alone
    errors = [row.error for row in fly_tasks(tasks, Serial({"hover": ["ValueError: no"] * 4}))]
    assert errors == ["ValueError: no" if task.planner == "hover" else "" for task in tasks]


@pytest.mark.parametrize("ill", ["Dies", pytest.param("Hangs", marks=pytest.mark.slow)])
def test_processes_that_die_or_hang_lose_no_trial_and_change_no_row(tmp_path, ailing, monkeypatch, ill):
    monkeypatch.setattr(backends, "GRACE", 0.2)
    tasks = short(["hover", ailing(ill)], "0")
    before = dict(os.environ)
    with Pool(1) as flying:
        rows = run(tmp_path, tasks, flying, Options(timeout=2.0))
    assert list(map(plain, rows)) == [plain(fly_trial(task).row) for task in tasks]
    assert {row.status for row in rows} == {"done"} and (tmp_path / ill).exists()
    assert dict(os.environ) == before and multiprocessing.active_children() == []


@pytest.mark.slow
def test_trials_that_always_die_or_hang_are_recorded_with_their_error_and_line(tmp_path, ailing):
    tasks = short([ailing("Crashes", once=False), "hover", ailing("Hangs", once=False)], "0-1")
    with Pool(2) as flying:
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
