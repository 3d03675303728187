"""What is done and what remains, in a terminal and in a log."""

import heapq
import io
import re
import time
from collections import Counter

import numpy as np
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
        patience = iter(range(400))  # the bar is drawn ten times a second, by a thread of its own
        while "compiling: 37 of 81 functions, 0:22 left" not in output() and next(patience, None) is not None:
            time.sleep(0.05)
        for k in range(6):
            tell(ScanProgress(k / 5, [0.5]))
    assert "compiling: 37 of 81 functions, 0:22 left" in output()
    last = [line for line in output().splitlines() if "OSPA" in line][-1]
    assert "1.0 of 1 s, OSPA 0.50 m, mean 0.50 m" in last and "left" not in last


def test_a_study_tells_its_pace_in_a_log(shown):
    wait, output = shown(terminal=False)
    with progress.show_study_progress(Counter(a=2, b=2)) as tell:
        for cell, seconds in (("a", 10.0), ("b", None), ("a", 9.0)):
            wait(10.0)
            tell(cell, seconds, True)
    assert output().splitlines() == [
        "1 of 4 trials, 6.0 a minute",
        "2 of 4 trials, 6.0 a minute, 1 failed",
        "3 of 4 trials, 6.0 a minute, 0:10 left, 1 failed",
    ]
    assert progress.describe_pace(0, None, 0, 3.0) == ""
    assert progress.describe_pace(1, 9999.6, 0, 100.0) == ", 0.6 a minute, 2:46:40 left"


@pytest.mark.parametrize("workers", [1, 2, 7, 32])
@pytest.mark.parametrize("cells", [[6.0], [1.0, 2.0, 60.0], [40.0, 1.0, 1.0, 1.0]])
def test_every_estimate_of_the_rest_of_a_study_is_within_a_factor_of_two(shown, workers, cells):
    """The first one, too, though processes start for 30 s, planners differ, and many fly at once."""
    wait, _ = shown(terminal=True)
    rng = np.random.default_rng(0)
    trials = [(cell, mean * rng.uniform(0.7, 1.3)) for _ in range(90) for cell, mean in enumerate(cells)]
    free, ends = [30.0] * workers, []
    for cell, seconds in trials:
        end = heapq.heapreplace(free, free[0] + seconds) + seconds
        ends.append((end, cell, seconds))
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            progress, "describe_pace", lambda flown, rest, failures, seconds: told.append((seconds, rest)) or ""
        )
        with progress.show_study_progress(Counter(cell for cell, _ in trials)) as tell:
            for end, cell, seconds in sorted(ends):
                wait(end - progress.time.monotonic())
                tell(cell, seconds, True)
    last = max(ends)[0]
    wrong = [(rest, last - now) for now, rest in told if rest is not None and last - now > max(cells)]
    assert len(wrong) > 1 and all(0.5 < rest / true < 2.0 for rest, true in wrong)


def test_the_first_estimate_of_a_mission_waits_for_more_than_one_decision(shown):
    wait, output = shown(terminal=True)
    with progress.show_mission_progress(Scenario(duration=40.0)) as tell:
        for k in range(201):
            wait(0.01 + 1.0 * (k % 5 == 1))
            tell(ScanProgress(k / 5, [0.5]))
            time.sleep(0.003)
    first = re.search(r"(\d+):(\d\d) left", output())
    assert 0.5 < (60 * int(first[1]) + int(first[2])) / 42.0 < 2.0
