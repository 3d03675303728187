"""Compilation of a mission's numerical code in several processes, before Numba would compile one function at a time."""

import fcntl
import gc
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numba.core import event

from planning.catalogue import DEFAULT_PLANNER
from planning.planner_loading import load_planner
from planning.testing.made_up_teams import make_flying_team
from sim.installation import ROOT
from sim.mission.tracker_fleet import make_trackers
from sim.mission.tracker_setup import make_planned_motion
from sim.mission.world_setup import make_forest_and_people
from sim.processes.cores import count_cores
from sim.scenario.environment import Trees, Wind
from sim.scenario.scenario import Scenario
from sim.sensing.detector_check import stage_frames
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.filter.kalman import Gaussian
from tracking.fusion.consensus import step
from tracking.geometry.camera import Pose
from tracking.numerics.compiled import code_folder, find_uncompiled, functions, take_code
from tracking.testing.stage import make_scan
from tracking.track import Track

_MANY = 60  # functions, which take longer to compile than processes take to start
_WORKER = "import sys; sys.path[0] = sys.argv[1]; from sim.mission.compilation import work; work()"


def is_mostly_uncompiled() -> bool:
    """True if so many functions of the modules that are imported have no code on disk that processes save time."""
    return len(find_uncompiled()) >= _MANY


def compile_in_processes(done: Callable[[str], None] = lambda name: None) -> None:
    """Compile the code of a mission in a process for each core, at most one for each of `PARTS`.

    Nothing is compiled if there is one core, or no folder for the code.
    done: called with the name of each function that is compiled. If several processes call this at once, one compiles
    and the others wait. What the parts below leave out, or what fails, is compiled when it is first called.
    """
    home, count = code_folder(), min(count_cores(), len(PARTS))
    if home is None or count == 1:
        return
    with suppress(OSError), open(home / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # until the file is closed, or the process dies
        if is_mostly_uncompiled():
            _run_workers(count, home, done)


def _run_workers(count: int, home: Path, done: Callable[[str], None]) -> None:
    """Start processes that take parts from one pipe and write the names of compiled functions to another.

    Each keeps its code in a folder of its own, because Numba confuses what two processes write at once for a function.
    """
    new = home / "new"
    started: list[subprocess.Popen[bytes]] = []
    shutil.rmtree(new, ignore_errors=True)  # what a killed process left
    (parts, offered), (names, told) = os.pipe(), os.pipe()
    try:
        with open(offered, "wb") as numbers:
            numbers.write(bytes(range(len(PARTS))))
        with open(names) as compiled, open(parts, "rb") as stdin, open(told, "wb") as stdout:
            for k in range(count):
                environment = {**os.environ, "NUMBA_CACHE_DIR": str(new / str(k))}
                command = [sys.executable, "-c", _WORKER, str(ROOT)]
                started.append(
                    subprocess.Popen(command, stdin=stdin, stdout=stdout, stderr=subprocess.DEVNULL, env=environment)
                )
            stdout.close()
            for name in compiled:
                done(name.rstrip())
        for k in range(count):
            take_code(new / str(k), home)
    finally:
        for process in started:
            process.kill()
            process.wait()
        shutil.rmtree(new, ignore_errors=True)


class _Teller(event.Listener):
    """Writes the names of our functions that are compiled to standard output."""

    def on_start(self, _: event.Event) -> None:
        """Nothing is shown."""

    def on_end(self, ended: event.Event) -> None:
        if name := name_compiled(ended):
            os.write(sys.stdout.fileno(), f"{name}\n".encode())


def name_compiled(ended: event.Event) -> str:
    """Name of our function whose compilation has ended; empty if it is Numba's or of a plug-in."""
    function = getattr(ended.data["dispatcher"], "py_func", None)  # a loop that Numba compiles has none
    name = f"{function.__module__}.{function.__qualname__}" if function else ""
    return name if name in functions else ""


def work() -> None:
    """Call parts, whose numbers come as bytes from standard input, until none is left."""
    gc.set_threshold(100_000)  # a compiler's objects stay
    with event.install_listener("numba:compile", _Teller()):
        while number := os.read(sys.stdin.fileno(), 1):
            PARTS[number[0]]()


def _plan() -> None:
    """Plans of the default planner for a team of three; for connectivity their radio has a range."""
    team = [replace(s, motion=make_planned_motion(Scenario()), radio_range=50.0) for s in make_flying_team()]
    load_planner(DEFAULT_PLANNER).plan(team, np.random.default_rng(0))


def _track() -> None:
    """Two scans of a known and an unknown person, and fusion of the tracks."""
    trackers = make_trackers(Scenario(), [Track(0, Gaussian(np.zeros(4), np.eye(4)))])
    for k in range(2):
        z = np.array([(0.5, 0.0), (6.0, 6.0)])
        step(trackers, [make_scan(t.uav, 0.2 * k, Pose.level(0.0, 0.0, 20.0), z) for t in trackers])


def _detect() -> None:
    """Detections in frames that are rendered for it."""
    for (staged,) in stage_frames().values():
        BlobDetector().detect(staged.frame)


def _move() -> None:
    """People who walk, UAVs that fly in wind."""
    scenario = Scenario(duration=0.2, trees=Trees(density=5.0), wind=Wind(gust=1.0))
    forest, people = make_forest_and_people(scenario, 0)
    with World(scenario, forest, people.positions.shape[1]) as world:
        world.advance(np.zeros((len(scenario.uavs), 2)), 2, np.zeros((2, 2)))


# The longest first, so that all processes end at about the same time.
PARTS = (_track, _plan, _detect, _move)
