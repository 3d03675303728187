"""A study says which trials there are, each once, and what is wrong with it in one line."""

import math
import re
import shlex
from collections import Counter
from itertools import product

import msgspec
import pytest

from planning.catalogue import DEFAULT_PLANNER
from planning.planner_loading import load_planner
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario
from sim.scenario.settings_text import flatten, format_value
from sim.study.cells import add_trackers, list_cells, list_choices, list_lone_keys, parse_factor
from sim.study.definition import STUDIES, Study, adapt_study, read_study
from sim.study.trials import list_trials
from tracking.errors import InputError
from tracking.geometry.person import TARGET_HEIGHT

FILE = """
[study]
name = "mine"
planners = ["sma-nbo", "mcr(samples=20)", "dec-pomdp"]
seeds = "3,0-1"

[set]
sensing.mode = "ideal"

[factors.lambda]
15 = { trees.density = 15 }
45 = { trees.density = 45 }

[factors.H]
1 = { planner.horizon = 1 }
3 = { planner.horizon = 3 }

[[exclude]]
planner = "dec-pomdp"
H = ["1"]
"""
WALK = adapt_study(read_study("paper-to-default"), seeds="0")
ORIGINAL = adapt_study(read_study("paper-original"), seeds="0")


@pytest.fixture
def written(tmp_path):
    def write(content):
        path = tmp_path / "mine.toml"
        path.write_text(content)
        return str(path)

    return write


def test_trials_are_the_product_of_levels_planners_and_seeds_less_what_is_excluded(written):
    found = list_trials(read_study(written(FILE)))
    assert len(found) == 3 * 2 * (3 + 2) == len({task.key for task in found})
    assert [task.seed for task in found[::10]] == [3, 0, 1]  # seed by seed
    shown = [(dict(task.factors)["lambda"], dict(task.factors)["H"], task.planner) for task in found[:10]]
    assert shown[:6] == [
        ("15", "1", "sma-nbo(horizon=1)"),
        ("15", "1", "mcr(samples=20, horizon=1)"),
        ("15", "3", "sma-nbo(horizon=3)"),
        ("15", "3", "mcr(samples=20, horizon=3)"),
        ("15", "3", "dec-pomdp(horizon=3)"),
        ("45", "1", "sma-nbo(horizon=1)"),
    ]
    assert found[5].settings == {"sensing.mode": "ideal", "trees.density": "45"}
    assert found[5].setting == load_scenario("forest", ["sensing.mode=ideal", "trees.density=45"])
    assert load_planner(found[1].planner).horizon == 1


def test_the_key_is_that_of_scenario_planner_seed_and_version_however_they_are_said(written):
    def key(content, **changes):
        return list_trials(adapt_study(read_study(written(content)), **changes))[0].key

    base = '[study]\nplanners = ["hover"]\nseeds = "1"\n'
    first = key(base)
    assert key(base + "[set]\nduration = 40") == first  # the default
    assert key(base + "[factors.x]\ny = { trees.density = 45.0 }") == first
    others = [key(base, seeds="2"), key(base, planners=["greedy"]), key(base, overrides=["duration=39"])]
    assert len({first, *others}) == 4


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("mcr(samples=10, horizon=3)", " mcr( horizon=3,samples=10 )"),
        ("sma-nbo(beta=0.5, search=1)", "sma-nbo(beta=0.5, search=1.0)"),
        ("sma-nbo", "sma-nbo(beta=0, optimizer='cross-entropy')"),
        ("greedy", "planning.baselines:Greedy"),
    ],
)
def test_spellings_of_one_planner_are_the_same_trials_and_none_is_flown_twice(one, other):
    first, second = (list_trials(Study("x", (text,), seeds="0"))[0] for text in (one, other))
    assert first.key == second.key and (first.planner, second.planner) == (one, other)
    with pytest.raises(InputError, match=re.escape(f"study: x: {one} and {other} are the same trials; each counts")):
        list_trials(Study("x", (one, other), seeds="0"))
    assert list_trials(Study("x", ("sma-nbo(beta=0.25)",), seeds="0"))[0].key != first.key


@pytest.mark.parametrize("key", ["people.trajectories", "trees.file"])
def test_a_changed_file_however_large_is_another_trial(tmp_path, key):
    path = tmp_path / "given.csv"
    study = Study(name="x", planners=("hover",), seeds="0", settings={key: f'"{path}"'})
    keys = set()
    for last in b"1122":
        with path.open("wb") as file:
            file.seek(2**26 + 1)
            file.write(bytes([last]))
        keys.add(list_trials(study)[0].key)
    assert len(keys) == 2


