"""Scenario files are read strictly, and every number has bounds far beyond those of research."""

import gzip
import json
import math
import os
import re
from pathlib import Path

import msgspec
import pytest
from helpers.hostile_values import numbers
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from msgspec import inspect

from sim.cli.replay import _parse_speed
from sim.scenario.csv_tables import read_csv
from sim.scenario.environment import People
from sim.scenario.loading import SCENARIOS, load_scenario
from sim.scenario.quantities import parse_duration, parse_integer, parse_integers, parse_interval, parse_number
from sim.scenario.scenario import Rates, Scenario, ScenarioSettings, check_workload, encode_scenario
from sim.scenario.settings_text import list_changes
from sim.scenario.text_files import MOST_BYTES, parse_toml, read_bytes, read_text, read_toml
from sim.scenario.uavs import Uav
from sim.world.recorded_people import read_trajectories
from tracking.errors import InputError

REFERENCE = (Path(__file__).parents[3] / "docs" / "reference" / "scenarios.md").read_text(encoding="utf-8")
# Checked against the area, the strongest wind, the number of UAVs and the scans that a tracker counts.
ELSEWHERE = {"uavs.0.start", "wind.velocity", "network.links", "network.cuts.links", "people.paths"}
ELSEWHERE |= {"tracking.confirm", "tracking.delete", "trees.height", "trees.origin", "people.origin", "geo.origin"}
ELSEWHERE |= {f"uavs.0.camera.{of}{name}" for of in ("", "believed.") for name in ("focal", "centre", "distortion")}


def test_settings_other_than_the_defaults_make_the_scenario_again():
    assert list_changes(Scenario()) == list_changes(load_scenario("forest", ["uavs.0.alpha=0.1"])) == []
    mine = load_scenario(
        "forest", ["uavs.1.rate=1", "wind.gust=0.5", "people.walks=['a:B']", "uavs.1.fails_at=3", "trees.density=75"]
    )
    own = ["trees.density=75.0", 'people.walks=["a:B"]', "uavs.1.rate=1", "uavs.1.fails_at=3.0", "wind.gust=0.5"]
    assert list_changes(mine) == own
    for name in SCENARIOS:
        assert load_scenario("forest", list_changes(load_scenario(name))) == load_scenario(name)


def test_files_overrides_and_trajectories_are_read_where_they_are(tmp_path):
    empty = tmp_path / "empty.toml"
    empty.write_text("")
    assert load_scenario(str(empty)) == load_scenario("forest") == Scenario()
    assert all(load_scenario(name).duration > 0 for name in SCENARIOS)
    scenario = load_scenario("forest", ["trees.density=75", "uavs.1.alpha=0.3", "dynamics=kinematic", "people.count=2"])
    assert scenario.trees.density == 75 and scenario.dynamics == "kinematic" and scenario.people.count == 2
    assert [u.alpha for u in scenario.uavs] == [0.1, 0.3, 0.12]
    assert load_scenario("forest", ["tracking.confirm.0=1", "wind.velocity.1=2"]) == load_scenario(
        "forest", ["tracking.confirm=[1, 3]", "wind.velocity=[0, 2]"]
    )
    path = tmp_path / "mine.toml"
    path.write_text('[people]\ntrajectories = "walk.csv"\n')
    assert load_scenario(str(path)).people.trajectories == str(tmp_path / "walk.csv")


