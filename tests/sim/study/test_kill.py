"""Killed at any instant and started again, a study is what it would have been."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.processes import started_with
from helpers.studies import SHORT, plain

from sim.study.store import NAME, read_rows
from sim.study.study import read
from sim.study.tasks import tasks
from sim.study.trial import fly

ROOT = Path(__file__).parents[3]
FILE = "[study]\nplanners = ['hover', 'greedy']\nseeds = '{seeds}'\n[set]\n" + "\n".join(
    f"{key} = {value if value.isdigit() else repr(value)}" for key, value in SHORT.items()
)
# The same as the command, but on a thread, which starts in a fraction of the time that processes take.
THREAD = """
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from sim.study.backends import Borrowed
from sim.study.engine import complete
from sim.study.store import Store
from sim.study.study import read
from sim.study.tasks import tasks
found = tasks(read(sys.argv[1]))
with Store.opened(Path(sys.argv[2]), "killed") as store, ThreadPoolExecutor(1) as executor:
    complete(found, store, Borrowed(executor))
"""
PROCESSES = "import sys; from sim.__main__ import main; main()"


@pytest.fixture
def killed(tmp_path):
    """Kills a study again and again, lets it finish, and checks it against its trials flown one by one."""

    def check(code, arguments, seeds, instants):
        file, folder = tmp_path / "killed.toml", tmp_path / "out"
        file.write_text(FILE.format(seeds=seeds))
        command = [sys.executable, "-c", code, *(a.format(file=file, folder=folder) for a in arguments)]
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
        assert start(command).wait() == 0
        assert {key: value for key, value in stored(folder).items() if key in kept} == kept
        expected = [plain(fly(task).row) for task in tasks(read(str(file)))]
        found = [plain(row) for row in read_rows(folder)]
        assert sorted(map(str, found)) == sorted(map(str, expected))
        return len(kept), len(expected)

    return check


def start(command, **options):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "KILLED_BY": str(os.getpid())}
    options = {"stdout": subprocess.DEVNULL, "start_new_session": True, **options}
    return subprocess.Popen(command, env=environment, **options)


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


def test_killed_twice_while_it_flies(killed):
    rng = np.random.default_rng(0)

    def after_some(process, folder):
        before = len(stored(folder))
        while len(stored(folder)) == before and process.poll() is None:
            time.sleep(0.02)
        time.sleep(rng.uniform(0.0, 0.2))

    kept, total = killed(THREAD, ["{file}", "{folder}"], "0-9", [after_some] * 2)
    assert 2 <= kept < total


@pytest.mark.usefixtures("heard")
def test_ctrl_c_in_a_terminal_ends_all_processes_in_one_line(tmp_path):
    (tmp_path / "killed.toml").write_text(FILE.format(seeds="0-99"))
    words = ["compare", str(tmp_path / "killed.toml"), "--out", str(tmp_path / "out"), "--workers", "1"]
    started = start([sys.executable, "-c", PROCESSES, *words], stderr=subprocess.PIPE, text=True)
    give_up = time.monotonic() + 120.0  # where nothing can be flown, its complaints fill the pipe, and it waits
    while len(stored(tmp_path / "out")) < 3 and started.poll() is None and time.monotonic() < give_up:
        time.sleep(0.02)
    os.killpg(started.pid, signal.SIGINT)  # what a terminal sends: to workers as well
    _, err = started.communicate(timeout=30)
    kept = len(stored(tmp_path / "out"))
    told = f"{kept} of 200 trials are kept in {tmp_path / 'out'}, the same command flies the rest"
    assert (started.returncode, err) == (1, f"understory: interrupted; {told}\n") and 3 <= kept < 200
    assert gone()


@pytest.mark.slow
def test_killed_twenty_times_at_random_instants(killed):
    rng = np.random.default_rng(1)

    def any_time(process, folder):
        time.sleep(rng.uniform(0.0, 12.0))

    arguments = ["compare", "{file}", "--out", "{folder}", "--workers", "2"]
    killed(PROCESSES, arguments, "0-149", [any_time] * 20)
