"""What is done and what remains, in a terminal and in a log."""

import io
import time

import pytest
from rich.console import Console

from sim.mission.trial import Compilation, ScanProgress
from sim.scenario.scenario import Scenario
from sim.terminal import console, progress


@pytest.fixture
def shown(monkeypatch):
    """Replaces the terminal and the clock: a function that waits, and one that returns all output so far."""
    clock = [0.0]

    def begin(terminal):
        out = io.StringIO()
        fake = Console(file=out, force_terminal=terminal, width=80, highlight=False, color_system=None)
        for module in console, progress:
            monkeypatch.setattr(module, "console", fake)
        monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
        return lambda seconds: clock.__setitem__(0, clock[0] + seconds), out.getvalue

    return begin


def test_a_log_gets_lines_less_and_less_often_with_what_remains(shown):
    wait, output = shown(terminal=False)
    with progress.show_mission_progress(Scenario(duration=400.0)) as tell:
        for k in range(40):
            wait(1.0)
            tell(Compilation(k + 1, 81))
        for k in range(2001):
            wait(0.5)
            tell(ScanProgress(k / 5, [0.5, 1.5]))
    lines = output().splitlines()
    assert lines[0] == "compiling: 10 of 81 functions, 1:11 left"
    assert lines[4] == "3.8 of 400 s, OSPA 1.00 m, mean 1.00 m, 16:30 left"
    assert len(lines) < 40 and lines[-1].endswith(" left")


def test_a_terminal_has_a_bar_of_what_is_compiled_and_then_of_the_flight(shown):
    wait, output = shown(terminal=True)
    with progress.show_mission_progress(Scenario(duration=1.0)) as tell:
        for k in range(38):
            wait(0.5)
            tell(Compilation(k, 81))
        time.sleep(0.3)  # the bar is drawn ten times a second
        for k in range(6):
            tell(ScanProgress(k / 5, [0.5]))
    assert "compiling: 37 of 81 functions, 0:22 left" in output()
    last = [line for line in output().splitlines() if "OSPA" in line][-1]
    assert "1.0 of 1 s, OSPA 0.50 m, mean 0.50 m" in last and "left" not in last


def test_a_study_tells_its_pace_in_a_log(shown):
    wait, output = shown(terminal=False)
    with progress.show_study_progress(4) as tell:
        for failed in (False, True):
            wait(10.0)
            tell(failed, True)
    assert output().splitlines() == [
        "1 of 4 trials, 6.0 a minute, 0:30 left",
        "2 of 4 trials, 6.0 a minute, 0:20 left, 1 failed",
    ]
    describe_pace = progress.describe_pace
    assert describe_pace(0, 10, 0, 3.0) == "" and describe_pace(2, 10, 1, 20.0) == ", 6.0 a minute, 1:40 left, 1 failed"
    assert describe_pace(1, 100, 0, 100.0) == ", 0.6 a minute, 2:46:40 left"
    assert describe_pace(10, 0, 0, 20.0) == ", 30.0 a minute"