def test_a_star_is_a_key_of_all_uavs(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text("[[uavs]]\nstart = [0, 0]\nnavigation = 'rtk'\n[[uavs]]\nstart = [9, 9]\nfootprint = 30\n")
    settings = ["uavs.*.navigation=consumer", "uavs.*.fov_deg=80", "uavs.*.alpha=0.3", "uavs.1.alpha=0.2"]
    for name, count in (("forest", 3), (str(path), 2)):
        fleet = load_scenario(name, settings).uavs
        single = load_scenario(
            name, [one.replace("*", str(i)) for one in settings for i in range(count if "*" in one else 1)]
        )
        assert fleet == single.uavs and len(fleet) == count
        assert {(uav.navigation, uav.fov_deg) for uav in fleet} == {("consumer", 80.0)} and fleet[1].alpha == 0.2
    for key, index in (("uavs.7.alpha", "7"), ("uavs.*", "*")):
        allowed = "allowed are 0 to 2, or * for all, as in uavs.*.altitude"
        with pytest.raises(InputError, match=re.escape(f"{key}: '{index}' is not an index; {allowed}")):
            load_scenario("forest", [f"{key}=1"])
    assert load_scenario("forest", ["uavs=[{start = [1, 2]}]", "uavs.*.mount=body"]).uavs[0].mount == "body"


def test_a_trajectory_file_that_links_to_itself_is_refused_where_it_is_read(tmp_path):
    (tmp_path / "walk.csv").symlink_to("walk.csv")
    scenario = load_scenario("forest", [f'people.trajectories="{tmp_path / "walk.csv"}"'])
    with pytest.raises(InputError, match="symbolic links"):
        read_trajectories(Path(scenario.people.trajectories), scenario.area, duration=1.0)


@pytest.mark.parametrize(("key", "value"), [("rates.planning", "1"), ("rates.planning", "5"), ("uavs.1.rate", "1")])
def test_a_whole_rate_has_the_bytes_of_an_integer_however_it_is_written(key, value):
    texts = {
        encode_scenario(load_scenario("forest", [f"{key}={written}"]))
        for written in (value, f"{value}.0", f"{value}e0")
    }
    assert len(texts) == 1 and re.search(f'"{key.rpartition(".")[2]}":{value}[,}}]', texts.pop())


@settings(deadline=None)
@given(st.integers(1, 1000), st.integers(1, 1000))
def test_any_whole_number_of_scans_can_be_the_period_of_plans_and_frames(scans, sensing):
    planning = float(f"{sensing / scans:.12g}")  # as messages write it
    assume(planning >= 0.01)
    scenario = Scenario(
        first_decision=scans / sensing,
        duration=scans / sensing,
        uavs=(Uav(start=(0.0, 0.0), rate=planning),),
        dynamics="kinematic",
        rates=Rates(physics=sensing, sensing=sensing, planning=planning),
    )
    assert (scenario.rates.plan_scans, scenario.rates.plan_step) == (scans, scans / sensing)
    for k in range(0, 3 * scans + 2, max(1, scans // 3)):
        assert scenario.has_frame(0, k) == (k % scans == 0) and scenario.decides(k) == (k % scans == 0 and k > 0)


def bounded():
    """Lower and upper bound of each number of a scenario as the reference writes them."""
    for name, kind in numbers(inspect.type_info(ScenarioSettings), ""):
        if name not in ELSEWHERE:
            low = (
                f"{kind.ge:g} to" if kind.ge is not None else f"above {kind.gt:g}, to" if kind.gt is not None else "to"
            )
            yield name, f"{low} {kind.le:g}" if kind.le is not None else f"{low} below {kind.lt:g}"


def test_bounds_are_named_in_the_reference_and_hold_large_fleets():
    for name, kind in numbers(inspect.type_info(ScenarioSettings), ""):
        if name not in ELSEWHERE:
            assert {kind.ge, kind.gt} != {None} or name == "network.cuts.end", name
            assert {kind.le, kind.lt} != {None}, name
    assert dict(re.findall(r"^\| `([\w.]+)` \| [^|]*\| ([^|]*\d) \|", REFERENCE, flags=re.M)) == dict(bounded())
    fleet = [{"start": [4.0 * i - 60, 10.0 * j - 20]} for i in range(6) for j in range(5)]
    area = ["area.width=1000", "area.height=1000", "trees.density=9000", "people.count=1000"]
    crowd = load_scenario("forest", [f"uavs={json.dumps(fleet).replace(':', ' =').replace(chr(34), '')}", *area])
    check_workload(crowd)
    assert len(crowd.uavs) == 30 and crowd.people.count == 1000 and crowd.duration == 40
    check_workload(msgspec.structs.replace(crowd, people=People(count=10), duration=3600.0))


@pytest.mark.parametrize(
    ("read", "text", "words"),
    [
        (lambda t: parse_integer(t, "--seed", least=0, most=9), "9" * 5000, ["--seed", "0 to 9"]),
        (lambda t: parse_integers(t, "--seeds"), "0-9999999999", ["--seeds", "'0-9999999999'", "at most 100000"]),
        (lambda t: parse_duration(t, "--timeout"), "1e308", ["--timeout", "'1e308'", "at most 31622400 s"]),
    ],
)
def test_numbers_on_the_command_line_are_bounded(read, text, words):
    with pytest.raises(InputError) as caught:
        read(text)
    for word in words:
        assert word in str(caught.value)
    assert parse_integers(f"0-99998,{2**128 - 1}", "--seeds")[-1] == 2**128 - 1


# Python reads these as numbers; people take them for something else.
LIKE_NUMBERS = ["1_0", "\uff14\uff10", "\u0664\u0660", "1\u00b2", "1e1_0", "0x1p4", "1,5", "infinity", "nan"]


@pytest.mark.parametrize("written", LIKE_NUMBERS)
@pytest.mark.parametrize(
    "read",
    [
        lambda t, _: parse_duration(t, "--duration"),
        lambda t, _: parse_interval(f"{t}:99", "--time"),
        lambda t, _: parse_interval(f"0:{t}", "--time"),
        lambda t, _: parse_integer(t, "--seed", least=0, most=99),
        lambda t, _: parse_integers(t, "--seeds") if "," not in t else parse_integers("1.5", "--seeds"),
        lambda t, _: _parse_speed(t),
        lambda t, path: next(in_table(path, t)).number("x"),
        lambda t, path: next(in_table(path, t)).integer("x"),
    ],
    ids=["duration", "start", "end", "seed", "seeds", "speed", "number of a table", "integer of a table"],
)
def test_numbers_have_ascii_digits_and_no_underscores(tmp_path, read, written):
    with pytest.raises(InputError):
        read(written, tmp_path / "table.csv")


def in_table(path, entry):
    path.write_text(f'x,y\n"{entry}",0\n', encoding="utf-8")
    return read_csv(path, "field", ["x", "y"])


@pytest.mark.parametrize("written", ["7", "+7", "-0.5", ".5", "5.", "1e3", "1.5E-3", "00.25", "0.1", "1e-320"])
def test_a_number_is_the_one_that_its_text_means(written):
    assert parse_number(written) == float(written)
    assert math.isnan(parse_number(f" {written}")) and math.isnan(parse_number(f"{written} "))


NO_TEXT = "is no text in UTF-8, UTF-16 with a mark, or Windows-1252"


def sparse(path):
    with path.open("wb") as file:
        file.truncate(MOST_BYTES + 1)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (os.mkfifo, "is not a file"),
        (lambda path: path.mkdir(), "is not a file"),
        (lambda path: path.symlink_to("/dev/zero"), "is not a file"),
        (lambda path: path.symlink_to(path.name), "symbolic links"),
        (lambda path: None, "No such file"),
        (sparse, f"more than the {MOST_BYTES} bytes that are allowed"),
        (lambda path: path.write_bytes(b"\x90x,y"), NO_TEXT),
        (lambda path: path.write_bytes("x,y".encode("utf-16-le")), NO_TEXT),
        (lambda path: path.write_bytes(b"\xff\xfex"), NO_TEXT),
        (lambda path: path.write_bytes("x,y".encode("utf-32")), NO_TEXT),
        (lambda path: path.write_bytes(gzip.compress(b"x,y")), NO_TEXT),
    ],
    ids=[
        *("pipe", "folder", "zeros", "loop", "nothing", "too large", "no text"),
        *("UTF-16 without a mark", "half of UTF-16", "UTF-32", "compressed"),
    ],
)
def test_what_is_no_plain_text_is_refused(tmp_path, make, reason):
    path = tmp_path / "given"
    make(path)
    with pytest.raises(InputError, match=rf"^field: .*given cannot be read: .*{reason}"):
        read_text(path, "field")


def test_the_largest_files_and_deepest_nests_are_read_and_long_integers_refused(tmp_path):
    path = tmp_path / "given.toml"
    path.write_bytes(b"\xef\xbb\xbfx = 1")
    assert read_bytes(path, "field", 8) == b"\xef\xbb\xbfx = 1" and read_toml(path, "field") == {"x": 1}
    with pytest.raises(InputError, match="more than the 7 bytes"):
        read_bytes(path, "field", 7)
    assert parse_toml(f"x = {'[' * 29}{']' * 29}", "field")["x"]
    with pytest.raises(InputError, match=r"^field: "):
        parse_toml(f"x = {'9' * 5000}", "field")


@pytest.mark.parametrize(
    "written",
    [
        f"x = {'[' * 5000}{']' * 5000}",
        f"x = {'{a=' * 5000}1{'}' * 5000}",
        f"{'a.' * 300_000}a = 1",
        f"x = {'[' * 31}{']' * 31}",
        r'x = {y = """a\"""""", ' + "'b'." * 300_000 + "a = 1}",
    ],
    ids=["lists", "tables", "key", "a few too many", "key behind a string"],
)
def test_nests_are_refused_at_once(written):
    with pytest.raises(InputError, match=r"^field: is nested too deep; at most 30 levels are allowed$"):
        parse_toml(written, "field")


@pytest.mark.parametrize("piece", ['"""\n', '\\"""\n', "'''\n'", "'", '"', "\\", '",', "#"])
def test_strings_without_an_end_take_no_time_that_grows_with_their_square(piece):
    with pytest.raises(InputError, match=r"^field: "):
        parse_toml("x = " + "." * 101 + piece * 500_000, "field")
