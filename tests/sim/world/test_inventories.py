"""Inventories: sizes from heights and diameters, trees of several stems, dead ones, and crowns as polygons."""

import json
import math
import re
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from sim.scenario.csv_tables import find_map_origin
from sim.scenario.environment import Trees
from sim.scenario.geo import Geo
from sim.world.crown_polygons import overlap_circle
from sim.world.forest import crown_radius
from sim.world.stem_map import read_stem_map
from tracking.errors import InputError
from tracking.geometry.visibility import Tree

DATA = Path(__file__).parents[2] / "data" / "inventories"
ORIGIN = (500_000.0, 5_400_000.0)


def read(path, **trees):
    return read_stem_map(path if isinstance(path, Path) else DATA / path, "trees.file", Trees(**trees))


def crown_of(height: float, dbh_cm: float) -> float:
    """[Jucker17] as it is printed: ln D = ln 0.557 + 0.809 ln(H CD) + 0.056² / 2, solved for half of CD."""
    return math.exp((math.log(dbh_cm / 0.557) - 0.056**2 / 2) / 0.809) / height / 2


def test_crowns_of_which_only_the_tree_is_known_are_those_of_random_forests():
    found = read("heights.csv", origin=ORIGIN)
    high, small, thin, low = found.trees
    assert high == Tree(10.5, 20.0, pytest.approx(crown_of(21.5, 32.0)), 10.75, 21.5, 0.16)
    assert small == Tree(18.0, 24.5, pytest.approx(crown_of(9.0, 11.5)), 4.5, 9.0, 0.0575)
    assert thin == Tree(24.5, 12.0, crown_radius(14.0), 7.0, 14.0, 0.2)  # as a random tree of 14 m
    assert low == Tree(30.0, 30.0, 5.0, 3.0, 6.0, 0.225)  # without a height, as the scenario has it
    assert "(3 from heights and diameters by allometry, 1 not in the file); heights" in found.summary
    assert found.summary.endswith("; 3 crowns in the upper half of the height")


def test_sizes_that_the_scenario_gives_come_before_allometry():
    for tree in read("heights.csv", origin=ORIGIN, canopy_radius=2.0, canopy_base=1.0).trees:
        assert tree.canopy_radius == 2.0 and tree.canopy_base == 1.0


