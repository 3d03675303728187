"""Compiles the numerical kernels before the clock starts."""

from __future__ import annotations

import time

import numpy as np

from planning.registry import DEFAULT_PLANNER, load_planner
from sim.mission import Mission
from sim.scenario import Scenario, Sensing, Trees, Wind
from tracking.blob_detector import BlobDetector
from tracking.camera import Camera, Pose
from tracking.detector import Frame
from tracking.visibility import Forest, Tree


def warm_up() -> float:
    """Fly a second in an open forest, so that all compiled code is loaded, or made and cached; wall time [s]."""
    start = time.perf_counter()
    scenario = Scenario(duration=1.0, trees=Trees(density=5.0), sensing=Sensing(mode="ideal"), wind=Wind(gust=1.0))
    for _ in Mission(scenario, load_planner(DEFAULT_PLANNER), 0).fly():
        pass
    image = np.zeros((64, 64, 3), dtype=np.uint8)
    image[28:36, 28:36] = image[:4, :4] = (230, 62, 0)  # somebody in front of a tree, and somebody at the edge
    under = Forest((Tree(4.0, 0.0),))
    BlobDetector(under).detect(Frame(0, 0.0, Camera(1.0, 64), Pose.level(0.0, 0.0, 20.0), image))  # only images need it
    return time.perf_counter() - start
