"""Killed at any instant and started again, or with a worker of a cluster killed, a study is what it would have been."""

import gc
import os
import signal
import sqlite3
import threading
import time

import numpy as np
import pytest
from helpers.processes import python, started_with
from helpers.studies import SHORT, Serial, plain, short

from sim.study.definition import read_study
from sim.study.executors import connect
from sim.study.scheduler import complete
from sim.study.store import NAME, Store, StoreError, read_rows
from sim.study.trial_flight import fly_trial
from sim.study.trials import list_trials
from tracking.errors import InputError

FILE = "[study]\nplanners = ['hover', 'greedy']\nseeds = '{seeds}'\n[set]\n" + "\n".join(
    f"{key} = {value if value.isdigit() else repr(value)}" for key, value in SHORT.items()
)
# The same as the command, but on a thread, which starts in a fraction of the time that processes take.
THREAD = """
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from sim.study.scheduler import complete
from sim.study.store import Store
from sim.study.definition import read_study
from sim.study.trials import list_trials
found = list_trials(read_study(sys.argv[1]))
with Store.open(Path(sys.argv[2]), "killed") as store, ThreadPoolExecutor(1) as executor:
    complete(found, store, executor)
"""
PROCESSES = "import sys; from sim.__main__ import main; main()"


@pytest.fixture
def killed(tmp_path):
    """Kills a study again and again, finishes it here, and checks it against its trials flown one by one."""

    def check(code, arguments, seeds, instants):
        file, folder = tmp_path / "killed.toml", tmp_path / "out"
        file.write_text(FILE.format(seeds=seeds))
        command = ["-c", code, *(a.format(file=file, folder=folder) for a in arguments)]
        kept = {}
        for instant in instants:
            started = start(command)
            instant(started, folder)
            started.kill()
            started.wait()
            assert gone()
            now = stored(folder)
            assert {key: now[key] for key in kept} == kept  # complete ones are not flown again
            kept = now
        every = list_trials(read_study(str(file)))
        with Store.open(folder, "killed") as store:
            rows = complete(every, store, Serial())
        assert {key: value for key, value in stored(folder).items() if key in kept} == kept
        assert list(map(plain, rows)) == [plain(fly_trial(task).row) for task in every]
        return len(kept), len(every)

    return check


def start(command):
    return python(*command, started=True, start_new_session=True, KILLED_BY=str(os.getpid()))


def stored(folder):
    """Time of completion and duration of each trial, of a store that is sound."""
    if not (folder / NAME).exists():
        return {}
    sql = sqlite3.connect(folder / NAME)
    try:
        assert sql.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        if not sql.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            return {}
        return {key: rest for key, *rest in sql.execute("SELECT key, finished, metrics FROM trials")}
    finally:
        sql.close()


def gone():
    """True if all that was started here ends within a while, and all that it has started."""
    for _ in range(100):
        if not started_with("KILLED_BY", os.getpid()):
            return True
        time.sleep(0.1)
    return False


def test_a_study_killed_in_flight_goes_on_to_the_same_rows(killed):
    rng = np.random.default_rng(0)

    def after_some(process, folder):
        before = len(stored(folder))
        while len(stored(folder)) == before and process.poll() is None:
            time.sleep(0.02)
        time.sleep(rng.uniform(0.0, 0.2))

    kept, total = killed(THREAD, ["{file}", "{folder}"], "0-5", [after_some])
    assert 1 <= kept < total


@pytest.mark.slow  # test_workers presses Ctrl-C for all processes, test_compare for the one line
@pytest.mark.usefixtures("heard")
def test_ctrl_c_in_a_terminal_ends_all_processes_in_one_line(tmp_path):
    (tmp_path / "killed.toml").write_text(FILE.format(seeds="0-99"))
    words = ["compare", str(tmp_path / "killed.toml"), "--out", str(tmp_path / "out"), "--workers", "1"]
    started = start(["-c", PROCESSES, *words])
    give_up = time.monotonic() + 120.0  # where nothing can be flown, its complaints fill the pipe, and it waits
    while len(stored(tmp_path / "out")) < 3 and started.poll() is None and time.monotonic() < give_up:
        time.sleep(0.02)
    os.killpg(started.pid, signal.SIGINT)  # what a terminal sends: to workers as well
    _, err = started.communicate(timeout=30)
    kept = len(stored(tmp_path / "out"))
    told = (
        f"understory: interrupted; {kept} of 200 trials are kept in {tmp_path / 'out'}, the same command flies the rest"
    )
    assert err.startswith(told) and err.count("\n") == 1
    assert started.returncode == 1 and 3 <= kept < 200 and gone()


