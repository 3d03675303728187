"""Stem maps: files as inventories and spreadsheets have them, and missions among their trees."""

import math
import re

import msgspec
import numpy as np
import pytest

from sim.mission.recording import FIELDS
from sim.mission.world_setup import make_forest_and_people
from sim.scenario.environment import Trees
from sim.scenario.geo import Geo
from sim.scenario.loading import load_scenario
from sim.scenario.remarks import find_remarks
from sim.world.stem_map import describe_stem_map, read_stem_map
from tracking.errors import InputError
from tracking.geometry.visibility import Tree
from understory import run

INVENTORY = [  # x, y, crown radius, crown's base, height, diameter at breast height [cm], species
    ("-12.5", "4.25", "2.5", "4", "11.5", "24", "Fagus sylvatica"),
    ("3", "-7.75", "1.25", "", "9", "NA", "hêtre"),
    ("20.125", "0", "", "2.5", "", "31.5", ""),
]
NAMES = ("x", "y", "crown_radius", "crown_base", "height", "dbh", "species")
MISSING = Trees(canopy_radius=3.0, canopy_base=2.0, canopy_top=8.0, trunk_radius=0.15)
TREES = (
    Tree(-12.5, 4.25, 2.5, 4.0, 11.5, 0.12),
    Tree(3.0, -7.75, 1.25, 2.0, 9.0, 0.15),
    Tree(20.125, 0.0, 3.0, 2.5, 8.0, 0.1575),
)


def table(separator=",", decimal=".", rows=INVENTORY, names=NAMES):
    lines = [names, *([cell.replace(".", decimal) for cell in row] for row in rows)]
    return "".join(separator.join(line) + "\r\n" for line in lines)


@pytest.fixture
def stems(tmp_path):
    def write(text, encoding="utf-8"):
        path = tmp_path / "plot.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return path

    return write


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1", "cp1252"])
def test_files_of_any_spreadsheet_give_the_same_trees(stems, separator, decimal, encoding):
    found = read_stem_map(stems(table(separator, decimal), encoding), "trees.file", MISSING)
    assert found.trees == TREES and found.remarks == ("trees.file: not used: column species",)


def test_columns_may_be_separated_by_spaces_and_have_any_order_and_the_names_of_exports(stems):
    text = "height   y    x  trunk_radius\n11.5  4.25 -12.5 0.12 \n  9 -7.75   3 NA\n"
    found = read_stem_map(stems(text), "trees.file", MISSING).trees
    assert found == (Tree(-12.5, 4.25, 3.0, 2.0, 11.5, 0.12), Tree(3.0, -7.75, 3.0, 2.0, 9.0, 0.15))
    exported = "x,y,canopy_radius,canopy_base,canopy_top,trunk_radius\n1,2,5,3,6,0.2\n"
    assert read_stem_map(stems(exported), "trees.file", MISSING).trees == (Tree(1.0, 2.0),)
    assert read_stem_map(stems("x,y\n"), "trees.file", MISSING).trees == ()


def test_crowns_have_the_leaves_of_their_row_or_else_of_the_scenario(stems):
    text = "x,y,leaf_area_density\n0,0,0.75\n9,0,\n18,0,0\n"
    for given, missing in ((None, math.inf), (0.3, 0.3)):
        setting = Trees(file=str(stems(text)), leaf_area_density=given)
        found = read_stem_map(stems(text), "trees.file", setting)
        assert [tree.leaf_area_density for tree in found.trees] == [0.75, missing, 0.0] and not found.remarks
    with pytest.raises(InputError, match="line 2, column leaf_area_density: 6 m²/m³ is not allowed; expected 0 to 5"):
        read_stem_map(stems("x,y,leaf_area_density\n0,0,6\n"), "trees.file", Trees())


