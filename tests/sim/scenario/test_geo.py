"""Places on the map against pyproj, and in the files of missions."""

import json
import re
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.mission.world_setup import find_scenario_remarks, make_forest_and_people
from sim.scenario.csv_tables import TableRow, read_csv
from sim.scenario.geo import Geo
from sim.scenario.loading import decode_recorded, load_scenario
from sim.scenario.scenario import encode_scenario
from sim.world.recorded_people import read_trajectories
from tracking.errors import InputError

PEOPLE = Path(__file__).parents[2] / "data" / "logs" / "people.gpx"
ORIGINS = [(48.1, 11.5), (-33.9, 151.2), (69.0, 25.0), (0.0, -179.995), (-77.8, 166.7)]


@pytest.mark.parametrize("origin", ORIGINS)
def test_a_thousand_places_within_two_kilometres_are_those_of_pyproj_to_a_millimetre(origin):
    pyproj = pytest.importorskip("pyproj")
    local = pyproj.CRS(f"+proj=aeqd +lat_0={origin[0]} +lon_0={origin[1]} +ellps=WGS84")
    places = np.random.default_rng(0).uniform(-2000, 2000, (1000, 2))
    longitudes, latitudes = pyproj.Transformer.from_crs(local, 4326, always_xy=True).transform(*places.T)
    geo = Geo(origin=origin)
    assert np.abs(geo.find_metres(latitudes, longitudes) - places).max() < 1e-3
    there = geo.find_degrees(places)
    off = pyproj.Geod(ellps="WGS84").inv(longitudes, latitudes, *there.T[::-1])[2]
    assert np.max(off) < 1e-3
    assert np.abs(geo.find_metres(*there.T) - places).max() < 2e-6


@pytest.mark.parametrize(("code", "origin"), [(25832, (48.1, 9.5)), (32756, (-33.9, 151.2)), (2180, (52.2, 21.0))])
def test_projected_coordinates_are_those_of_pyproj_and_become_true_metres(code, origin, tmp_path):
    pyproj = pytest.importorskip("pyproj")
    geo = Geo(origin=origin, epsg=code)
    x, y = pyproj.Transformer.from_crs(4326, code, always_xy=True).transform(*origin[::-1])
    places = np.random.default_rng(1).uniform(-1000, 1000, (1000, 2)) + np.array([x, y])
    rows = "\n".join(f"{a!r},{b!r}" for a, b in places.tolist())
    (tmp_path / "trees.csv").write_text(f"x,y\n{rows}\n")
    read = [
        (row.number("x"), row.number("y")) for row in read_csv(tmp_path / "trees.csv", "trees", ("x", "y"), geo=geo)
    ]
    longitudes, latitudes = pyproj.Transformer.from_crs(code, 4326, always_xy=True).transform(*places.T)
    bearing, _, distance = pyproj.Geod(ellps="WGS84").inv(*np.full((1000, 2), origin[::-1]).T, longitudes, latitudes)
    turn = np.radians(bearing)
    np.testing.assert_allclose(read, np.column_stack([np.sin(turn), np.cos(turn)]) * distance[:, None], atol=1e-3)


def test_an_unknown_code_and_a_second_origin_are_one_line(tmp_path):
    pytest.importorskip("pyproj")
    (tmp_path / "trees.csv").write_text("x,y\n1,2\n")
    with pytest.raises(InputError, match=r"geo\.epsg: 99999 is no code of coordinates"):
        list(read_csv(tmp_path / "trees.csv", "trees", ("x", "y"), geo=Geo(origin=(1, 2), epsg=99999)))
    with pytest.raises(InputError, match=r"trees\.origin: not allowed with geo\.epsg; geo\.origin gives the area"):
        load_scenario("forest", ["geo.epsg=25832", "trees.origin=[457100,5428300]"])


@given(st.datetimes(datetime(1971, 1, 1), datetime(2099, 1, 1)), st.integers(-14 * 4, 14 * 4), st.sampled_from("T "))
def test_times_of_iso_8601_are_seconds_since_1970_in_any_zone(time, quarters, mark):
    hours, minutes = divmod(abs(quarters) * 15, 60)
    zone = f"{'-' if quarters < 0 else '+'}{hours:02d}:{minutes:02d}"
    for written in (zone, zone.replace(":", ""), *(["Z", ""] if quarters == 0 else [])):
        row = TableRow("here", 1, {"time": time.isoformat(mark) + written}, {})
        expected = datetime.fromisoformat(time.isoformat() + zone).timestamp()
        assert row.time("time") == pytest.approx(expected, abs=1e-6) and row.lacks_zone("time") == (written == "")


