"""Two of footprint, angle of view and altitude give a UAV's view."""

import json
import math
import pickle

import msgspec
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sim.scenario.loading import change_settings, decode, decode_recorded, load_scenario
from sim.scenario.scenario import encode_scenario
from tracking.errors import InputError


def view(*keys, file=None, **given):
    """Altitude, footprint and angle of view of the UAV in a scenario of one, with overrides."""
    scenario = decode({"uavs": [{"start": [0.0, 0.0], **given}]}) if file is None else load_scenario(str(file), keys)
    return pytest.approx((scenario.uavs[0].altitude, scenario.uavs[0].footprint, scenario.uavs[0].fov_deg), rel=1e-12)


def triple(altitude=None, footprint=None, fov_deg=None):
    """The three, given two of them, by the tangent of half the angle."""
    if altitude is None:
        altitude = footprint / 2 / math.tan(math.radians(fov_deg / 2))
    if footprint is None:
        footprint = 2 * altitude * math.tan(math.radians(fov_deg / 2))
    if fov_deg is None:
        fov_deg = 2 * math.degrees(math.atan(footprint / 2 / altitude))
    return altitude, footprint, fov_deg


@settings(deadline=None)
@given(st.floats(8, 5000), st.floats(2, 120))
def test_any_two_give_the_third(altitude, fov_deg):
    whole = triple(altitude, fov_deg=fov_deg)
    names = ("altitude", "footprint", "fov_deg")
    assume(whole[1] <= 10_000)
    for left in names:
        assert view(**{name: value for name, value in zip(names, whole, strict=True) if name != left}) == whole


@pytest.mark.parametrize(
    ("given", "whole"),
    [
        ({}, triple(footprint=20, fov_deg=60)),
        ({"altitude": 30}, triple(30, fov_deg=60)),
        ({"altitude": 30, "footprint": 20}, triple(30, footprint=20)),
        ({"fov_deg": 40}, triple(footprint=20, fov_deg=40)),
    ],
)
def test_what_is_not_given_is_the_default_or_follows(given, whole):
    assert view(**given) == whole


OVERRIDES = [
    ([], triple(30, fov_deg=50)),
    (["altitude=40"], triple(40, fov_deg=50)),
    (["footprint=25"], triple(footprint=25, fov_deg=50)),
    (["fov_deg=70"], triple(footprint=triple(30, fov_deg=50)[1], fov_deg=70)),
    (["altitude=40", "footprint=25"], triple(40, footprint=25)),
    (["footprint=25", "fov_deg=70"], triple(footprint=25, fov_deg=70)),
]


@pytest.mark.parametrize(("keys", "whole"), OVERRIDES)
@pytest.mark.parametrize("left_out", range(3))
def test_overrides_mean_the_same_however_the_file_gives_the_view(tmp_path, keys, whole, left_out):
    names, keys = ("altitude", "footprint", "fov_deg"), [f"uavs.0.{key}" for key in keys]
    rows = [f"{name} = {value!r}\n" for name, value in zip(names, triple(30, fov_deg=50), strict=True)]
    path = tmp_path / "mine.toml"
    path.write_text("[[uavs]]\nstart = [0, 0]\n" + "".join(row for i, row in enumerate(rows) if i != left_out))
    assert view(*keys, file=path) == whole
    settings = {key: float(value) for key, _, value in (each.partition("=") for each in keys)}
    uav = change_settings(load_scenario(str(path)), settings).uavs[0]
    assert (uav.altitude, uav.footprint, uav.fov_deg) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize(
    "scenario", ["forest", "crowd"]
)  # the default fleet, and one that leaves the angle of view out
@pytest.mark.parametrize("key", ["altitude", "footprint", "fov_deg"])
def test_an_override_keeps_the_camera_or_its_footprint(scenario, key):
    before, uav = load_scenario(scenario).uavs[1], load_scenario(scenario, [f"uavs.1.{key}=30"]).uavs[1]
    assert getattr(uav, key) == pytest.approx(30, rel=1e-12)
    kept = "footprint" if key == "fov_deg" else "fov_deg"
    assert getattr(uav, kept) == getattr(before, kept)
    assert change_settings(load_scenario(scenario), {f"uavs.1.{key}": 30}) == load_scenario(
        scenario, [f"uavs.1.{key}=30"]
    )


def test_all_three_overrides_are_one_too_many():
    with pytest.raises(InputError, match=r"^uavs\.1: footprint, fov_deg and altitude are given; two of them determine"):
        load_scenario("forest", ["uavs.1.altitude=30", "uavs.1.fov_deg=50", "uavs.1.footprint=20"])
    with pytest.raises(InputError, match=r"^uavs\.1\.footprint: 'wide' is not allowed; expected `float"):
        load_scenario("forest", ["uavs.1.footprint=wide", "uavs.1.altitude=30"])


def test_a_fleet_keeps_its_views_in_recordings_and_copies():
    scenario = load_scenario("forest", ["uavs.0.altitude=30"])
    rows = json.loads(encode_scenario(scenario))["uavs"]
    assert all("altitude" not in row for row in rows) and rows[0]["footprint"] == scenario.uavs[0].footprint
    assert decode_recorded(encode_scenario(scenario)) == scenario == pickle.loads(pickle.dumps(scenario))
    assert msgspec.structs.replace(scenario.uavs[0], footprint=40.0).altitude == pytest.approx(triple(None, 40, 60)[0])


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {"altitude": 30, "footprint": 20, "fov_deg": 60},
            "uavs.0: footprint, fov_deg and altitude are given; two of them determine the third",
        ),
        (
            {"altitude": 30, "footprint": 0.2},
            "altitude 30 m with footprint 0.2 m means a fov_deg of 0.382; allowed are 1",
        ),
        ({"altitude": 5}, "uavs.0: footprint 5.7735 m means an altitude of 5.0 m, not 1 m above trees.canopy_top 6 m"),
        ({"altitude": 30, "fov_deg": 170, "tilt_deg": 20}, "tilt_deg 20 lets the camera look at the horizon"),
    ],
)
def test_views_that_cannot_be_are_refused(given, told):
    with pytest.raises(InputError) as error:
        view(**given)
    assert told in str(error.value)
