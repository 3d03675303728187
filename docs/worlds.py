"""Pictures of the worlds of bench-1 from above: `python docs/worlds.py` writes docs/media/worlds/NAME.png."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from sim.mission.world_setup import make_forest_and_people
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario
from sim.study.definition import read_study

FOLDER = Path(__file__).parent / "media" / "worlds"
INCH = 28.0  # m
GREEN, BLUE, ORANGE, INK = "#4a7c59", "#0072b2", "#d55e00", "#222222"


def picture(scenario: Scenario, seed: int = 0) -> Figure:
    """Trees, ways of people with a dot where each begins, and what the UAVs see at the start, of one map."""
    forest, people = make_forest_and_people(scenario, seed)
    width, height = scenario.area.width, scenario.area.height
    figure = Figure(figsize=(width / INCH, height / INCH))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(-width / 2, width / 2), ylim=(-height / 2, height / 2), aspect="equal")
    axes.axis("off")
    crowns = [Circle((tree.x, tree.y), tree.canopy_radius) for tree in forest.trees]
    axes.add_collection(PatchCollection(crowns, facecolor=GREEN, alpha=0.45, lw=0))
    for way in np.moveaxis(people.positions, 1, 0):
        there = way[~np.isnan(way[:, 0])]
        axes.plot(*there[::6].T, color=ORANGE, lw=1.2, alpha=0.9)
        axes.plot(*there[0], "o", color=ORANGE, ms=4)
    for uav in scenario.uavs:
        corner = (uav.start[0] - uav.footprint / 2, uav.start[1] - uav.footprint / 2)
        axes.add_patch(Rectangle(corner, uav.footprint, uav.footprint, fill=False, ec=BLUE, lw=1.3))
        axes.plot(*uav.start, "+", color=BLUE, ms=7, mew=1.5)
    axes.add_patch(Rectangle((-width / 2, -height / 2), width, height, fill=False, ec=INK, lw=1.0))
    axes.plot([-width / 2 + 4, -width / 2 + 24], [-height / 2 + 4] * 2, color=INK, lw=2)
    axes.text(-width / 2 + 14, -height / 2 + 5, "20 m", ha="center", va="bottom", fontsize=8, color=INK)
    return figure


def main() -> None:
    """Draw all worlds."""
    FOLDER.mkdir(exist_ok=True)
    for name in read_study("bench-1").scenarios:
        picture(load_scenario(name)).savefig(FOLDER / f"{name}.png", dpi=80, metadata={"Software": None})


if __name__ == "__main__":
    main()
