"""Wall time per stage, and processor time of planning."""

import time

import pytest

from sim.mission.stopwatch import STAGES, Stopwatch


def test_time_adds_up_per_stage_also_of_stages_that_fail(monkeypatch):
    instants = iter((1.0, 1.5, 10.0, 12.0, 20.0, 20.25, 23.0, 25.0))
    monkeypatch.setattr("sim.mission.stopwatch.time.perf_counter", instants.__next__)
    clock = Stopwatch()
    for stage in ("physics", "planning", "physics"):
        with clock.measure(stage):
            pass
    with pytest.raises(ZeroDivisionError), clock.measure("tracking"):
        1 / 0  # noqa: B018
    assert clock.seconds == dict.fromkeys(STAGES, 0.0) | {"physics": 0.75, "planning": 2.0, "tracking": 2.0}
    with pytest.raises(KeyError), clock.measure("napping"):
        pass


def test_processor_time_of_planning_leaves_out_waiting():
    clock = Stopwatch()
    with pytest.raises(ZeroDivisionError), clock.planning():
        until = time.process_time() + 0.05
        while time.process_time() < until:
            pass
        1 / 0  # noqa: B018
    busy = clock.planning_cpu_s
    assert 0.05 <= busy
    with clock.planning():
        time.sleep(0.2)
    assert clock.planning_cpu_s - busy < clock.laps["planning"][1] / 2
