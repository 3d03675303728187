"""Compilation of the numerical kernels before the clock starts."""

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import cache

import numpy as np
from numba.core import event

from planning.catalogue import DEFAULT_PLANNER
from planning.planner_loading import load_planner
from sim.mission.compilation import compile_in_processes, is_mostly_uncompiled, name_compiled
from sim.mission.mission import Mission
from sim.mission.trial import Compilation, Say
from sim.processes.garbage import no_collection
from sim.scenario.environment import Trees, Wind
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from tracking.detection.blob_detector import BlobDetector
from tracking.filter.negative_information import negative_information_update
from tracking.geometry.visibility import SAMPLES, Forest, Tree
from tracking.numerics.compiled import find_uncompiled, functions, not_kept
from tracking.parameters import Tracking
from tracking.testing.stage import paint_frame

_BEFORE = "Compiling the numerical code, which takes a minute or two"
_FEW = Trees(density=5.0)
_LOST = "no folder for it can be written to, so it is compiled anew each time; NUMBA_CACHE_DIR may name one that can"


class _Watch(event.Listener):
    """Reports the start of the first compilation and each of our functions that is compiled, not those loaded."""

    def __init__(self, say: Say, progress: Callable[[Compilation], None]) -> None:
        self._say = say
        self._progress = progress
        self._depth = 0  # of compilations that call for others
        self._began = 0.0
        self.seconds = 0.0
        self._done: set[str] = set()
        self._total = 0

    def on_start(self, _: event.Event | None) -> None:
        if self._depth == 0:
            self._began = time.perf_counter()
            if self.seconds == 0.0:
                self._total = len(find_uncompiled())
                self._say(f"{_BEFORE}.")
        self._depth += 1

    def on_end(self, ended: event.Event | None) -> None:
        self._depth -= 1
        if ended:
            self.count(name_compiled(ended))
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._began

    def count(self, name: str) -> None:
        """Report our function of this name once, if functions were missing: code that cannot be kept has no number."""
        if self._total and name in functions and name not in self._done:
            self._done.add(name)
            self._progress(Compilation(len(self._done), max(self._total, len(self._done))))


@contextmanager
def announce_compilation(say: Say, progress: Callable[[Compilation], None] = lambda _: None) -> Iterator[None]:
    """Report compilation within the block: its start, each function that is done, and at the end how long it took."""
    watch = _Watch(say, progress)
    with event.install_listener("numba:compile", watch):
        if is_mostly_uncompiled():
            watch.on_start(None)
            compile_in_processes(watch.count)
            watch.on_end(None)
        yield
    if watch.seconds:
        say(f"Compiled in {watch.seconds:.0f} s; {_LOST if not_kept else 'it is kept for later runs'}.")


@cache
def warm_up(renders: bool | None = None) -> None:
    """Fly missions of 0.6 s, once per process, so that all kernels are loaded, or compiled and cached.

    renders: whether the missions to come render frames, if that is known: those that have code on disk then load no
    kernels of the other kind.
    """
    if compiles := is_mostly_uncompiled():  # a few, which few missions need, are compiled when called
        compile_in_processes()
    with nullcontext() if compiles else no_collection():  # a compiler leaves much garbage
        if compiles or not renders:
            _fly(Scenario(duration=0.6, trees=_FEW, sensing=Sensing(mode="ideal"), wind=Wind(gust=1.0)))
        if compiles or renders is not False:
            _fly(Scenario(duration=0.6, trees=_FEW, tracking=Tracking(initial_tracks="none")))
            beside = Forest((Tree(4.0, 0.0),))  # the person in the middle of the frame
            BlobDetector().detect(replace(paint_frame(), forest=beside))  # only images need it
        # Negative information does not occur within 0.6 s in every forest.
        negative_information_update(np.zeros((1, 4)), np.eye(4)[None], np.linspace(0.1, 1.0, len(SAMPLES))[None])
        gc.freeze()  # a compiler's objects stay; else each full collection goes through them all


def _fly(scenario: Scenario) -> None:
    for _ in Mission(scenario, load_planner(DEFAULT_PLANNER), 0).fly():
        pass
