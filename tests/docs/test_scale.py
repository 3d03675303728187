"""docs/scale.py: its scenarios are as it says, and a point is timed."""

import math
import sys

import pytest
from helpers.pages import DOCS

from sim.mission.world_setup import make_forest_and_people

sys.path.append(str(DOCS))
import scale


@pytest.mark.parametrize("uavs", scale.FLEETS)
def test_fleets_grow_at_constant_density_and_start_apart_within_the_area(uavs):
    scenario = scale.make_scenario(uavs)
    hectares = scenario.area.width * scenario.area.height / 1e4
    assert hectares == pytest.approx(1.25 * uavs) and scenario.trees.expected_count(scenario.area) == 37.5 * uavs
    assert scenario.people.count == round(uavs / 0.3)
    starts = [uav.start for uav in scenario.uavs]
    gaps = [math.dist(a, b) for k, a in enumerate(starts) for b in starts[:k]]
    assert min(gaps) > 90 and max(abs(x) for start in starts for x in start) < scenario.area.width / 2


@pytest.mark.docs
def test_each_curve_has_its_points_and_all_forests_can_grow():
    points = list(scale.list_points())
    assert len(points) == len(scale.FLEETS) + 3 * len(scale.FACTORS)
    for point in points:
        forest, people = make_forest_and_people(point.scenario, 0)
        assert forest.trees and people.positions.shape[1] == point.scenario.people.count


def test_a_point_has_the_time_of_each_stage(monkeypatch):
    monkeypatch.setattr(scale, "SECONDS", 0.4)
    monkeypatch.setattr(scale, "REPEATS", 1)
    times = scale.time_mission(scale.make_scenario(2))
    assert list(times) == list(scale.STAGES) and all(0 <= time < 1e4 for time in times.values())
    figure = scale.draw({"UAVs": [(2, times), (3, times)]})
    assert [axes.get_xlabel() for axes in figure.axes] == ["UAVs"]
