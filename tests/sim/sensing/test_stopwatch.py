"""Wall time per stage."""

import pytest

from sim.sensing.stopwatch import STAGES, Stopwatch


@pytest.fixture
def ticks(monkeypatch):
    """A clock that shows the given instants, one per reading."""

    def set_to(*instants):
        monkeypatch.setattr("sim.sensing.stopwatch.time.perf_counter", iter(instants).__next__)

    return set_to


def test_time_adds_up_per_stage(ticks):
    ticks(1.0, 1.5, 10.0, 12.0, 20.0, 20.25)
    clock = Stopwatch()
    for stage in ("physics", "planning", "physics"):
        with clock.measure(stage):
            pass
    assert clock.seconds == dict.fromkeys(STAGES, 0.0) | {"physics": 0.75, "planning": 2.0}


def test_a_stage_that_fails_counts_too(ticks):
    ticks(3.0, 5.0)
    clock = Stopwatch()
    with pytest.raises(ZeroDivisionError), clock.measure("tracking"):
        1 / 0  # noqa: B018
    assert clock.seconds["tracking"] == 2.0


def test_there_are_no_other_stages():
    clock = Stopwatch()
    with pytest.raises(KeyError), clock.measure("napping"):
        pass
    assert tuple(clock.seconds) == STAGES