def test_projected_coordinates_are_those_from_the_origin(stems):
    for names in ("x;y", "Easting;Northing"):
        path = stems(f"{names}\n691234,5;5334567,25\n691250;5334560\n")
        found = read_stem_map(path, "trees.file", Trees(origin=(691240.0, 5334560.0))).trees
        assert [(tree.x, tree.y) for tree in found] == [(-5.5, 7.25), (10.0, 0.0)]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("x,y,height\n0,0,6\n1,1,-4\n", "line 3, column height: -4 m is not allowed; expected 0.01 to 200"),
        (
            "x,y\n1,1\n2,2\n1,1.001\n5,5\n2,2\n1,1\n",
            "stems stand at the same place: lines 2, 4, 7; lines 3, 6; "
            'trees.same_place = "merge" makes them stems of one tree',
        ),
        ("x,y\n11.5701,48.1401\n11.5709,48.1403\n11.5712,48.14\n", "within 0.0011 m; are x and y in degrees?"),
        (
            "x,y,height\n1,1,1150\n",
            "column height: 1150 m is not allowed; expected 0.01 to 200; a name such as height_cm",
        ),
        ('{"type": "FeatureCollection", "features": []}', "is GeoJSON; expected a table as CSV with the columns x,y"),
        ('[{"x": 1, "y": 2}]', "is JSON; expected a table as CSV with the columns x,y"),
        ("<kml>\n</kml>\n", "is XML or HTML; expected a table as CSV with the columns x,y"),
        ("x,y\n12,5,2\n", "line 2: has 3 entries, not 2 as line 1"),  # no row name, but a decimal comma
        ("x,y,crown_base\n1,1,7\n", "line 2, column crown_base: the crown begins at 7 m and ends at 6 m"),
        ("1.5,2\n3,4\n", "line 1: names no columns, but has numbers; columns are x,y"),
        ("x,y\n1,nan\n2,2\n,3\n", "line 2, column y: 'nan' is not a finite number; line 4, column x: is empty"),
    ],
)
def test_what_is_wrong_is_one_line_with_its_row(stems, text, complaint):
    path = stems(text)
    with pytest.raises(InputError, match=rf"^trees.file: {re.escape(str(path))}.*{re.escape(complaint)}") as error:
        read_stem_map(path, "trees.file", Trees())
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "settings", "complaint"),
    [
        (
            "x,y\n0,0\n691250,5334560\n",
            (),
            "line 3, column x: 691250 m from the centre is outside the area, -75 to 75 m; "
            "all stems fit into an area of 691250 x 5334560 m with trees.origin = [345625, 2667280]",
        ),
        (
            "x,y,height\n0,0,8\n9,9,24.5\n",
            (),
            "line 3, column height: the tallest crown reaches 24.5 m, and uavs.0 is at 17.3 m; "
            "above 25.5 m is allowed, for its fov_deg 60 a footprint above 29.4 m",
        ),
        (
            "x,y,trunk_radius\n9,9,0.2\n1,0.1,0.4\n",
            ("people.trajectories=walk.csv",),
            "line 3, column x: a trunk of 0.4 m radius stands where person 0 of people.trajectories walks at 0.62 s",
        ),
    ],
)
def test_trees_that_do_not_fit_are_named_by_their_row(stems, monkeypatch, tmp_path, text, settings, complaint):
    stems(text)
    (tmp_path / "walk.csv").write_text("time,id,x,y\n0,a,0,0\n10,a,10,0\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=re.escape(complaint)):
        make_forest_and_people(load_scenario("forest", ["trees.file=plot.csv", *settings]), 0)


def grid(column, sizes, scale=1.0, per_row=6):
    """Stems 8 m apart, with these entries of a column; `scale`: coordinates per metre."""
    places = ((8 * scale * (k % per_row), 8 * scale * (k // per_row)) for k in range(len(sizes)))
    return f"x,y,{column}\n" + "".join(f"{x},{y},{size}\n" for (x, y), size in zip(places, sizes, strict=True))


@pytest.mark.parametrize(
    ("text", "radius", "told"),
    [
        (
            grid("dbh", [120, 85, 640]),
            0.06,
            "dbh: is taken to be in mm, which its entries fit better than cm; else name it dbh_cm or dbh_m",
        ),
        (grid("DBH", [30, 25, 70, 410, 350, 44]), 0.015, "DBH: is taken to be in mm"),
        (grid("dbh", [18] * 40 + [260] * 20, per_row=10, scale=0.25), 0.009, "dbh: is taken to be in mm"),
        ("gx,gy,dbh\n0,0,31\n9,9,22\n", 0.0155, "dbh: is taken to be in mm"),
        (grid("dbh", [0.35, 0.2, 1.1]), 0.175, "dbh: is taken to be in m"),
        (grid("dbh", [24, 31.5, 2450]), 0.12, "trunk radii reach 12.2 m"),  # one entry
        (grid("dbh_mm", [31, 22]), 0.0155, ""),
        (grid("DBH (mm)", [120, 640]), 0.06, ""),
        (grid("dbh_m", [0.35]), 0.175, ""),
        (grid("Dbh [in]", [10]), 0.127, ""),
        (grid("dbh_cm", [120, 85, 640]), 0.6, "trunk radii are 0.6 m in the median, but forests have 0.005 to 0.5 m"),
        (grid("trunk_diameter_cm", [38]), 0.19, ""),
        (grid("trunk_radius", [0.0015]), 0.0015, "trunk radii are 0.0015 m in the median"),
    ],
)
def test_diameters_have_the_unit_of_their_name_or_one_that_a_forest_allows(stems, text, radius, told):
    found = read_stem_map(stems(text), "trees.file", Trees(), least=0.0)
    assert found.trees[0].trunk_radius == pytest.approx(radius)
    assert len(found.remarks) == bool(told) and told in "".join(found.remarks)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            grid("height", [82, 95, 70]),
            "heights are 82 m in the median, but forests have 1 to 60 m; names such as height_ft",
        ),
        (grid("dbh_cm", [18] * 40 + [260] * 20, 0.25, 10), "trunks have 5956 m² in a hectare"),
        (grid("dbh", [11, 13, 15, 27, 90, 290, 500]), "trunk radii reach 2.5 m, but no tree has more than 2 m"),
        (grid("crown_radius", [14, 13]), "crown radii are 13.5 m in the median"),
        (grid("height", [12] * 25, scale=100), "the next stem is 800 m away in the median; x_cm and y_cm give units"),
        (grid("height", [12] * 9, scale=0.0125), "within 0.5 m; are x and y in degrees?"),
    ],
)
def test_what_is_far_from_any_forest_is_doubted_in_one_line(stems, text, told):
    found = read_stem_map(stems(text), "trees.file", Trees())
    assert len(found.remarks) == 1 and told in found.remarks[0]


def test_names_of_columns_tell_diameters_and_units(stems):
    text = "X_km,y_ft,Crown Diameter,Height (ft),crown_base_cm,tag\n0.01,100,5,40,250,#1\n0.02,200,6,41,NA,#2\n"
    found = read_stem_map(stems(text), "trees.file", MISSING)
    assert found.trees == (
        Tree(10.0, pytest.approx(30.48), 2.5, 2.5, pytest.approx(12.192), 0.15),
        Tree(20.0, pytest.approx(60.96), 3.0, 2.0, pytest.approx(12.4968), 0.15),
    )
    assert found.remarks == ("trees.file: not used: column tag",)
    both = read_stem_map(stems("x,y,crown_radius,crown_diameter\n1,2,3,4\n"), "trees.file", Trees())
    assert both.trees[0].canopy_radius == 3 and both.remarks == ("trees.file: not used: column crown_diameter",)


def test_stems_at_one_place_may_be_one_tree(stems):
    text = "x,y,dbh,height,crown_radius\n1,1,30,9,2\n7,7,20,8,2\n1,1,40,12,1.5\n1,1.004,NA,4,2.5\n"
    found = read_stem_map(stems(text), "trees.file", Trees(same_place="merge", trunk_radius=0.01))
    assert len(found.trees) == 2 and found.trees[1].trunk_radius == 0.1 and "2 trees of 4 stems" in found.summary
    trunk = math.sqrt(0.15**2 + 0.2**2 + 0.01**2)
    assert found.trees[0] == Tree(1.0, 1.0, 2.5, 3.0, 12.0, pytest.approx(trunk))


@pytest.mark.parametrize(
    "text",
    [
        "# plot 7, 2019\nx,y\n1,2\n# the end, at last\n3,4\n",
        "#x,y\n1,2\n3,4\n",
        "\n# x y\n1 2\n3 4\n",
        '"x" "y"\n"1" 1 2\n"2" 3 4\n',
        'x,y\n"oak 1",1,2\n"oak 2",3,4\n',
        "\ufeff\ufeffx,y\n1,2\n3,4\n",
        "x,y\r1,2\r3,4\r",
        "sep=;\nx;y\n1;2\n3;4\n",
    ],
)
def test_comments_and_names_of_rows_are_read_over(stems, text):
    for encoding in ("utf-8", "utf-16"):
        found = read_stem_map(stems(text, encoding), "trees.file", Trees())
        assert [(tree.x, tree.y) for tree in found.trees] == [(1, 2), (3, 4)] and found.remarks == ()


def test_a_stem_map_without_trees_is_refused(stems):
    scenario = load_scenario("forest", [f"trees.file={stems('x,y,dbh')}"])
    for use in (lambda: make_forest_and_people(scenario, 0), lambda: describe_stem_map(scenario.trees, scenario.geo)):
        with pytest.raises(InputError, match=r"has no rows below the names of its columns; trees.density = 0"):
            use()


def test_a_path_beside_a_trunk_is_allowed(stems, tmp_path):
    stems("x,y,trunk_radius\n5,0.21,0.2\n5,-2,1.9\n")
    (tmp_path / "walk.csv").write_text("time,id,x,y\n0,a,0,0\n10,a,10,0\n", encoding="utf-8")
    settings = [f"trees.file={tmp_path / 'plot.csv'}", f"people.trajectories={tmp_path / 'walk.csv'}"]
    assert len(make_forest_and_people(load_scenario("forest", settings), 3)[0].trees) == 2


def test_a_stem_map_of_a_random_forest_gives_the_same_mission_and_is_not_needed_afterwards(tmp_path):
    settings = {"duration": 3, "trees.density": 60, "sensing.mode": "camera"}
    flown = run("forest", seed=5, settings=settings).recording
    rows = "".join(",".join(map(repr, row)) + "\n" for row in flown.trees.tolist())
    path = tmp_path / "plot.csv"
    path.write_text("x,y,crown_radius,crown_base,height,trunk_radius\n" + rows, encoding="utf-8")
    again = run("forest", seed=5, settings={"duration": 3, "sensing.mode": "camera", "trees.file": str(path)}).recording
    path.unlink()
    same = [name for name in FIELDS if np.array_equal(getattr(flown, name), getattr(again, name))]
    assert set(FIELDS) - set(same) <= {"scenario", "version"}
    assert again.forest.trees == flown.forest.trees and again.setting.trees.file == str(path)


def test_remarks_name_keys_without_effect(stems):
    path = stems("x,y\n0,0\n")
    scenario = load_scenario("forest", [f"trees.file={path}", "trees.density=10"])
    assert find_remarks(scenario) == ["trees.density: not used, as trees.file gives all trees"]
    assert msgspec.structs.replace(scenario.trees, file="").stem_map is None


def test_packaged_stands_are_read_without_remarks():
    for name, stems in {"park": 60, "plantation": 1575}.items():
        assert describe_stem_map(Trees(file=name), Geo()) == ("", [])
        assert len(make_forest_and_people(load_scenario(name), 0)[0].trees) == stems


def test_run_and_compare_say_once_which_columns_are_not_used(stems, tmp_path, call, compare):
    path = stems(table(";", ","))
    settings = ["--set", f"trees.file={path}", "--duration", "0.4", "--planner", "hover"]
    for ended in (call("run", *settings, "--no-video"), compare(*settings, "--seeds", "0-1")):
        assert ended[0] == 0 and ended[2].count("trees.file: not used: column species") == 1
    trunks = "trunk radii of 0.12 to 0.2 m, 0.158 m in the median (2 from dbh in cm, 1 not in the file)"
    assert (
        f"trees.file: {path}: 3 trees on 33 × 12 m; {trunks}; crown radii of" in call("run", *settings, "--no-video")[1]
    )


def test_another_origin_is_refused_for_stems_in_degrees(tmp_path):
    path = tmp_path / "stems.csv"
    path.write_text("lat,lon\n50.0,8.0\n50.0001,8.0001\n")
    with pytest.raises(InputError, match=r"line 2: trees\.origin is not allowed for places on the map; geo\.origin is"):
        read_stem_map(path, "trees.file", Trees(origin=(20.0, 0.0)), geo=Geo(origin=(50.0, 8.0)))
    found = read_stem_map(path, "trees.file", Trees(), geo=Geo(origin=(50.0, 8.0)))
    assert (found.trees[0].x, found.trees[0].y) == pytest.approx((0.0, 0.0), abs=1e-6)
