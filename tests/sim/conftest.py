"""Fixtures that call the command line within the process of a test."""

import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from helpers.commands import called
from helpers.studies import Serial

from sim.study import store
from sim.terminal import console


@pytest.fixture(scope="session", autouse=True)
def quick_stores():
    """Stores do not wait for the disk, which takes 10 ms and more a trial and helps if the power fails alone."""
    connect = store._connect

    @contextmanager
    def connect_quickly(path):
        with connect(path) as connection:
            connection.execute("PRAGMA synchronous = OFF")
            yield connection

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store, "_connect", connect_quickly)
        yield


@pytest.fixture
def call(tmp_path, monkeypatch, capsys, without_pictures):
    """Calls the command line in an empty folder of its own, without pictures: exit code, standard output and error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(console.console, "width", 80)
    return lambda *arguments, executor=None: called(arguments, monkeypatch, capsys, executor)


@pytest.fixture
def compare(call, monkeypatch):
    """Calls `understory compare` as `call` does, its trials flown by one executor."""
    monkeypatch.setattr(console.console, "width", 160)
    return lambda *arguments, executor=None: call("compare", *arguments, executor=executor or Serial())


def listing():
    """Everything in the current folder, what Python keeps of imported modules aside."""
    return sorted(path for path in Path().rglob("*") if "__pycache__" not in path.parts)


@pytest.fixture
def refused(call):
    """Calls a command that has to end with one line and leave the current folder as it was: that line."""

    def check(*arguments, code=2):
        before = listing()
        ended, out, err = call(*arguments)
        assert (ended, err.count("\n")) == (code, 1) and err.startswith("understory: ")
        assert "Traceback" not in out and listing() == before
        return err

    return check