def test_the_paper_flies_its_own_setting_as_packaged_studies_say():
    counted = ("paper-horizon", "paper-planners", "paper-assumptions", "message-losses")
    sizes = {name: len(list_trials(read_study(name))) for name in counted}
    assert sizes["paper-horizon"] == 3 * 2 * 3 * 2 * 50 and sizes["paper-planners"] == (3 * 3 * 3 + 2 * 2) * 50
    assert sizes["paper-assumptions"] == 17 * 100 and sizes["message-losses"] == 11 * 2 * 8
    assert {"pixels-vs-ideal", "line-of-sight-vs-disc", "faults"} < set(STUDIES)
    for name in STUDIES:
        assert read_study(name).name == name and read_study(name).description
    paper = list_trials(adapt_study(read_study("paper-planners"), seeds="0"))
    assert {task.setting.trees.canopy_radius for task in paper} == {5.0}
    assert {task.setting.sensing.mode for task in paper} == {"camera"}
    dec = Counter((dict(t.factors)["lambda"], dict(t.factors)["H"]) for t in paper if t.planner.startswith("dec"))
    assert dec == {(x, h): 1 for x in ("15", "75") for h in ("3", "5")}
    found = list_cells(ORIGINAL)
    assert len(found) == 3 * 3 * 3 + 2 * 2  # Dec-POMDP where the paper has it
    for task in list_trials(ORIGINAL):
        s = task.setting
        assert (s.sensing.mode, s.sensing.occlusion, s.sensing.noise) == ("ideal", "disc", "range_bearing")
        assert (s.dynamics, s.first_decision, s.duration) == ("kinematic", 1.0, 40.0)
        assert (s.tracking.initial_tracks, s.tracking.sigma_a, s.tracking.motion) == ("none", 1.0, "ncv")
        assert (s.tracking.confirm, s.tracking.delete, s.tracking.management) == ((2, 3), (5, 5), "m_of_n")
        assert (s.network.fusion, s.network.rounds, s.network.links, s.network.loss) == ("kla", 5, (), 0.0)
        assert s.tracking.negative_information == 0.0 and s.tracking.reacquire_after > s.duration
        assert s.trees.canopy_radius == 5.0 and (s.area.width, s.area.height) == (150.0, 100.0)
        assert [(u.alpha, u.max_speed) for u in s.uavs] == [(0.1, 5), (0.15, 5), (0.12, 5)]
        edges = [2 * (u.altitude - TARGET_HEIGHT) * math.tan(math.radians(u.fov_deg / 2)) for u in s.uavs]
        assert edges == pytest.approx([20, 25, 22], abs=0.002)
        assert [u.start for u in s.uavs] == [u.start for u in Scenario().uavs]
        assert (s.rates.sensing, s.rates.planning, s.people.count) == (5, 1, 4)
        pieces = load_planner(task.planner)
        assert pieces.visibility == "nominal" and pieces.search == 0.0 and pieces.optimizer == "particle-swarm"
        assert (pieces.beta == 0.5) == task.planner.startswith("sma-nbo-mwtp")
        assert (pieces.actions == "first") == task.planner.startswith("mcr")
        assert pieces.horizon == int(dict(task.factors)["H"])


def test_scenario_files_are_found_from_the_study_file_and_shown_so_that_they_are_told_apart(tmp_path, written):
    for folder, density in ((".", 3), ("sparse", 4), ("dense", 9)):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "grove.toml").write_text(f"trees.density = {density}\n")

    def flown(*names, rule=""):
        head = f'[study]\nplanners = ["hover"]\nseeds = "0"\nscenarios = {list(names)}\n'
        return list_trials(read_study(written(head + rule)))

    one, other = flown("forest", "grove.toml")
    assert (one.factors, other.factors) == ((("scenario", "forest"),), (("scenario", "grove"),))
    assert other.scenario == str(tmp_path / "grove.toml") and other.setting.trees.density == 3
    names = ["sparse/grove.toml", "dense/grove.toml"]
    assert [dict(trial.factors)["scenario"] for trial in flown(*names)] == [str(tmp_path / name) for name in names]
    (left,) = flown("forest", "grove.toml", rule='[[exclude]]\nscenario = "grove.toml"')
    assert left.scenario == "forest"


