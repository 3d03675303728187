"""Fixtures for tests of several parts."""

import gc
import signal

import pytest

# Modules and tests are some hundred thousand objects that stay. The garbage collector walks over them rarely while
# they are made, and no more afterwards; it took a sixth of the tests' time.
gc.set_threshold(10_000)


def pytest_collection_finish():
    """Leave to the garbage collector only what tests make."""
    gc.freeze()


@pytest.fixture
def random_team():
    """Makes situations of a team with the same beliefs in all its members, in a random forest."""
    # Not at the top, as the process that only hands out the tests needs none of it.
    from planning.testing.made_up_teams import make_random_team

    return make_random_team


@pytest.fixture
def without_pictures(monkeypatch):
    """Figures of runs and reports are made, but not laid out, and their files are empty: a third of a second each."""
    monkeypatch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda engine, figure: None)
    monkeypatch.setattr("sim.study.report.figures.pictures.encode_figure", lambda figure, kind: b"")
    monkeypatch.setattr("sim.running.pictures.save_figure", lambda figure, path: path.touch())
    monkeypatch.setattr("sim.running.beside.count_cores", lambda: 1)  # so that this process draws


@pytest.fixture
def heard():
    """Ctrl-C reaches these tests, and the processes they start, also where the shell that runs them ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
