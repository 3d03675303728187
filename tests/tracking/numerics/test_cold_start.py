"""The first run says that code is compiled; later ones load it; and it works where nothing can be kept."""

import gc
import re
from pathlib import Path

import numba
import pytest
from helpers.processes import python
from numba.core import event

from sim.mission.warmup import announce_compilation
from tracking.numerics import compiled as subject
from tracking.numerics import normal


def twice(x):
    return 2 * x


def thrice(x):
    return 3 * twice_compiled(x)


twice_compiled = numba.njit(twice)


def test_compiling_is_announced_and_timed_once_however_functions_call_each_other():
    said = []
    function = numba.njit(thrice)
    with announce_compilation(said.append):
        assert said == [] and function(7) == 42 and function(7.0) == 42.0
    assert len(said) == 2 and said[0] == "Compiling the numerical code, which takes about a minute."
    assert re.fullmatch(r"Compiled in \d+ s; it is kept for later runs\.", said[1])
    with announce_compilation(said.append):
        function(8)
    assert len(said) == 2


class Collecting(event.Listener):
    """Notes whether the garbage collector is on when a compilation begins."""

    def __init__(self):
        self.found = []

    def on_start(self, _):
        self.found.append(gc.isenabled())

    def on_end(self, _):
        pass


def test_the_garbage_collector_rests_while_code_is_compiled():
    function = numba.njit(thrice)
    with event.install_listener("numba:compile", Collecting()) as listener:
        assert function(7) == 21 * 2 and gc.isenabled()
        try:
            gc.disable()
            assert function(7.0) == 42.0 and not gc.isenabled()
        finally:
            gc.enable()
    assert listener.found and not any(listener.found)


@pytest.fixture
def nowhere(monkeypatch):
    """No folder can be written to, as numba finds when it tries."""

    def refuse(locator):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("numba.core.caching._CacheLocator.ensure_cache_path", refuse)
    monkeypatch.setattr(subject, "not_kept", kept := [])
    monkeypatch.setattr("sim.mission.warmup.not_kept", kept)


def test_where_nothing_can_be_kept_code_works_and_that_is_said(nowhere):
    said = []
    with announce_compilation(said.append):
        assert subject.compiled(twice)(21) == 42
    assert subject.not_kept == ["twice"]
    assert re.fullmatch(r"Compiled in \d+ s; no folder .* compiled anew each time; NUMBA_CACHE_DIR may .*", said[1])


def test_where_code_can_be_kept_nothing_is_noted(tmp_path, monkeypatch):
    monkeypatch.setattr(subject, "not_kept", [])
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert subject.compiled(twice)(21) == 42 and subject.not_kept == [] and list(tmp_path.rglob("*.nbc"))


def test_a_mission_compiles_nothing_in_flight():
    code = """
import gc
from numba.core.dispatcher import Dispatcher
from planning.planner_loading import load_planner
from planning.planners import DEFAULT_PLANNER
from sim.scenario.loading import load
from sim.mission.mission import Mission
from sim.mission.warmup import warm_up
def signatures():
    compiled = [d for d in gc.get_objects() if issubclass(type(d), Dispatcher)]
    return {(d.py_func.__qualname__, s) for d in compiled for s in d.overloads}
warm_up()
before = signatures()
for _ in Mission(load("forest", ["duration=6"]), load_planner(DEFAULT_PLANNER)).fly():
    pass
print(len(before) > 20, signatures() - before)
"""
    done = python("-c", code)
    assert done.stdout == "True set()\n"


def flown(folder, name, **environment):
    words = ["-m", "sim", "run", "--duration", "1", "--no-video", "--out", name]
    done = python(*words, cwd=folder, **environment)
    assert (done.returncode, done.stderr) == (0, "")
    return [line for line in done.stdout.splitlines() if "ompil" in line], (folder / name / "mission.npz").read_bytes()


@pytest.mark.slow
def test_the_first_run_says_that_it_compiles_and_the_second_nothing(tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    first, recording = flown(tmp_path, "first", **cache)
    assert first[0] == "Compiling the numerical code, which takes about a minute."
    assert re.fullmatch(r"Compiled in \d+ s; it is kept for later runs\.", first[1])
    assert flown(tmp_path, "second", **cache) == ([], recording)


@pytest.mark.slow
def test_a_run_without_any_cache_flies_the_same(tmp_path):
    # To root every folder can be written to: only one that cannot be made is left to numba.
    locator = "numba.core.caching.UserProvidedCacheLocator"
    nothing = {"NUMBA_CACHE_DIR": "/dev/null/cache", "NUMBA_CACHE_LOCATOR_CLASSES": locator}
    said, recording = flown(tmp_path, "uncached", **nothing)
    assert len(said) == 2 and "NUMBA_CACHE_DIR" in said[1]
    assert flown(tmp_path, "cached")[1] == recording


def test_kept_code_is_of_the_sources_that_it_was_compiled_from(tmp_path):
    (tmp_path / "tracking").mkdir()
    below, above = tmp_path / "tracking" / "below.py", tmp_path / "tracking" / "above.py"
    below.write_text("SCALE = 1.0\n")
    above.write_text("from tracking.below import SCALE\n")
    before = subject.digest_of(above, tmp_path)
    below.write_text("SCALE = 2.0\n")
    subject.digest_of.cache_clear()
    assert subject.digest_of(above, tmp_path) != before
    source = Path(normal.__file__)
    kept = normal.normal_cdf_each._dispatcher.cache._cache_file, normal.exp._cache._cache_file
    assert kept[0]._source_stamp[1] == subject.digest_of(source)
    assert kept[1]._source_stamp[1] == subject.digest_of(source.with_name("exponential.py"))


def test_code_runs_as_python_for_debugging():
    code = "from tracking.numerics.exponential import exp, exp_each; print(exp(0.0), exp_each([0.0])[0])"
    done = python("-c", code, NUMBA_DISABLE_JIT="1")
    assert (done.returncode, done.stdout) == (0, "1.0 1.0\n")