@pytest.mark.parametrize("time", ["2024-13-01T00:00:00", "2024-05-01T25:00", "yesterday", ""])
def test_other_times_are_errors_that_name_the_column(time):
    with pytest.raises(InputError, match="here, column time: "):
        TableRow("here", 1, {"time": time}, {}).time("time")


def test_people_of_a_gpx_file_walk_where_it_says(tmp_path):
    scenario = load_scenario("forest", [f'people.trajectories="{PEOPLE}"', "people.start=1714557604", "duration=3"])
    assert scenario.geo.origin == (50.000065, -7.999985)  # the middle of the file
    _, people = make_forest_and_people(scenario, 0)
    k = np.arange(4)
    for m in range(2):
        expected = scenario.geo.find_metres(50 + 1e-5 * k + 1e-4 * m, -8 + 1e-5 * k)
        np.testing.assert_allclose([people.at(float(t))[0][m] for t in k], expected, atol=1e-3)
    told = find_scenario_remarks(scenario).files
    assert "geo.origin: places are metres to the east and north of 50.000065, -7.999985 (WGS 84)" in told
    assert decode_recorded(encode_scenario(scenario)).geo == scenario.geo


@pytest.mark.parametrize(
    ("start", "said"),
    [
        ("2024-05-01T12:00:04+02:00", ""),
        ("2024-05-01 10:00:04", ""),
        (
            "2024-05-01T12:00:04",
            "from people.start, 2024-05-01T12:00:04Z, for 3 s; rows are from 2024-05-01T10:00:04Z to ",
        ),
        ("0", "rows are from 2024-05-01T10:00:04Z to 2024-05-01T10:00:07Z; people.start = 2024-05-01T10:00:04Z begins"),
        ("10:00:04", "people.start: 10:00:04 is not allowed; expected seconds, or such as 2024-05-01T10:00:00Z"),
        ("2024-13-01T10:00:04", "people.start: '2024-13-01T10:00:04' is no time: month must be in 1..12"),
    ],
)
def test_the_start_may_be_a_time_of_day_and_another_zone_is_asked_for(start, said):
    def load():
        scenario = load_scenario("forest", [f'people.trajectories="{PEOPLE}"', f"people.start={start}", "duration=3"])
        return scenario, make_forest_and_people(scenario, 0)

    if said:
        with pytest.raises(InputError, match=re.escape(said)):
            load()
    else:
        assert load()[0].people.start == 1714557604


def test_the_first_file_on_the_map_gives_the_origin_for_all(tmp_path):
    stems = ["Latitude,Longitude,height", "50.0001,-8.0001,5", "49.9999,-7.9999,5"]
    (tmp_path / "stems.csv").write_text("\n".join(stems) + "\n")
    files = [f'trees.file="{tmp_path / "stems.csv"}"', f'people.trajectories="{PEOPLE}"', "people.start=1714557604"]
    scenario = load_scenario("forest", [*files, "duration=3"])
    assert scenario.geo.origin == (50.0, -8.0)
    forest, people = make_forest_and_people(scenario, 0)
    np.testing.assert_allclose(
        forest.table[:, :2], scenario.geo.find_metres(np.array([50.0001, 49.9999]), np.array([-8.0001, -7.9999]))
    )
    np.testing.assert_allclose(people.at(0.0)[0][0], [0, 0], atol=1e-6)
    assert "geo" not in json.loads(encode_scenario(load_scenario("forest")))


def test_places_far_from_the_origin_and_swapped_ones_are_one_line(tmp_path):
    (tmp_path / "people.csv").write_text("time,id,lat,lon\n0,a,50.1,-8\n1,a,50.1,-8\n")
    geo, area = Geo(origin=(50.0, -8.0)), load_scenario("forest").area
    with pytest.raises(InputError, match=r"line 2, column lat: 50\.1, -8 is 11\.1 km from geo\.origin, 50, -8; 9 km"):
        read_trajectories(tmp_path / "people.csv", area, duration=1.0, geo=geo)
    (tmp_path / "people.csv").write_text("time,id,lat,lon\n0,a,-8,50\n1,a,-8,50\n")
    with pytest.raises(InputError, match=r"are latitude and longitude swapped\?"):
        read_trajectories(tmp_path / "people.csv", area, duration=1.0, geo=geo)