def test_trackers_given_by_flag_take_the_place_of_those_that_a_study_leaves_out(written):
    levels = "[factors.tracker]\njpda = {}\nother = {tracking = {sigma_a = 0.5}}\n"
    rule = '[[exclude]]\nplanner = "hover"\ntracker = "other"'
    study = read_study(written(f"[study]\nplanners = ['hover', 'greedy']\nseeds = '0'\n{levels}{rule}"))
    assert [(cell.planner, dict(cell.factors)["tracker"]) for cell in list_cells(study)] == [
        ("hover", "jpda"),
        ("greedy", "jpda"),
        ("greedy", "other"),
    ]
    assert [cell.planner for cell in list_cells(add_trackers(study, ["jpda"]))] == ["hover", "greedy"]


def test_settings_as_text_reproduce_each_trial_of_the_packaged_studies():
    cuts = [{"links": [[0, 1]], "start": 3.5}]
    assert load_scenario("forest", [f"network.cuts={format_value(cuts)}"]).network.cuts[0].start == 3.5
    assert flatten({"a": {"b": {"c": 1}, "d": [1]}, "e": 2}) == {"a.b.c": 1, "a.d": [1], "e": 2}
    for name in STUDIES:
        for task in list_trials(adapt_study(read_study(name), seeds="0")):
            words = [word for key, value in task.settings.items() for word in ("--set", f"{key}={value}")]
            assert load_scenario(task.scenario, shlex.split(shlex.join(words))[1::2]) == task.setting


WRONG = {
    "[study]\nplaners = ['hover']": "study.planers: unknown key; .* did you mean planners",
    "[study]\nseeds = '0'": "mine.toml: study.planners: is missing, and has no default",
    "[study": "mine.toml: Expected",
    "[factors]\nx = [15, 45]": "mine.toml: factors.x: .15, 45. is not allowed; expected a table",
    "[study]\nplanners = []\n[exclude]\nplanner = 'a'": r"exclude: .* several is \[\[exclude\]\]",
    "[study]\nplanners = ['greedy']\n[factors.H]\n1.planner.horizon = 1": "factors.H.1: planner: 'greedy' has",
}
# What is wrong behind the head of a sound study.
HEAD = "[study]\nplanners = ['hover']\n"
WRONG_AFTER_HEAD = {
    "[factor.x]": "factor: unknown key; .* did you mean factors",
    "exclude = []": "study.exclude: is no key of .study. but a table",
    "[[exclude]]\nplanner = 'hover'": "no trial: all is excluded",
    "repeats = 0": "mine.toml: study.repeats: 0 is not allowed; expected `int` >= 1",
    "[factors.x]\ny.trees.density = -3": "mine.toml: factors.x.y: trees.density: -3",
    "[factors.p]\nx.planner = 'hover'": "p.x.planner: 'hover' is not allowed; expected {option",
    "[factors.planner]\nx = {}": "the name of a factor",
    "[factors.x]\na = {}\nb = {}": "x a, hover and x b, hover are the same trials",
    "[[exclude]]\nplanner = []": "mine.toml: exclude.0.planner: is empty; expected text, or a list of texts",
    "[factors.x]\nabc = {}\n[[exclude]]\nx = 'abd'": "'abd' is unknown; .* did you mean abc",
    "[factors.a]\nx = {trees.density = 1}\n[factors.b]\ny = {trees = {density = 7}}": "what factor 'a' sets",
    "[score]\nfloor = 'hover'\nbound = 'oracle'\n[factors.view]\na = {}": "factors.view: cannot be the name",
    "[factors.a]\nx = {area.width = 60}\n[factors.b]\nz = {uavs = [{start = [-50, 0]}]}": "mine.toml: factors.b.z: ",
    "seeds = '0-99999'\n[factors.x]\n"
    + "".join(f"l{j}.trees.density = {j}\n" for j in range(11)): "1100000 trials; at most",
    "[factors]\n"
    + "".join(f"f{i} = {{ {', '.join(f'l{j} = {{}}' for j in range(10))} }}\n" for i in range(30)): "cells; at most",
}
WRONG |= {HEAD + content: message for content, message in WRONG_AFTER_HEAD.items()}


@pytest.mark.parametrize(("content", "message"), WRONG.items())
def test_a_wrong_study_is_one_line(written, content, message):
    with pytest.raises(InputError, match=message) as raised:
        list_trials(read_study(written(content)))
    assert "\n" not in str(raised.value)


