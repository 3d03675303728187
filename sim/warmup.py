"""Compiles the numerical kernels before the clock starts."""

from __future__ import annotations

import time

from planning.registry import DEFAULT_PLANNER, load_planner
from sim.mission import Mission
from sim.scenario import Scenario, Sensing, Trees, Wind


def warm_up() -> float:
    """Fly a second in an open forest, so that all compiled code is loaded, or made and cached; wall time [s]."""
    start = time.perf_counter()
    scenario = Scenario(duration=1.0, trees=Trees(density=5.0), sensing=Sensing(mode="ideal"), wind=Wind(gust=1.0))
    for _ in Mission(scenario, load_planner(DEFAULT_PLANNER), 0).fly():
        pass
    return time.perf_counter() - start
