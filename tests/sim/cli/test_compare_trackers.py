"""`understory compare --tracker`: trackers are compared as planners are, by planner and map."""

import pytest
from helpers.trials import row

from sim.study.analysis.groups import group_rows
from sim.study.analysis.labels import find_baseline, parse_labels, shorten_labels
from sim.study.cells import add_trackers, list_cells
from sim.study.definition import Study
from tracking.errors import InputError

MINE = "mine:Mine"
FLAGS = ["--duration", "1", "--set", "sensing.mode=ideal", "--seeds", "0,1", "--metric", "ospa.mean_m"]
SAME = "from tracking.tracker import Tracker\n\n\nclass Same(Tracker):\n    pass\n"


def rows(planners=("greedy",), trackers=("jpda", MINE), levels=(("L", "3"), ("L", "5"))):
    """Two maps of each planner, tracker and level; OSPA is 1 m for the first tracker, less for the second."""
    return [
        row(p, seed, (level, ("tracker", t)), {"ospa.mean_m": 1.0 - 0.25 * (seed + 1) * (t == MINE)})
        for p in planners
        for level in levels
        for t in trackers
        for seed in (0, 1)
    ]


def test_labels_of_planners_and_trackers_say_what_differs():
    every = rows(("greedy", "sma-nbo(horizon=3)"))
    labels = {g.planner for g in group_rows(every)}
    assert labels == {f"{p}tracker={t})" for p in ("greedy(", "sma-nbo(horizon=3, ") for t in ("jpda", MINE)}
    assert shorten_labels(sorted(labels))["sma-nbo(horizon=3, tracker=mine:Mine)"] == "sma-nbo(tracker=Mine)"
    one, other = "greedy(tracker=jpda)", "greedy(tracker=mine:Mine)"
    assert shorten_labels([one, other]) == {one: "jpda", other: "Mine"}
    assert shorten_labels([one, "nearest"]) == {one: one, "nearest": "nearest"} and shorten_labels([one]) == {one: one}
    with pytest.raises(InputError, match="--baseline: 'jpda' stands for several of the study's planners: greedy"):
        find_baseline(every, "jpda")
    assert find_baseline(every, "sma-nbo(horizon=3, tracker=jpda)") == "sma-nbo(horizon=3, tracker=jpda)"
    levels = [(("H", h), ("tracker", t)) for h in "13" for t in ("jpda", MINE)]
    varied = [row(f"sma-nbo(horizon={level[0][1]})", 0, level, {"ospa.mean_m": 1.0}) for level in levels]
    assert {g.planner for g in group_rows(varied)} == {"sma-nbo(tracker=jpda)", "sma-nbo(tracker=mine:Mine)"}
    given = parse_labels(rows(), ["theirs=mine:Mine", "ours = greedy(tracker=jpda)"])
    assert {g.planner for g in group_rows(rows(), None, given)} == {"theirs", "ours"}


def test_trackers_are_a_factor_of_the_study_in_place_of_its_own():
    study = add_trackers(Study("tried", ("hover", "greedy"), factors={"L": {"3": {}, "5": {}}}), ["jpda", MINE])
    found = list_cells(study)
    assert [(c.planner, dict(c.factors)["tracker"]) for c in found[:4]] == [
        ("hover", "jpda"), ("greedy", "jpda"), ("hover", MINE), ("greedy", MINE)
    ]  # fmt: skip
    assert [c.settings for c in found[:4:2]] == [{"tracking.tracker": "jpda"}, {"tracking.tracker": MINE}]
    assert list_cells(add_trackers(study, ["jpda"]))[0].settings == {"tracking.tracker": "jpda"}
    assert add_trackers(study, ()) is study
    varied = Study("tried", ("hover",), factors={"way": {"a": {"tracking": {"tracker": "jpda"}}}})
    with pytest.raises(InputError, match=r"^--tracker: tracking\.tracker is what factor 'way' of study tried varies$"):
        add_trackers(varied, ["jpda"])


def test_the_command_shows_trackers_side_by_side(compare, tmp_path, monkeypatch):
    (tmp_path / "sametracker.py").write_text(SAME)
    monkeypatch.syspath_prepend(str(tmp_path))
    options = ["--planner", "hover", "--tracker", "jpda", "--tracker", "sametracker:Same"]
    code, out, err = compare(*options, *FLAGS)
    assert (code, err) == (0, ""), err
    lines = [line.split() for line in out.splitlines() if line.split()[:1] in (["jpda"], ["Same"])]
    assert [line[0] for line in lines[:2]] == ["Same", "jpda"]
    assert "Same is hover(tracker=sametracker:Same)\n" in out
    assert "0, 2, 0" in " ".join(lines[0])  # won, tied, lost: the same tracker under another name
    page = (tmp_path / "runs" / "compare" / "report.html").read_text()
    assert "hover(tracker=sametracker:Same)" in page and "--set tracking.tracker=sametracker:Same" in page
    code, _, err = compare("--tracker", "jdpa", *FLAGS)
    assert code == 2 and err == (
        "understory: --tracker: 'jdpa' is unknown; allowed are jpda; did you mean jpda? (or package.module:Class)\n"
    )
    code, _, err = compare(*options, "--set", "tracking.tracker=jpda", *FLAGS)
    assert code == 2 and "--set: tracking.tracker is what factor 'tracker' of study compare varies" in err
