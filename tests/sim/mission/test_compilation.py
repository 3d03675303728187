"""Compilation in several processes: who does what, where the code goes, and what happens if it fails."""

import threading

import pytest
from helpers.processes import python

from sim.mission import compilation
from tracking.numerics import compiled

WORKER = """
import os, sys
from pathlib import Path
home = Path(os.environ["NUMBA_CACHE_DIR"]) / "named otherwise" / "module"
home.mkdir(parents=True)
os.write(1, b"a line of a library\\n")
while number := os.read(0, 1):
    name = f"mine.part{number[0]}"
    for end in ("1.nbc", "2.nbc", "nbi"):
        (home / f"{name}.{end}").write_text(f"{name} {end}")
    os.write(1, f"{name}\\n".encode())
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    """An empty folder for code on a machine of three cores, and functions of which none is compiled."""
    home = tmp_path / "home"
    (home / "module").mkdir(parents=True)
    names = {f"mine.part{k}": home / "module" for k in range(len(compilation.PARTS))}
    for module in compilation, compiled:
        monkeypatch.setattr(module, "functions", names)
    monkeypatch.setattr(compilation, "code_folder", lambda: home)
    monkeypatch.setattr(compilation, "count_cores", lambda: 3)
    monkeypatch.setattr(compilation, "_MANY", 1)
    monkeypatch.setattr(compilation, "_WORKER", WORKER)
    return home


def test_processes_share_the_parts_and_their_code_ends_in_one_folder(home):
    done = []
    (home / "new" / "0").mkdir(parents=True)  # as a killed process leaves it
    assert compilation.is_mostly_uncompiled()
    compilation.compile_in_processes(done.append)
    assert "a line of a library" in done and sorted(set(done) & set(compiled.functions)) == sorted(compiled.functions)
    assert {path.name for path in (home / "module").iterdir()} == {
        f"{name}.{end}" for name in compiled.functions for end in ("1.nbc", "2.nbc", "nbi")
    }
    assert not (home / "new").exists() and not compilation.is_mostly_uncompiled()


def test_code_that_is_there_is_not_replaced(home, tmp_path):
    (home / "module" / "mine.part0.nbi").write_text("before")
    new = tmp_path / "new" / "named otherwise" / "module"
    new.mkdir(parents=True)
    for name in ("mine.part0.nbi", "mine.part0.1.nbc", "mine.part1.nbi", "mine.part1.1.nbc"):
        (new / name).write_text("after")
    compiled.take_code(tmp_path / "new", home)
    assert (home / "module" / "mine.part0.nbi").read_text() == "before"
    assert {path.name for path in (home / "module").iterdir()} == {
        "mine.part0.nbi",
        "mine.part1.nbi",
        "mine.part1.1.nbc",
    }


def test_of_processes_that_start_together_one_compiles_and_the_others_wait(home):
    done = [[], [], []]
    threads = [threading.Thread(target=compilation.compile_in_processes, args=(one.append,)) for one in done]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(len(set(one) & set(compiled.functions)) for one in done) == [0, 0, len(compilation.PARTS)]


@pytest.mark.parametrize("worker", ["raise SystemExit(1)", "import os; os.kill(os.getpid(), 9)"])
def test_what_fails_in_a_process_is_left_to_the_caller(home, worker, monkeypatch):
    monkeypatch.setattr(compilation, "_WORKER", worker)
    compilation.compile_in_processes()
    assert compilation.is_mostly_uncompiled() and not (home / "new").exists()


def test_a_mission_compiles_nothing_in_flight_and_the_parts_nothing_that_it_does_not():
    """A part with other types than a mission's would take time for code that nobody calls."""
    code = """
import gc
from numba.core.dispatcher import Dispatcher
from planning.planner_loading import load_planner
from planning.catalogue import DEFAULT_PLANNER
from sim.mission.compilation import PARTS
from sim.mission.mission import Mission
from sim.mission.warmup import warm_up
from sim.scenario.loading import load_scenario
from tracking.numerics.compiled import functions
def signatures():
    gc.unfreeze()  # `warm_up` takes objects out of the sight of `gc`
    compiled = [d for d in gc.get_objects() if issubclass(type(d), Dispatcher)]
    return {(f"{d.py_func.__module__}.{d.py_func.__qualname__}", s) for d in compiled for s in d.overloads}
warm_up()
warm = signatures()
for _ in Mission(load_scenario("forest", ["duration=6"]), load_planner(DEFAULT_PLANNER)).fly():
    pass
flown = signatures()
for part in PARTS:
    part()
more = {(name, s) for name, s in signatures() - flown if name in functions}
print(len({name for name, _ in warm} & set(functions)) > 60, flown - warm, more)
"""
    done = python("-c", code)
    assert done.stdout == "True set() set()\n", done.stdout + done.stderr
