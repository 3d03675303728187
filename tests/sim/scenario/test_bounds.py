"""Every number of a scenario has bounds, the product of several too; what research flies lies far within them."""

import json
import re
from pathlib import Path

import msgspec
import pytest
from helpers.hostile_values import numbers
from helpers.pages import generator
from msgspec import inspect

from sim.scenario.environment import People
from sim.scenario.errors import InputError
from sim.scenario.loading import load
from sim.scenario.quantities import integer, integers, seconds
from sim.scenario.scenario import Scenario
from sim.scenario.workload import check_workload

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "scenarios.md").read_text(encoding="utf-8")
REFERENCE = generator().generated(PAGE)
# Checked against the area, the strongest wind, the number of UAVs and the scans that a tracker counts.
ELSEWHERE = {"uavs.0.start", "wind.velocity", "network.links", "network.cuts.links", "people.paths"}
ELSEWHERE |= {"tracking.confirm", "tracking.delete"}


def bounded():
    """Lower and upper bound of each number of a scenario as the reference writes them."""
    for name, kind in numbers(inspect.type_info(Scenario), ""):
        if name not in ELSEWHERE:
            low = (
                f"{kind.ge:g} to" if kind.ge is not None else f"above {kind.gt:g}, to" if kind.gt is not None else "to"
            )
            yield name, f"{low} {kind.le:g}" if kind.le is not None else f"{low} below {kind.lt:g}"


def test_every_number_of_a_scenario_has_two_bounds_and_the_reference_names_them():
    for name, kind in numbers(inspect.type_info(Scenario), ""):
        if name not in ELSEWHERE:
            assert {kind.ge, kind.gt} != {None} or name == "network.cuts.end", name
            assert {kind.le, kind.lt} != {None}, name
    assert dict(re.findall(r"^\| `([\w.]+)` \| [^|]*\| ([^|]*\d) \|", REFERENCE, flags=re.M)) == dict(bounded())


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("people.count=1000000000", ["people.count: 1000000000", "<= 10000"]),
        ("people.count=1e9", ["people.count: 1000000000.0", "expected int"]),
        ("area.width=1e9", ["area.width: 1000000000.0", "<= 20000"]),
        ("area.height=1e-320", ["area.height", ">= 1"]),
        ("network.rounds=1000000000", ["network.rounds: 1000000000", "<= 1000"]),
        ("rates.physics=1000000000", ["rates.physics: 1000000000", "<= 10000"]),
        ("duration=1e308", ["duration: 1e+308", "<= 86400"]),
        ("uavs.0.alpha=1e308", ["uavs.0.alpha: 1e+308", "<= 100"]),
        ("uavs.0.footprint=1e300", ["uavs.0.footprint: 1e+300", "<= 10000"]),
        ("uavs.0.fov_deg=1e-300", ["uavs.0.fov_deg", ">= 1"]),
        ("trees.canopy_radius=1e300", ["trees.canopy_radius: 1e+300", "<= 200"]),
        ("trees.canopy_radius=1e-300", ["trees.canopy_radius", ">= 0.01"]),
        ("tracking.sigma_a=1e300", ["tracking.sigma_a: 1e+300", "<= 100"]),
        ("network.cuts=[{links=[[0, 1]], end=1e308}]", ["network.cuts.0.end", "<= 86400"]),
        ("uavs.²=1", ["'²' is not an index", "0 to 2"]),
        ("x" + ".x" * 5000 + "=1", ["x", "unknown key"]),
    ],
)
def test_what_no_mission_means_is_refused(override, words):
    with pytest.raises(InputError) as caught:
        load("forest", [override])
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["duration=86400", "rates.sensing=10"], ["duration, rates.sensing and uavs", "2.592e+06 scans", "2e+06"]),
        (["duration=80000", "rates.physics=10000"], ["duration, rates.physics and uavs", "2.4e+09", "1e+09"]),
        (["duration=100", "people.count=5000"], ["duration and people.count", "500000 seconds of walking", "360000"]),
        (["people.count=9000", "rates.sensing=80"], ["uavs and people.count", "8.64e+07 looks", "1e+07"]),
        (["area.width=20000", "area.height=20000"], ["area and uavs", "1.2e+09 m²", "6e+08"]),
        (["uavs.0.pixels=4096", "duration=50000"], ["pixels", "4.2025e+12", "1e+12"]),
        (["network.rounds=1000", "duration=40000"], ["network.rounds", "1.8e+09 messages"]),
        (["people.paths=[[[-1e308, 0], [1e308, 0]]]"], ["people.paths", "inf m", "2e+07"]),
        (["uavs.0.footprint=9000", "uavs.0.fov_deg=1"], ["uavs.0: footprint 9000 m", "altitude", "10000 m"]),
    ],
)
def test_what_settings_come_to_together_is_bounded(overrides, words):
    with pytest.raises(InputError) as caught:
        load("forest", overrides)
    for word in words:
        assert word in str(caught.value)


def test_large_fleets_crowds_and_forests_lie_within_the_bounds():
    fleet = [{"start": [4.0 * i - 60, 10.0 * j - 20]} for i in range(6) for j in range(5)]
    area = ["area.width=1000", "area.height=1000", "trees.density=9000", "people.count=1000"]
    crowd = load("forest", [f"uavs={json.dumps(fleet).replace(':', ' =').replace(chr(34), '')}", *area])
    check_workload(crowd)
    assert len(crowd.uavs) == 30 and crowd.people.count == 1000 and crowd.duration == 40
    check_workload(msgspec.structs.replace(crowd, people=People(count=10), duration=3600.0))


@pytest.mark.parametrize(
    ("read", "text", "words"),
    [
        (lambda t: integer(t, "--seed", least=0, most=9), "9" * 5000, ["--seed", "0 to 9"]),
        (lambda t: integers(t, "--seeds"), "0-9999999999", ["--seeds", "'0-9999999999'", "at most 100000"]),
        (lambda t: integers(t, "--seeds"), "0-99999,100000", ["--seeds", "'100000'", "at most 100000"]),
        (lambda t: integers(t, "--seeds"), str(2**128), ["--seeds", f"none above {2**128 - 1}"]),
        (lambda t: integers(t, "--seeds"), "9" * 5000, ["--seeds", "none above"]),
        (lambda t: seconds(t, "--timeout"), "1e308", ["--timeout", "'1e308'", "at most 3.16224e+07 s"]),
        (lambda t: seconds(t, "--timeout"), "1e308h", ["--timeout", "'1e308h'", "at most 3.16224e+07 s"]),
    ],
)
def test_numbers_on_the_command_line_are_bounded(read, text, words):
    with pytest.raises(InputError) as caught:
        read(text)
    for word in words:
        assert word in str(caught.value)
    assert integers(f"0-99998,{2**128 - 1}", "--seeds")[-1] == 2**128 - 1
