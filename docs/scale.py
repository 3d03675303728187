"""Time of missions as they grow: `python docs/scale.py` draws docs/media/scale.png and prints the table of its page.

`python docs/scale.py film` flies fifty UAVs for 10 s, with film and page in runs/fifty.

Each point is a mission of 3 s of the default planner with rendered frames, flown in this process by one thread. Times
are processor times, without start-up. A fleet grows at constant density: 1.25 ha, 3.3 people and 37.5 trees for each
UAV, as in the default forest; the other curves change one thing about a fleet of six.
"""

from __future__ import annotations

import math
import time
from argparse import ArgumentParser
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import msgspec
from matplotlib.figure import Figure

from planning.planner_loading import load_planner
from sim.mission.mission import Mission
from sim.mission.trial import Trial
from sim.mission.warmup import warm_up
from sim.running.results import run_mission
from sim.scenario.environment import Area, People, Trees
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Network, Uav

PICTURE = Path(__file__).parent / "media" / "scale.png"
HECTARES, PEOPLE, TREES = 1.25, 10 / 3, 37.5  # for each UAV
SECONDS, REPEATS = 3.0, 3
STAGES = ("physics", "rendering", "detection", "tracking", "planning")
COLOURS = ("#999999", "#56b4e9", "#e69f00", "#009e73", "#d55e00")
FLEETS, SIX = (3, 6, 12, 30, 60), 6
FACTORS = (0.25, 1.0, 4.0, 16.0)


class Point(NamedTuple):
    """A mission, and what of it is varied."""

    curve: str
    size: float  # number, or area in ha
    scenario: Scenario


def make_scenario(uavs: int, people: float = 1.0, narrow_trees: float | None = None, area: float = 1.0) -> Scenario:
    """A fleet at the density of the default forest; people, trees and area are factors of those at this density.

    With narrow_trees, crowns have 2 m radius and may overlap.
    """
    side = 100.0 * math.sqrt(HECTARES * uavs * area)
    columns = math.ceil(math.sqrt(uavs))
    starts = [((k % columns + 0.5) / columns - 0.5, (k // columns + 0.5) / columns - 0.5) for k in range(uavs)]
    trees = Trees(density=TREES * uavs * area)
    if narrow_trees is not None:
        trees = Trees(density=TREES * uavs * narrow_trees, canopy_radius=2.0, overlap=True)
    return Scenario(
        duration=SECONDS,
        area=Area(side, side),
        trees=trees,
        people=People(count=round(PEOPLE * uavs * people), paths=()),
        uavs=tuple(Uav(start=(side * x, side * y)) for x, y in starts),
        network=Network(range=150.0),
    )


def list_points() -> Iterator[Point]:
    """All points of the curves."""
    for uavs in FLEETS:
        yield Point("UAVs, at constant density", uavs, make_scenario(uavs))
    for factor in FACTORS:
        yield Point("people", round(PEOPLE * SIX * factor), make_scenario(SIX, people=factor))
        yield Point("trees of 2 m radius", round(TREES * SIX * factor), make_scenario(SIX, narrow_trees=factor))
        yield Point("area [ha], with its trees", HECTARES * SIX * factor, make_scenario(SIX, area=factor))


def time_mission(scenario: Scenario) -> dict[str, float]:
    """Processor time [ms] of each stage, for a UAV and a second of the mission; the least of several flights."""
    least = dict.fromkeys(STAGES, math.inf)
    for _ in range(REPEATS):
        with mock.patch("sim.mission.stopwatch.time.perf_counter", time.process_time):
            mission = Mission(scenario, load_planner("sma-nbo-gospa"), 0)
            for _ in mission.fly():
                pass
            mission.close()
        spent = mission.clock.seconds
        least = {stage: min(least[stage], spent[stage]) for stage in STAGES}
    return {stage: 1e3 * least[stage] / (len(scenario.uavs) * scenario.duration) for stage in STAGES}


def draw(found: dict[str, list[tuple[float, dict[str, float]]]]) -> Figure:
    """One panel a curve: the stages' times on top of one another."""
    figure = Figure(figsize=(11.0, 3.2), layout="constrained")
    panels = figure.subplots(1, len(found), sharey=True, squeeze=False).ravel()
    for axes, (curve, rows) in zip(panels, found.items(), strict=True):
        sizes = [size for size, _ in rows]
        axes.stackplot(sizes, [[times[stage] for _, times in rows] for stage in STAGES], colors=COLOURS, labels=STAGES)
        axes.set(xscale="log", xlabel=curve, xticks=sizes, xticklabels=[f"{size:g}" for size in sizes])
        axes.minorticks_off()
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("ms for a UAV and a second")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False)
    return figure


def main() -> None:
    """Fly fifty UAVs with a film; or fly all missions, print the table and draw the curves."""
    parser = ArgumentParser(description=main.__doc__)
    parser.add_argument("what", nargs="?", choices=["curves", "film"], default="curves")
    if parser.parse_args().what == "film":
        scenario = msgspec.structs.replace(make_scenario(50), duration=10.0)
        run_mission(Trial(scenario, "sma-nbo-gospa", 0), Path("runs") / "fifty")
        return
    warm_up()
    found: dict[str, list[tuple[float, dict[str, float]]]] = {}
    print(f"| what grows | size | {' | '.join(STAGES)} | all | real-time factor |")
    print("|---" * (len(STAGES) + 4) + "|")
    for curve, size, scenario in list_points():
        times = time_mission(scenario)
        found.setdefault(curve, []).append((size, times))
        total = sum(times.values())
        cells = " | ".join(f"{times[stage]:.1f}" for stage in STAGES)
        print(f"| {curve} | {size:g} | {cells} | {total:.1f} | {1e3 / total / len(scenario.uavs):.2f} |", flush=True)
    draw(found).savefig(PICTURE, dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main()
