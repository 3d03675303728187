"""Starts drawn by the seed lie inside disc and area, apart from each other, and are recorded as they were flown."""

import math
from itertools import combinations

import numpy as np
import pytest

import understory
from sim.mission.world_setup import draw_starts
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario, encode_scenario
from tracking.errors import InputError

DISC = {"duration": 1, "sensing.mode": "ideal", "uavs.0.start_radius": 20, "uavs.2.start_radius": 5}


def starts(setting):
    return [uav.start for uav in setting.uavs]


def test_starts_fill_disc_and_area_and_keep_apart():
    """All three around one place near the corner, at one altitude."""
    radius = [f"uavs.{i}.start_radius=20" for i in range(3)]
    same = [f"uavs.{i}.start=[70, 45]" for i in range(3)] + [f"uavs.{i}.footprint=20" for i in range(3)]
    setting = load_scenario("forest", [*radius, *same])
    drawn = np.array([starts(draw_starts(setting, seed)) for seed in range(200)])
    assert np.all(np.hypot(*(drawn - (70.0, 45.0)).reshape(-1, 2).T) <= 20.0)
    assert np.all(np.abs(drawn) <= (75.0, 50.0)) and drawn[..., 0].max() > 74.0 and drawn[..., 0].min() < 52.0
    assert all(math.dist(a, b) >= 1.0 for row in drawn.tolist() for a, b in combinations(row, 2))


def test_the_seed_draws_the_starts_and_the_recording_has_them():
    flights = [understory.run("forest", "hover", seed=s, repeat=r, settings=DISC) for s, r in ((0, 0), (0, 1), (1, 0))]
    first, repeated, other = (starts(flight.scenario) for flight in flights)
    assert first == repeated != other and first[1] == other[1] == (-28.0, 0.0)
    for flight in flights:
        np.testing.assert_allclose(flight.recording.poses[0, :, :2], starts(flight.scenario), atol=1e-9)
    again = understory.run(flights[2].scenario, "hover", seed=1)
    np.testing.assert_array_equal(again.recording.ospa, flights[2].recording.ospa)


def test_a_disc_without_room_is_refused():
    tight = ["uavs.1.start_radius=0.5", "uavs.1.start=[-28, -14]", "uavs.1.footprint=20"]
    with pytest.raises(InputError, match=r"^uavs\.1\.start_radius: 0\.5 m leaves no room beside the other UAVs$"):
        draw_starts(load_scenario("forest", tight), 0)


def test_scenarios_without_drawn_starts_are_recorded_as_before():
    setting = Scenario()
    assert draw_starts(setting, 5) is setting and "start_radius" not in encode_scenario(setting)