@pytest.mark.slow
def test_a_study_killed_twenty_times_ends_with_the_same_rows(killed):
    rng = np.random.default_rng(1)

    def any_time(process, folder):
        time.sleep(rng.uniform(0.0, 12.0))

    arguments = ["compare", "{file}", "--out", "{folder}", "--workers", "2"]
    killed(PROCESSES, arguments, "0-149", [any_time] * 20)


def test_a_worker_killed_in_mid_study_loses_no_trial_and_changes_no_row(tmp_path):
    distributed = pytest.importorskip("distributed")
    tasks = short(["hover", "greedy"], "0-1", repeats=2)
    killed = []
    # One worker is a process, the other is in this one and has to fly the rest.
    kinds = (distributed.Nanny, distributed.Worker)
    workers = {k: {"cls": kind, "options": {"nthreads": 1}} for k, kind in enumerate(kinds)}
    scheduler = {"cls": distributed.Scheduler, "options": {"dashboard_address": None}}
    with (
        distributed.SpecCluster(workers, scheduler, silence_logs=50) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):

        def kill(row, fresh):
            if not killed:
                nanny = local.workers[0]
                nanny.auto_restart = False
                killed.extend(client.processing()[nanny.worker_address])  # trials that it has been given
                os.kill(nanny.pid, signal.SIGKILL)

        with Store.open(tmp_path, "short") as store:
            rows = complete(tasks, store, client.get_executor(pure=False), on_row=kill)
    assert killed and list(map(plain, rows)) == [plain(fly_trial(task).row) for task in tasks]
    assert len(read_rows(tmp_path)) == len(tasks)


SCHEDULER = """
import asyncio
from distributed import Scheduler
async def serve():
    async with Scheduler(port=0, dashboard_address=None) as scheduler:
        print(scheduler.address, flush=True)
        await scheduler.finished()
asyncio.run(serve())
"""


@pytest.fixture
def scheduler():
    """A process that is a scheduler without workers, and its address."""
    pytest.importorskip("distributed")
    process = python("-c", SCHEDULER, started=True)
    yield process, process.stdout.readline().strip()
    process.kill()
    process.communicate()


@pytest.fixture
def add_worker(scheduler):
    """Starts a worker of the scheduler in this process."""
    distributed = pytest.importorskip("distributed")
    with distributed.Client(scheduler[1], set_as_default=False) as client:

        async def start():
            return await distributed.Worker(scheduler[1], nthreads=1, dashboard=False, silence_logs=50)

        workers = []
        yield lambda: workers.append(client.sync(start))
        for worker in workers:
            client.sync(worker.close)


def test_a_study_waits_for_workers_and_if_its_scheduler_dies_no_trial_is_blamed(tmp_path, scheduler, add_worker, capfd):
    process, address = scheduler
    tasks = short(["hover", "greedy"], "0-3")

    def kill(row, fresh):
        if fresh:
            process.kill()

    with Store.open(tmp_path, "short") as store:
        with connect(address) as cluster:
            begun = threading.Timer(0.5, add_worker)
            begun.start()
            (row,) = complete(tasks[:1], store, cluster)
            begun.join()
            assert row.status == "done"
        told = f"understory: --dask: '{address}' has no workers yet; trials wait for the first\n"
        assert capfd.readouterr().err == told
        with pytest.raises(StoreError, match=f"^--dask: '{address}' no longer answers$"), connect(address) as cluster:
            complete(tasks, store, cluster, on_row=kill)
    rows = read_rows(tmp_path)
    assert 2 <= len(rows) < len(tasks) and {row.status for row in rows} == {"done"}


def test_an_address_that_does_not_answer_is_one_line(capfd):
    pytest.importorskip("distributed")
    start = time.monotonic()
    for address in ("tcp://127.0.0.1:9", "nonsense", "nonsense://x", "127.0.0.1:notaport"):
        with pytest.raises(InputError, match=f"--dask: '{address}' does not answer") as raised, connect(address, 0.2):
            pass
        assert "\n" not in str(raised.value)
    gc.collect()
    assert capfd.readouterr() == ("", "") and time.monotonic() - start < 60
