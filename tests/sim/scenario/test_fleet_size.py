"""A fleet of any size: the first of the UAVs that are listed, or all of them and copies beside them."""

import itertools

import pytest

from sim.scenario.loading import change_settings, load_scenario
from sim.scenario.scenario import Scenario, encode_scenario
from tracking.errors import InputError


def starts(size, *overrides, scenario="forest"):
    return [uav.start for uav in load_scenario(scenario, [f"fleet.size={size}", *overrides]).uavs]


def test_a_smaller_fleet_is_the_first_of_the_list_and_its_own_size_changes_no_recording():
    whole = Scenario()
    assert load_scenario("forest", ["fleet.size=2"]).uavs == whole.uavs[:2]
    assert encode_scenario(load_scenario("forest", ["fleet.size=3"])) == encode_scenario(whole)
    assert change_settings(whole, {"fleet.size": 1}).uavs == whole.uavs[:1]


@pytest.mark.parametrize("scenario", ["forest", "fleet"])
def test_copies_start_at_the_nearest_place_of_a_grid_that_is_ten_metres_from_all_others(scenario):
    area = load_scenario(scenario).area
    found = starts(24, scenario=scenario)
    listed = len(load_scenario(scenario).uavs)
    for k in range(listed, len(found)):
        x, y = found[k % listed]
        grid = itertools.product([x + 10 * i for i in range(-30, 31)], [y + 10 * i for i in range(-30, 31)])
        free = [
            ((u - x) ** 2 + (v - y) ** 2, u * u + v * v)
            for u, v in grid
            if abs(u) <= area.width / 2 and abs(v) <= area.height / 2
            if min((u - p) ** 2 + (v - q) ** 2 for p, q in found[:k]) >= 100
        ]
        u, v = found[k]
        assert ((u - x) ** 2 + (v - y) ** 2, u * u + v * v) == min(free)


def test_a_key_of_all_uavs_is_that_of_their_copies_whatever_comes_first():
    keys = ["fleet.size=5", "uavs.*.altitude=30", "uavs.1.max_speed=3"]
    for order in itertools.permutations(keys):
        fleet = load_scenario("forest", order).uavs
        assert [uav.altitude for uav in fleet] == pytest.approx([30.0] * 5)
        assert [uav.max_speed for uav in fleet] == [5.0, 3.0, 5.0, 5.0, 3.0]  # UAV 4 is a copy of UAV 1


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["fleet.size=0"], "fleet.size: 0 is not allowed"),
        (["fleet.size=201"], "fleet.size: 201 is not allowed"),
        (["fleet.sise=2"], "did you mean size"),
        (
            ["fleet.size=100", "area.width=80"],
            "fleet.size: the area has room for 72 UAVs that start 10 m apart, no more",
        ),
    ],
)
def test_a_size_that_cannot_be_is_one_line(overrides, message):
    with pytest.raises(InputError, match=message):
        load_scenario("forest", overrides)
