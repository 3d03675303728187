"""Recordings hold the whole scenario, in the form that it had in the first release, and later ones read it."""

import hashlib
import json
from pathlib import Path

import pytest

from sim.mission.archive import load_recording
from sim.scenario.loading import SCENARIOS, decode_recorded, load_scenario
from sim.scenario.scenario import encode_scenario
from tracking.errors import InputError

ROOT = Path(__file__).parents[3]
FIRST = {
    (): "972b99dd1949b64c76a5ba1df812d4c5533cc61acfcc9714ff1b156307c748cc",
    (
        "appearance=full",
        "uavs.1.navigation={yaw_bias_deg=3}",
    ): "d7323116f5e82fe28d449ebaae2d02eaa7e9c49ffba72ba5f47575d1ed5c1210",
}


@pytest.mark.parametrize("changes", FIRST)
def test_scenarios_are_written_as_by_the_first_release(changes):
    assert hashlib.sha256(encode_scenario(load_scenario("forest", changes)).encode()).hexdigest() == FIRST[changes]


@pytest.mark.parametrize("name", SCENARIOS)
def test_any_packaged_scenario_comes_back(name):
    assert decode_recorded(encode_scenario(load_scenario(name))) == load_scenario(name)


@pytest.mark.parametrize(
    "changes",
    [
        ["appearance=full", "appearance.noise=12", "uavs.1.camera=d435", "uavs.0.navigation=rtk"],
        ["uavs.0.navigation.yaw_bias_deg=2", "people.stay=5", "rates.planning=0.5", "uavs.0.altitude=30"],
    ],
)
def test_other_settings_come_back(changes):
    setting = load_scenario("forest", changes)
    assert decode_recorded(encode_scenario(setting)) == setting


def test_the_recording_of_the_docs_is_read():
    assert load_recording(ROOT / "docs" / "examples" / "grove" / "mission.npz").setting.people.count == 3


def test_a_removed_key_is_read_at_its_default_and_else_refused_in_one_line():
    data = json.loads(encode_scenario(load_scenario("forest", ["uavs.0.navigation.yaw_bias_deg=2"])))
    data["trees"] |= {"height": [8.0, 12.0], "crown_ratio": 0.5}
    assert decode_recorded(json.dumps(data)).trees.height == (8.0, 12.0)
    for table, key, value in (
        (data["people"], "levy_exponent", 1.5),
        (data["appearance"], "exposure", 0.2),
        (data["uavs"][0]["navigation"], "clock_offset", 0.1),
    ):
        before, table[key] = table[key], value
        with pytest.raises(InputError, match=rf"{key}: {value} was set in a release that had this key, which later"):
            decode_recorded(json.dumps(data))
        table[key] = before
    with pytest.raises(InputError, match=r"^people\.levy_exponent: unknown key; "):
        load_scenario("forest", ["people.levy_exponent=2"])
