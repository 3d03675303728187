"""A worker that dies or hangs ends only its own task, which tells how; Ctrl-C and the parent's death leave none."""

import ctypes
import multiprocessing
import os
import signal
import time
from functools import partial

import pebble
import pytest
from helpers.processes import python, started_with

from sim.processes.workers import start_workers


def double(number):
    return 2 * number


def crash():
    ctypes.string_at(0)


def leave():
    os._exit(3)


def be_killed():
    os.kill(os.getpid(), signal.SIGKILL)


def hang():
    while True:
        time.sleep(600)


def hang_in_c():
    """Hold the interpreter's lock, so that no signal handler and no thread of Python runs."""
    while True:
        ctypes.PyDLL(None).usleep(900_000)


def press_ctrl_c():
    raise KeyboardInterrupt


ENDS = {
    crash: "its process was killed by SIGSEGV",
    leave: "its process ended by itself, with exit code 3",
    be_killed: "its process was killed by SIGKILL",
    hang: "took longer than the timeout of 0.3 s",
    hang_in_c: "took longer than the timeout of 0.3 s",
    press_ctrl_c: "",
}


def test_tasks_that_die_or_hang_say_how_and_where_and_the_others_are_done(monkeypatch):
    monkeypatch.setattr(pebble.CONSTS, "term_timeout", 0.2)  # s until a worker that ignores SIGTERM is killed
    with start_workers(2, time.sleep, 0.4) as workers:  # the start takes longer than tasks may
        ill = {work: workers.submit(work, 0.3) for work in ENDS}
        well = [workers.submit(partial(double, number), 0.3) for number in range(4)]
        told = {work: str(future.exception()) for work, future in ill.items()}
        assert [future.result() for future in well] == [0, 2, 4, 6]
    for work in (crash, hang):
        how, _, place = told[work].partition(" (")
        assert how == ENDS[work] and place.startswith(f"{__file__}:") and place.endswith(f", in {work.__name__})")
    for work in (leave, be_killed, press_ctrl_c):
        assert told[work] == ENDS[work]
    assert told[hang_in_c].startswith(ENDS[hang_in_c])
    assert multiprocessing.active_children() == []


PARENT = """
import pathlib, signal, sys, time
from functools import partial
from sim.processes.workers import start_workers

def work(name):
    pathlib.Path(name).touch()
    time.sleep(600)

if __name__ == "__main__":
    with start_workers(2, time.sleep, 0.0) as workers:
        for name in sys.argv[1:]:
            workers.submit(partial(work, name))
        print("started", flush=True)
        time.sleep(600)
"""


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize("at_work", [False, True], ids=["while workers start", "at work"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_outlasts_its_parent_and_only_that_complains(tmp_path, number, at_work):
    (tmp_path / "parent.py").write_text(PARENT)
    tasks = tmp_path / "a", tmp_path / "b"
    parent = python(tmp_path / "parent.py", *tasks, started=True, start_new_session=True, PARENT=str(tmp_path))
    parent.stdout.readline()
    time.sleep(0.2)
    while at_work and parent.poll() is None and not all(task.exists() for task in tasks):
        time.sleep(0.02)
    (os.killpg if number == signal.SIGINT else os.kill)(parent.pid, number)  # a terminal's Ctrl-C reaches all
    parent.wait()
    give_up = time.monotonic() + 30
    while left := started_with("PARENT", tmp_path):
        assert time.monotonic() < give_up, left
        time.sleep(0.05)
    if number == signal.SIGINT:
        assert parent.stderr.read().count("Traceback") == 1