def test_errors_name_the_file_of_a_scenario_and_blame_no_study_for_flags(written, tmp_path):
    for key in ("trees.densty", "scenario", "planner"):
        (tmp_path / "grove.toml").write_text(f"{key} = 3\n")
        with pytest.raises(InputError, match=f"mine.toml: study.scenarios: .*grove.toml: {key}: unknown key"):
            list_trials(read_study(written("[study]\nplanners = ['hover']\nscenarios = ['grove.toml']")))
    with pytest.raises(InputError, match=r"^trees.densty: unknown key"):
        list_trials(adapt_study(read_study("faults"), overrides=["trees.densty=3"]))


def test_flags_replace_planners_and_seeds_and_set_what_no_factor_varies():
    with pytest.raises(InputError, match=r"sensing\.mode is what factor 'sensing' of study pixels-vs-ideal varies"):
        adapt_study(read_study("pixels-vs-ideal"), overrides=["sensing.mode=ideal"])
    with pytest.raises(InputError, match="network is what factor 'fault'"):
        adapt_study(read_study("faults"), overrides=["network={}"])
    with pytest.raises(InputError, match="key=value"):
        adapt_study(read_study("faults"), overrides=["network"])
    mine = Study("mine", ("hover",), factors={"navigation": {"good": {"uavs.0.navigation": "rtk"}}})
    for key in ("uavs.*.navigation", "uavs", "uavs.*"):
        with pytest.raises(InputError, match=r"^--set: uavs.* is what factor 'navigation' of study mine varies"):
            adapt_study(mine, overrides=[f"{key}=gnss"])
    assert adapt_study(mine, overrides=["uavs.*.alpha=1"]).given == {"uavs.*.alpha": "1"}
    many = adapt_study(read_study("how-many"), vary={"uavs.*.altitude": [40], "network.loss": [0.5], "fleet.size": [2]})
    assert {cell.factors for cell in list_cells(many)} == {
        (("fleet", "2"), ("altitude", "40"), ("network.loss", "0.5"))
    }
    with pytest.raises(InputError, match=r"^--vary: fleet is what factor 'fleet' of study how-many varies"):
        adapt_study(read_study("how-many"), vary={"fleet": [{"size": 2}]})
    study = adapt_study(read_study("faults"), planners=["hover", "hover"], seeds="7", overrides=["duration=1"])
    assert (study.planners, study.seeds, study.given) == (("hover",), "7", {"duration": "1"})
    assert {cell.settings["duration"] for cell in list_cells(study)} == {"1"}


def walked(density, trials):
    """The scenario and planner of each step."""
    found = [(dict(t.factors), t) for t in trials]
    return {f["step"]: (t.setting, load_planner(t.planner)) for f, t in found if f["lambda"] == density}


def differing(one, other):
    """Keys in which two scenarios differ."""
    a, b = (flatten(msgspec.to_builtins(setting)) for setting in (one, other))
    return {key for key in a if a[key] != b[key]}


def test_the_walk_begins_at_the_papers_setting_and_ends_at_the_default():
    """Of that it is SMA-NBO with MWTP and a horizon of five steps."""
    originals, trials = list_trials(ORIGINAL), list_trials(WALK)
    for density in ("15", "45", "75"):
        (first,) = [
            t
            for t in originals
            if t.planner.startswith("sma-nbo-mwtp") and dict(t.factors) == {"lambda": density, "H": "5"}
        ]
        setting, planner = walked(density, trials)["1-paper"]
        assert setting == first.setting and planner == load_planner(first.planner)
        setting, planner = walked(density, trials)["12-default"]
        assert differing(setting, Scenario()) <= {"trees.density"} and setting.trees.density == float(density)
        assert planner == load_planner(DEFAULT_PLANNER)


def test_levels_that_are_no_list_are_refused():
    with pytest.raises(
        InputError, match=r"vary: fleet.size: 3 is not allowed; expected several levels, such as \[1, 2\]"
    ):
        adapt_study(Study(name="x", planners=("hover",)), vary={"fleet.size": 3})


def varied(*factors, **changes):
    return adapt_study(
        Study(name="x", planners=("hover",), seeds="0"), vary=dict(map(parse_factor, factors)), **changes
    )


