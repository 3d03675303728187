"""Stem maps: files as inventories and spreadsheets have them, and missions among their trees."""

import math
import re

import msgspec
import numpy as np
import pytest

from sim.mission.recording import FIELDS
from sim.mission.world_setup import make_forest_and_people
from sim.scenario.environment import Trees
from sim.scenario.loading import load_scenario
from sim.scenario.remarks import find_remarks
from sim.world.stem_map import find_unused_columns, read_stem_map
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
    assert found.trees == TREES and found.unused == ("species",)


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
        assert [tree.leaf_area_density for tree in found.trees] == [0.75, missing, 0.0] and not found.unused
    with pytest.raises(InputError, match="line 2, column leaf_area_density: 6 m²/m³ is not allowed; expected 0 to 5"):
        read_stem_map(stems("x,y,leaf_area_density\n0,0,6\n"), "trees.file", Trees())


def test_projected_coordinates_are_those_from_the_origin(stems):
    path = stems("x;y\n691234,5;5334567,25\n691250;5334560\n")
    found = read_stem_map(path, "trees.file", Trees(origin=(691240.0, 5334560.0))).trees
    assert [(tree.x, tree.y) for tree in found] == [(-5.5, 7.25), (10.0, 0.0)]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("x,y,height\n0,0,6\n1,1,-4\n", "line 3, column height: -4 m is not allowed; expected 0.01 to 200"),
        ("x,y\n1,1\n2,2\n1,1.001\n", "line 4, column x: the stem of line 2 stands at the same place"),
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
        assert find_unused_columns(Trees(file=name)) == []
        assert len(make_forest_and_people(load_scenario(name), 0)[0].trees) == stems


def test_run_and_compare_say_once_which_columns_are_not_used(stems, tmp_path, call, compare):
    path = stems(table(";", ","))
    settings = ["--set", f"trees.file={path}", "--duration", "0.4", "--planner", "hover"]
    for ended in (call("run", *settings, "--no-video"), compare(*settings, "--seeds", "0-1")):
        assert ended[0] == 0 and ended[2].count("trees.file: not used: column species") == 1
