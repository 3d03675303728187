"""Compiles the numerical kernels before the clock starts."""

from __future__ import annotations

import time

import numpy as np

from planning.registry import DEFAULT_PLANNER, load_planner
from sim.mission import Mission
from sim.scenario import Scenario, Sensing, Trees, Wind
from tracking.camera import Camera, Pose
from tracking.detector import Frame, whole_covariances


def warm_up() -> float:
    """Fly a second in an open forest, so that all compiled code is loaded, or made and cached; wall time [s]."""
    start = time.perf_counter()
    scenario = Scenario(duration=1.0, trees=Trees(density=5.0), sensing=Sensing(mode="ideal"), wind=Wind(gust=1.0))
    for _ in Mission(scenario, load_planner(DEFAULT_PLANNER), 0).fly():
        pass
    nadir = Frame(0, 0.0, Camera(1.0, 1), Pose.level(0.0, 0.0, 20.0), np.zeros((1, 1, 3), dtype=np.uint8))
    whole_covariances(nadir, np.zeros((1, 2)))  # which only images need
    return time.perf_counter() - start