def test_settings_options_and_worlds_vary_by_flags():
    found = list_trials(varied("fleet.size=1-2", "uavs.*.altitude=30,40", "scenario=forest,dense"))
    flown = [(dict(t.factors), len(t.setting.uavs), {round(uav.altitude) for uav in t.setting.uavs}) for t in found]
    assert len(found) == 8 and [t.scenario for t in found] == ["forest"] * 4 + ["dense"] * 4
    for factors, size, altitudes in flown:
        assert (str(size), {factors["uavs.*.altitude"]}) == (factors["fleet.size"], set(map(str, altitudes)))
    options = adapt_study(
        Study(name="x", planners=("sma-nbo", "mcr(samples=9)"), seeds="0"),
        vary=dict([parse_factor("planner.horizon=1,3"), parse_factor("network.links=[],[[0, 1]]")]),
    )
    found = list_trials(options)
    assert [t.planner for t in found[::2]] == ["sma-nbo(horizon=1)"] * 2 + ["sma-nbo(horizon=3)"] * 2
    assert [t.setting.network.links for t in found[:4:2]] == [(), ((0, 1),)]
    packaged = adapt_study(read_study("faults"), seeds="0", vary={"fleet.size": [2, 3]})
    with pytest.raises(InputError, match="names UAV 2; allowed are 0 to 1"):
        list_trials(packaged)


@pytest.mark.parametrize(
    ("factors", "changes", "message"),
    [
        (["fleet.size"], {}, "--vary: 'fleet.size' is not of the form key=level,level"),
        (["=1,2"], {}, "is not of the form key=level,level"),
        (["fleet.size="], {}, "is not of the form key=level,level"),
        (["fleet.size=3-1"], {}, "--vary: '3-1' is not allowed"),
        (["planner=hover,greedy"], {}, "--vary: planner is no setting; name each with --planner"),
        (["network.loss=0,2"], {}, "network.loss: 2 is not allowed"),
        (["network.los=0,1"], {}, "network.los: unknown key; .* did you mean loss"),
        (["planner.horizn=1"], {}, "horizn"),
        (["scenario=forest,dence"], {}, "did you mean dense"),
        (
            ["network.loss=0,1"],
            {"overrides": ["network.loss=0.5"]},
            "--set: network.loss is what --vary network.loss varies",
        ),
        (
            ["uavs.0.altitude=20,30", "uavs.*.altitude=20,30"],
            {},
            r"uavs.\*.altitude is what factor 'uavs.0.altitude' sets",
        ),
        (["fleet.size=3,3.0"], {}, "fleet.size: 3.0 is not allowed|the same trials"),
    ],
)
def test_wrong_flags_of_factors_are_one_line(factors, changes, message):
    with pytest.raises(InputError, match=message) as raised:
        list_trials(varied(*factors, **changes))
    assert "\n" not in str(raised.value)


SIZE = "1.uavs = [{start = [-28, -14]}]\n2.uavs = [{start = [-28, -14]}, {start = [-28, 0]}]\n"
ALTITUDE = '15."uavs.*.altitude" = 15\n30."uavs.*.altitude" = 30\n'


@pytest.mark.parametrize("first", ["size", "altitude"])
def test_a_fleet_and_a_key_of_its_uavs_are_two_factors_in_either_order(written, first):
    tables = {"size": f"[factors.size]\n{SIZE}", "altitude": f"[factors.altitude]\n{ALTITUDE}"}
    order = [tables[first], *(table for name, table in tables.items() if name != first)]
    found = list_trials(read_study(written('[study]\nplanners = ["hover"]\nseeds = "0"\n' + "".join(order))))
    assert {(dict(t.factors)["size"], dict(t.factors)["altitude"]) for t in found} == {*product("12", ("15", "30"))}
    for task in found:
        assert [str(round(uav.altitude)) for uav in task.setting.uavs] == [dict(task.factors)["altitude"]] * len(
            task.setting.uavs
        )
        assert str(len(task.setting.uavs)) == dict(task.factors)["size"]
        assert load_scenario(task.scenario, [f"{k}={v}" for k, v in task.settings.items()]) == task.setting


def test_a_factor_of_uav_0_alone_is_told_and_what_is_chosen_is_told_from_what_is_met():
    alone = varied("uavs.0.altitude=20,30")
    assert list_lone_keys(alone) == [
        "factors.uavs.0.altitude: uavs.0.altitude is of UAV 0 alone; uavs.*.altitude is of all UAVs"
    ]
    assert list_lone_keys(varied("uavs.*.altitude=20,30")) == list_lone_keys(read_study("flights")) == []
    given = varied("network.loss=0,1", "trees.density=15,75", "uavs.*.navigation=rtk,gnss")
    assert list_choices(given) == []
    chosen = varied("planner.horizon=1,3", "uavs.*.altitude=20,30", "fleet.size=1-2", "network.fusion=kla,hcmci")
    assert list_choices(chosen) == list(chosen.factors)
    many = read_study("how-many")
    assert list_choices(many) == list(many.factors) == ["fleet", "altitude"] and len(list_cells(many)) == 24
