"""Work in a process of its own ends when it is asked to, when it has to, and with what it has started."""

import multiprocessing
import signal
import subprocess
import threading
import time

import pytest
from helpers.processes import ended

from sim.processes import isolation as module
from sim.processes.isolation import IsolationError, run_isolated
from sim.processes.signals import stop_request


def compiles(tell):
    tell("Compiling")
    time.sleep(600)


def flies(tell):
    tell("Compiled")
    with stop_request() as stop:
        tell(0.2)
        return stop.wait(60)


def is_deaf(tell):
    tell(0.2)  # but it has not asked for Ctrl-C
    time.sleep(600)


def has_children(tell):
    tell(subprocess.Popen(["sleep", "600"]).pid)
    child = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(600,))
    child.start()
    tell(child.pid)
    return "done"


def pressing(*keys):
    """Hears, and presses Ctrl-C when it is told one of the keys."""
    return lambda told: signal.raise_signal(signal.SIGINT) if told in keys else None


def listened(work, hear, timeout=30.0):
    return run_isolated(work, hear=hear, listening=float, timeout=timeout)


@pytest.fixture(autouse=True)
def as_before():
    """Signals are handled as before afterwards, and no process is left."""
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    yield
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    assert multiprocessing.active_children() == []


def test_ctrl_c_ends_code_that_compiles_and_is_passed_on_in_flight():
    with pytest.raises(KeyboardInterrupt):
        listened(compiles, pressing("Compiling"))
    assert listened(flies, pressing(0.2)) is True


def test_a_second_ctrl_c_ends_code_that_ignores_the_first(monkeypatch):
    monkeypatch.setattr(module, "_GRACE", 0.1)

    def twice(told):
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        listened(is_deaf, twice)


def test_ctrl_c_before_isolated_code_has_started_is_not_lost(monkeypatch):
    stop_signals = module.stop_signals

    def interrupted(handler):
        if handler is signal.SIG_IGN:
            signal.raise_signal(signal.SIGINT)
        return stop_signals(handler)

    monkeypatch.setattr(module, "stop_signals", interrupted)
    with pytest.raises(KeyboardInterrupt):
        listened(compiles, print)


def test_processes_that_isolated_code_has_started_end_with_it():
    pids = []
    assert listened(has_children, pids.append) == "done" and len(pids) == 2 and all(map(ended, pids))


def test_code_that_cannot_be_pickled_or_takes_too_long_is_an_error():
    with pytest.raises(TypeError, match="pickle"):
        run_isolated(compiles, threading.Lock(), hear=print, listening=float, timeout=30.0)
    with pytest.raises(IsolationError, match=r"longer than the timeout of 0\.5 s"):
        listened(compiles, print, timeout=0.5)