def test_a_tree_lower_than_the_scenarios_crown_base_has_half_of_its_height(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x,y,height,crown_radius\n0,0,2.5,1\n9,9,12,1\n")
    assert [tree.canopy_base for tree in read(path).trees] == [1.25, 3.0]


def test_a_crown_base_of_the_file_stays(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x,y,h_m,hbase_m,dbh_cm\n0,0,24,9.5,35\n")
    assert read(path).trees == (Tree(0.0, 0.0, pytest.approx(crown_of(24.0, 35.0)), 9.5, 24.0, 0.175),)


def test_a_broken_tree_has_no_crown_wider_than_high(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x,y,height,dbh_cm\n0,0,2,60\n9,9,0.1,60\n")
    assert [tree.canopy_radius for tree in read(path).trees] == [2.0, 0.3]


ALIASES = {
    "easting,northing,crown_diameter,DBH_cm,tree_height": "1,2,4,20,9",
    "gx,gy,CROWN_RADIUS,dbh_mm,Tree.Height": "1,2,2,200,9",
    "X_coord,Y_coord,crown diameter (m),Diameter_cm,height_total": "1,2,4,20,9",
    "adjEasting,adjNorthing,maxCrownDiameter,stemDiameter_cm,height": "1,2,4,20,9",
    "UTM_X,UTM_Y,crown_width,BHD_cm,HT": "1,2,4,20,9",
}


@pytest.mark.parametrize("header", ALIASES)
def test_columns_have_the_names_that_foresters_give_them(tmp_path, header):
    path = tmp_path / "a.csv"
    path.write_text(f"{header}\n{ALIASES[header]}\n")
    found = read(path)
    assert found.trees == (Tree(1.0, 2.0, 2.0, 3.0, 9.0, 0.1),) and not found.remarks


def test_stems_of_a_named_tree_are_one_and_others_stay():
    found = read("forestgeo.csv")
    assert len(found.trees) == 5 and "5 trees of 6 stems" in found.summary
    assert found.trees[0].trunk_radius == pytest.approx(math.hypot(0.091, 0.0475))
    assert found.trees[1].trunk_radius == 0.205
    assert any("not used: columns stemID, tag, StemTag, sp, CensusID, hom" in text for text in found.remarks)


@pytest.mark.parametrize(
    ("status", "count", "told"),
    [
        ("any", 5, '2 dead and 1 fallen of 6 stems; all stay; trees.status = "standing" or "alive" leaves them out'),
        ("standing", 4, "2 dead and 1 fallen of 6 stems; 1 left out"),
        ("alive", 2, "2 dead and 1 fallen of 6 stems; 3 left out"),
    ],
)
def test_dead_and_fallen_trees_are_left_out_by_choice(status, count, told):
    found = read("forestgeo.csv", status=status)
    assert len(found.trees) == count and sum(told in text for text in found.remarks) == 1


def test_words_and_flags_tell_who_lives(tmp_path):
    names = {"any": 4, "standing": 3, "alive": 2}
    assert {s: len(read("neon.csv", status=s, origin=(731000.0, 4713000.0)).trees) for s in names} == names
    assert [len(read("stems.geojson", status=s).trees) for s in names] == [2, 2, 1]
    path = tmp_path / "a.csv"
    path.write_text("x,y,alive,fallen\n0,0,yes,no\n9,9,no,no\n20,9,no,yes\n30,9,,\n")
    assert [len(read(path, status=s).trees) for s in names] == [4, 3, 2]
    path.write_text("x,y,status\n0,0,A\n9,9,2\n")
    assert len(read(path).trees) == 2
    with pytest.raises(InputError, match="line 3, column status: '2' is unknown; expected words such as alive, dead"):
        read(path, status="alive")


def test_several_censuses_of_a_tree_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("tag,x,y,dbh_mm,CensusID\n1,0,0,50,1\n1,0,0,61,2\n2,9,9,80,1\n")
    with pytest.raises(InputError, match="lines 2, 3 are of one tree in several censuses; keep the rows of one"):
        read(path)


def test_stems_of_a_name_that_is_used_again_far_away_are_other_trees(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("tag,x,y\n1,0,0\n2,9,9\n1,50,0\n1,0.5,0.5\n")
    assert [(tree.x, tree.y) for tree in read(path).trees] == [(0.0, 0.0), (9.0, 9.0), (50.0, 0.0)]


def test_crowns_are_circles_of_equal_area_with_the_error_said():
    found = read("crowns.geojson", origin=ORIGIN)
    radii = [math.sqrt(area / math.pi) for area in (16.0, 32.0, 8.0)]
    for tree, place, radius in zip(found.trees, ((2, 2), (13, 13), (22, 2)), radii, strict=True):
        assert (tree.x, tree.y, tree.canopy_radius) == pytest.approx((*place, radius), abs=1e-6)
    assert [tree.canopy_top for tree in found.trees] == [18.0, 12.5, 6.0]
    assert [tree.canopy_base for tree in found.trees] == [9.0, 6.25, 3.0]
    assert "3 from polygons" in found.summary
    # A square and its circle: the square's corners beyond the circle, twice, over the area.
    share = 2 * (1 - overlap_share_of_square())
    shares = [int(text) for text in re.findall(r"(\d+) %", found.remarks[0])]
    assert found.remarks[0].startswith("trees.file: ") and "crowns are circles with the areas of" in found.remarks[0]
    assert 100 * share < shares[0] <= shares[1] and round(100 * share) == 18


def overlap_share_of_square() -> float:
    """Share of a square of edge 2 in the circle of its area about its middle: four triangles and four sectors."""
    radius = 2 / math.sqrt(math.pi)
    half = math.acos(1 / radius)  # of the arc beyond each edge
    return (4 * math.tan(half) + 4 * (math.pi / 2 - 2 * half) / 2 * radius**2) / 4


def test_the_area_that_a_polygon_shares_with_a_circle_is_that_of_counted_points():
    rng = np.random.default_rng(0)
    east, north = np.meshgrid(*[np.linspace(-4, 4, 1601)] * 2)
    assert overlap_circle(np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]), 2 / math.sqrt(math.pi)) == pytest.approx(
        4 * overlap_share_of_square(), rel=1e-12
    )
    for _ in range(12):
        angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
        ring = rng.uniform(-1, 1, 2) + rng.uniform(0.3, 3, (9, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
        radius = rng.uniform(0.2, 3)
        inside = np.zeros_like(east, dtype=bool)
        for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0), strict=True):  # even and odd crossings
            with np.errstate(divide="ignore", invalid="ignore"):
                inside ^= ((ay > north) != (by > north)) & (east < ax + (north - ay) * (bx - ax) / (by - ay))
        counted = np.sum(inside & (np.hypot(east, north) < radius)) * (8 / 1600) ** 2
        assert overlap_circle(ring, radius) == pytest.approx(counted, abs=0.02)
        assert overlap_circle(ring[::-1].copy(), radius) == pytest.approx(-counted, abs=0.02)


def test_points_have_the_sizes_of_their_properties():
    found = read("stems.geojson")
    assert found.trees[0] == Tree(4.5, -3.25, 3.0, 3.0, 20.0, 0.15)
    assert found.trees[1] == Tree(14.5, 6.75, pytest.approx(crown_of(11.0, 18.0)), 5.5, 11.0, 0.09)


def move_crowns(place, crs):
    """The text of `crowns.geojson` with places of another kind."""

    def walk(part):
        return [walk(inner) for inner in part] if isinstance(part[0], list) else place(*part)

    data = json.loads((DATA / "crowns.geojson").read_text())
    for feature in data["features"]:
        feature["geometry"]["coordinates"] = walk(feature["geometry"]["coordinates"])
    return json.dumps(data | {"crs": crs})


def test_crowns_on_the_map_stand_at_the_origin_of_all_files_with_the_sizes_of_those_in_metres(tmp_path):
    geo = Geo(origin=(48.75, 9.0))

    def place(x, y):
        return geo.find_degrees(np.array([[x - ORIGIN[0], y - ORIGIN[1]]]))[0, ::-1].tolist()

    expected = read("crowns.geojson", origin=ORIGIN).trees
    for crs in (None, {"properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}):
        (tmp_path / "a.geojson").write_text(move_crowns(place, crs))
        found = read_stem_map(tmp_path / "a.geojson", "trees.file", Trees(), geo=geo).trees
        np.testing.assert_allclose([astuple(t) for t in found], [astuple(t) for t in expected], atol=1e-5)
        middle = find_map_origin(tmp_path / "a.geojson", "trees.file", Geo())
        np.testing.assert_allclose(geo.find_metres(*np.array([middle]).T), [[12, 8]], atol=0.1)
    with pytest.raises(InputError, match=r"feature 1: trees\.origin is not allowed for places on the map"):
        read_stem_map(tmp_path / "a.geojson", "trees.file", Trees(origin=ORIGIN), geo=geo)
    with pytest.raises(InputError, match=r"feature 1: 48\.7.* is 27.* km from geo\.origin, 49, 9; 9 km are allowed"):
        read_stem_map(tmp_path / "a.geojson", "trees.file", Trees(), geo=Geo(origin=(49.0, 9.0)))


def test_projected_crowns_are_on_the_map_if_the_mission_is():
    pyproj = pytest.importorskip("pyproj")
    longitude, latitude = pyproj.Transformer.from_crs(25832, 4326, always_xy=True).transform(*ORIGIN)
    expected = read("crowns.geojson", origin=ORIGIN).trees
    for geo in (Geo(origin=(latitude, longitude)), Geo(origin=(latitude, longitude), epsg=25832)):
        found = read_stem_map(DATA / "crowns.geojson", "trees.file", Trees(), geo=geo).trees
        np.testing.assert_allclose(
            [astuple(t) for t in found], [astuple(t) for t in expected], atol=0.02
        )  # 0.04 % between metres on the ground and of the zone


@pytest.mark.parametrize(
    ("shape", "complaint"),
    [
        ({"type": "LineString", "coordinates": [[0, 0], [1, 1]]}, "feature 1: is a LineString; expected a Point, Pol"),
        ({"type": "Polygon", "coordinates": [[[0, 0], ["a", 1]]]}, "feature 1: is no point or polygon of numbers"),
        (None, "feature 1: is no point or polygon of numbers with properties"),
        (
            {"type": "Polygon", "coordinates": [[[11, 48], [31, 48], [11, 48]]]},
            "feature 1: a crown of 0 m²; 0.01 m² or",
        ),
        ({"type": "Point", "coordinates": [11, 48]}, "feature 1: is a place on the map; geo.origin = [latitude, long"),
    ],
)
def test_what_is_no_crown_is_one_line(tmp_path, shape, complaint):
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [{"geometry": shape, "properties": {}}]}))
    with pytest.raises(InputError, match=re.escape(complaint)) as error:
        read(path)
    assert "\n" not in str(error.value)
    path.write_text('{"type": "Topology"}')
    with pytest.raises(InputError, match="is no FeatureCollection of GeoJSON"):
        read(path)


def test_missing_names_are_no_tree(tmp_path):
    path = tmp_path / "stems.csv"
    path.write_text("tag,x,y\nNA,0,0\nNA,1.5,0\n7,20,0\n7,21,0\n,40,0\n-,41,0\n")
    assert len(read(path).trees) == 5
