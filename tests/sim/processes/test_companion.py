"""A process to which values are sent."""

import os
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from helpers.processes import python

from sim.processes.companion import Companion, CompanionLost

LARGE = np.zeros(2_000_000)  # 16 MB


def companion(name):
    return Companion(f"helpers.companions:{name}")


def test_values_arrive_in_order_and_as_they_were_when_they_were_sent():
    value = np.arange(3)
    with companion("collect") as process:
        for number in range(100):
            value[0] = number
            process.send(value)
        process.end()
        np.testing.assert_array_equal(process.result(), [[number, 1, 2] for number in range(100)])


def test_what_libraries_print_is_no_part_of_the_result(capfd):
    with companion("print_and_add") as process:
        process.send(1)
        process.send(2)
        process.end()
        assert process.result() == 3
    assert capfd.readouterr() == ("", "")


def test_an_exception_of_the_function_is_that_of_the_sender():
    with companion("fail_at_the_third") as process, pytest.raises(OSError) as raised:
        while True:
            process.send(LARGE)  # until it is noticed
    assert (raised.value.errno, raised.value.filename) == (28, "mission.mp4")
    with companion("fail_oddly") as process, pytest.raises(RuntimeError, match="ValueError: odd"):
        process.end()
        process.result()


def test_a_process_that_dies_is_told_with_its_signal_and_keeps_nobody_waiting():
    with companion("die_at_the_third") as process, pytest.raises(CompanionLost, match="was killed by SIGKILL"):
        while True:
            process.send(LARGE)
    with companion("die_at_the_third") as process, pytest.raises(CompanionLost, match="was killed by SIGKILL"):
        for _ in range(3):
            process.send(0)
        process.end()
        process.result()


def test_a_companion_ends_with_its_block_and_ignores_ctrl_c(heard):
    with companion("collect") as process:
        process.send(1)
        for number in (signal.SIGINT, signal.SIGTERM):
            os.kill(process.pid, number)
        process.end()
        assert process.result() == [1]
    with companion("collect") as process:
        process.send(LARGE)
        left = process.pid
    assert not Path(f"/proc/{left}").exists()


def test_a_companion_ends_with_a_process_that_is_killed():
    code = """
import os, signal
from sim.processes.companion import Companion
process = Companion("helpers.companions:collect")
process.send(0)
print(process.pid, flush=True)
signal.pause()
"""
    with python("-c", code, started=True, cwd=Path(__file__).parents[2]) as process:
        left = Path(f"/proc/{process.stdout.readline().strip()}")
        assert left.exists()
        process.kill()
    deadline = time.monotonic() + 60
    while left.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    with suppress(FileNotFoundError):
        assert "State:\tZ" in (left / "status").read_text()  # nobody waits for it here


def test_a_script_without_a_guard_is_not_run_again(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("""
from sim.processes.companion import Companion
print("once")
with Companion("helpers.companions:collect") as process:
    process.end()
    print(process.result())
""")
    tests = str(Path(__file__).parents[2])
    ended = python(script, PYTHONPATH=os.pathsep.join([str(Path(tests).parent), tests]))
    assert isinstance(ended, subprocess.CompletedProcess) and (ended.stdout, ended.stderr) == ("once\n[]\n", "")
