"""docs/results/worlds.md: what it says in words is what the listed trials show."""

import re
import sys
from collections import defaultdict

import numpy as np
import pytest
from helpers.pages import DOCS
from helpers.studies import invented
from msgspec.structs import replace

from planning.registry import PLANNERS
from sim.study.store import Store
from sim.study.study import adapted
from sim.study.tasks import tasks
from sim.study.trial import fly

sys.path.append(str(DOCS))
import scores

WORLDS = 10
THIRTY = (
    "sma-nbo",
    "pma-nbo",
    "mcr(samples=4, beta=0.5, evaluations=9216)",
    "dec-pomdp",
    "centralized",
    "lawnmower",
)


@pytest.fixture(scope="module")
def page():
    """The page as one line of words."""
    return " ".join((DOCS / "results" / "worlds.md").read_text(encoding="utf-8").split())


def rows(table):
    """Texts of a table by the first of a line."""
    _, _, *lines = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines())
    return {name.strip("`"): texts for name, *texts in lines}


def value(text):
    return float(re.match(r"\**([-+]?[\d.]+)", text)[1])


def test_the_default_is_first_over_all_worlds_and_no_rival_ahead_in_one(page):
    assert "the default has the lowest mean GOSPA among the planners of the table that do not know the truth," in page
    assert "ahead of each by more than the interval, paired by map." in page
    assert "No rival but the oracle is ahead of the default by more than its interval, in any world." in page
    gaps = rows(scores.gaps_table("gospa.mean_m"))
    rivals = {name: texts for name, texts in gaps.items() if name in scores.RIVALS}
    assert list(rivals) == scores.RIVALS and all(len(texts) == WORLDS + 1 for texts in rivals.values())
    assert all(texts[-1].startswith("**+") for texts in rivals.values())
    assert not [text for texts in rivals.values() for text in texts if text.startswith("**-")]


def test_no_planner_is_ahead_of_the_oracle(page):
    assert "The oracle is an upper bound: no planner is ahead of it by more than an interval." in page
    gaps = rows(scores.gaps_table("gospa.mean_m", base="oracle"))
    names = [scores.DEFAULT, *scores.RIVALS]
    assert all(len(gaps[name]) == WORLDS + 1 for name in names)
    assert not [text for name in names for text in gaps[name] if text.startswith("**-")]


def test_the_list_has_the_maps_that_the_commands_fly(page):
    flown = defaultdict(set)
    for row in scores.trials():
        flown[row.scenario, row.planner, dict(row.factors).get("view", "")].add(row.seed)
    assert page.count("compare bench-1 --maps 50") == 3 and page.count("compare bench-1 --maps 30") == 1
    for (world, planner, _), seeds in flown.items():
        maps = 30 if planner in THIRTY and (world, planner) != ("search", "lawnmower") else 50
        assert sorted(seeds) == list(range(maps)), (world, planner)
    assert len(flown) == WORLDS * (12 + len(THIRTY))
    maps = {name: texts[0] for name, texts in rows(scores.scores_table()).items()}
    assert maps["sma-nbo-gospa"] == maps["rsp"] == "50" and maps["lawnmower"] == "30 or 50" and maps["pma-nbo"] == "30"


def test_the_tables_have_all_built_in_planners():
    assert {name.partition("(")[0] for name in scores.ORDER} | {"hover"} == set(PLANNERS)


def test_a_study_adds_each_trial_once_and_none_of_other_settings(tmp_path, monkeypatch):
    """The list before and after studies of two worlds, of the same with other settings, and of one world alone."""
    monkeypatch.setattr(scores, "TRIALS", tmp_path / "worlds.csv")

    def added(value, worlds, **changes):
        with Store.opened(tmp_path / "runs", "bench-1") as opened:
            for task in tasks(adapted(scores.STUDY, planners=["greedy"], scenarios=worlds, seeds="0", **changes)):
                opened.add(task, replace(invented(task), metrics=dict.fromkeys(scores.METRICS, value)))
        scores.add([tmp_path / "runs"])
        return [(row.scenario, row.planner, row.metrics["share_held"]) for row in scores.trials()]

    planners = ("greedy", "hover", "sma-nbo-mwtp")
    first = [(world, planner, 0.5) for world in ("scatter", "crowd") for planner in planners]
    assert added(0.5, ["scatter", "crowd"]) == first
    assert added(0.9, ["scatter", "crowd"], overrides=["dynamics=kinematic"]) == first
    assert added(0.75, ["crowd"]) == [*first[:3], *(("crowd", planner, 0.75) for planner in planners)]


@pytest.mark.docs
@pytest.mark.parametrize(("world", "planner"), [("forest", "sma-nbo-gospa"), ("patchwork", "hover"), ("paper", "rsp")])
def test_trials_of_the_list_are_those_of_this_program(world, planner):
    listed = next(row for row in scores.trials() if (row.scenario, row.planner, row.seed) == (world, planner, 4))
    study = adapted(scores.STUDY, scenarios=[world], planners=[planner], seeds="4")
    row = fly(next(task for task in tasks(study) if task.planner == planner)).row
    shown = [[metrics[name] for name in scores.METRICS] for metrics in (row.metrics, listed.metrics)]
    np.testing.assert_allclose(*shown, rtol=1e-9)
