"""Frames for checks of detectors: people in the open and trees beside them, rendered from several cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from sim.scenario.fleet import Uav
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import camera_pose
from sim.sensing.renderer import Rendered, Renderer
from sim.world.world import World
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array

FOREST = Forest((Tree(-9.0, 8.0), Tree(9.0, 9.0), Tree(10.0, -2.0)))
PEOPLE = np.array([(0.0, 0.0), (5.0, 4.0), (-7.0, 2.0), (4.0, -8.0), (-5.0, -7.0), (0.5, 9.0)])
_ELSEWHERE = np.array([60.0, 40.0])  # m, which no camera here sees
_UAV = Uav(start=(74.0, 49.0))
_ALTITUDE = 25.0  # m


@dataclass(frozen=True, eq=False)
class View:
    """A frame, what the renderer showed in it, and the places of the people (M, 2) m."""

    frame: Frame
    rendered: Rendered
    people: Array


@cache
def views() -> dict[str, View]:
    """Views by name; the first is the ordinary one."""
    tilted = Uav(start=(0.0, 0.0), tilt_deg=30.0)
    low, level = Pose.level(0.0, 0.0, 15.0), Pose.level(0.0, 0.0, _ALTITUDE)
    wanted = {
        "ordinary": (128, level, PEOPLE),
        "turned and moved": (128, Pose.level(2.0, -1.0, _ALTITUDE), PEOPLE),
        "low UAV": (128, low, PEOPLE),
        "tilted camera": (128, camera_pose(tilted, Pose.level(-12.0, 0.0, _ALTITUDE)), PEOPLE),
        "finer image": (256, level, PEOPLE),
        "no person in view": (128, level, PEOPLE + _ELSEWHERE),
    }
    with World(Scenario(uavs=(_UAV,)), FOREST, len(PEOPLE)) as world:
        renderer = Renderer(world)
        return {name: _view(world, renderer, *given) for name, given in wanted.items()}


def _view(world: World, renderer: Renderer, pixels: int, pose: Pose, people: Array) -> View:
    world.place_people(people, np.linspace(0.0, 5.0, len(people)))
    camera = Camera(math.radians(60), pixels)
    rendered = renderer.render(camera, pose)
    return View(Frame(0, 0.0, camera, pose, rendered.image), rendered, people)
