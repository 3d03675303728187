"""docs/results/worlds.md: what it says in words is what the listed trials show."""

import re
import sys
from collections import defaultdict

import numpy as np
import pytest
from helpers.pages import DOCS, text_of
from helpers.studies import invented
from msgspec.structs import replace

from planning.catalogue import PLANNERS
from sim.study.analysis.answers import differences, holm
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.analysis.normalised_score import SCORE
from sim.study.definition import adapt_study
from sim.study.store import Store
from sim.study.trial_flight import fly_trial
from sim.study.trials import list_trials

sys.path.append(str(DOCS))
import scores

pytestmark = pytest.mark.docs

WORLDS = 10
FEWER = 12  # maps that `oracle-found` has flown
SEARCHING = "mcr(samples=10, search=0.1)"
PATCHWORK = scores.STUDY.scenarios.index("patchwork")
GOSPA = find_shown_metric("gospa.mean_m")


@pytest.fixture(scope="module")
def page():
    """The page as one line of words."""
    return " ".join(text_of("results/worlds").split())


def rows(table):
    """Texts of a table by the first of a line."""
    _, _, *lines = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines())
    return {name.strip("`"): texts for name, *texts in lines}


def test_the_page_says_who_is_ahead_of_whom_as_its_tables_show(page, monkeypatch):
    """With the planners that its tables leave out. No rival is ahead of the default, none at all of the oracle."""
    monkeypatch.setattr(scores, "FLOORS", ())
    assert "the default has the lowest mean GOSPA among the planners of the table that do not know the truth," in page
    assert f"It is ahead of each by more than the interval; of `{SEARCHING}` only in `patchwork`" in page
    assert "No rival but the oracle is ahead of the default beyond chance, in any world." in page
    assert "The oracle is an upper bound: no planner is ahead of it by more than an interval." in page
    gaps, behind = (rows(scores.gaps_table("gospa.mean_m", base=base)) for base in (scores.DEFAULT, "oracle"))
    rivals = {name: texts for name, texts in gaps.items() if name in scores.RIVALS}
    assert list(rivals) == scores.RIVALS and all(len(texts) == WORLDS + 1 for texts in rivals.values())
    assert all(texts[-1].startswith("**+") for name, texts in rivals.items() if name != SEARCHING)
    *worlds, mean = rivals[SEARCHING]
    assert mean.startswith("_+") and [k for k, text in enumerate(worlds) if text[0] in "*_"] == [PATCHWORK]
    assert worlds[PATCHWORK].startswith("**+")
    compared = [*rivals.values(), *(behind[name] for name in (scores.DEFAULT, *scores.RIVALS))]
    assert not [text for texts in compared for text in texts if text.startswith(("**-", "_-"))]
    means = [re.match(r"[*_]*([-+]?[\d.]+)", gaps[name][-1])[1] for name in ("lawnmower", "random")]
    assert f"whose GOSPA is {' and '.join(mean.lstrip('+') for mean in means)} m larger in the mean." in page


def test_mean_scores_are_as_the_page_says(page):
    means = {s.planner: s.mean.text(SCORE) for s in scores._scored(scores._groups()).scores if s.cell is None}
    share, _, interval = means[scores.DEFAULT].partition(" ")
    others = f"`oracle` {means['oracle']}, `random` {means['random']} and `lawnmower` {means['lawnmower']}"
    assert f"where the default has {share} % {interval}, {others}." in page


def test_differences_are_marked_by_holms_correction_for_all_planners(monkeypatch):
    """Counted from the trials: p-values of the paired differences in all worlds and planners together."""
    monkeypatch.setattr(scores, "ORDER", scores.ORDER[:4])
    found = defaultdict(dict)
    for row in scores.trials():
        if not dict(row.factors).get("view"):
            found[row.planner, row.scenario][row.seed] = row.metrics["gospa.mean_m"]
    marks = {name: [text[:2] for text in texts] for name, texts in rows(scores.gaps_table("gospa.mean_m")).items()}
    chances = {}
    for name in scores.ORDER[1:]:
        gaps = [
            np.array([found[name, world][seed] - found[scores.DEFAULT, world][seed] for seed in range(50)])
            for world in scores.STUDY.scenarios
        ]
        for k, gap in enumerate([*gaps, np.mean(gaps, axis=0)]):
            chances[name, k] = differences({(s, 0): gap[s : s + 1] for s in range(50)}, [GOSPA])[0].p_value
    kept = {place for place, survives in zip(chances, holm(list(chances.values())), strict=True) if survives}
    assert 5 < len(kept) < len(chances) - 5
    assert {place for place in chances if marks[place[0]][place[1]] == "**"} == kept


def test_the_list_has_the_maps_that_the_commands_fly(page):
    flown = defaultdict(set)
    for row in scores.trials():
        flown[row.scenario, row.planner, dict(row.factors).get("view", "")].add(row.seed)
    assert page.count("compare bench-1 --seeds 0-49") == 2
    assert all(seeds == set(range(FEWER if "oracle-found" in place else 50)) for place, seeds in flown.items())
    assert len(flown) == WORLDS * (len(scores.ORDER) + 2)  # and floor and bound
    asked = set(re.findall(r"--planner '?([\w-]+(?:\([^)]*\))?)", page.partition("Today's settings")[0]))
    assert asked | set(scores.STUDY.planners) | {"hover"} == {planner for _, planner, _ in flown}
    assert {name.partition("(")[0] for name in scores.ORDER} | {"hover"} == set(PLANNERS)


def test_a_study_adds_each_trial_once_and_none_of_other_settings(tmp_path, monkeypatch):
    """The list before and after studies of two worlds, of the same with other settings, and of one world alone."""
    monkeypatch.setattr(scores, "TRIALS", tmp_path / "worlds.csv")

    def added(value, worlds, **changes):
        with Store.open(tmp_path / "runs", "bench-1") as opened:
            study = adapt_study(scores.STUDY, planners=["greedy"], scenarios=worlds, seeds="0", **changes)
            for task in list_trials(study):
                opened.add(task, replace(invented(task), metrics=dict.fromkeys(scores.METRICS, value)))
        scores.add([tmp_path / "runs"])
        return [(row.scenario, row.planner, row.metrics["share_held"]) for row in scores.trials()]

    planners = ("greedy", "hover", "sma-nbo-mwtp")
    first = [(world, planner, 0.5) for world in ("scatter", "crowd") for planner in planners]
    assert added(0.5, ["scatter", "crowd"]) == first
    assert added(0.9, ["scatter", "crowd"], overrides=["dynamics=kinematic"]) == first
    assert added(0.75, ["crowd"]) == [*first[:3], *(("crowd", planner, 0.75) for planner in planners)]


@pytest.mark.docs
@pytest.mark.parametrize(("world", "planner"), [("patchwork", "sma-nbo-gospa"), ("crowd", "hover"), ("paper", "rsp")])
def test_trials_of_the_list_are_those_of_this_program(world, planner):
    listed = next(row for row in scores.trials() if (row.scenario, row.planner, row.seed) == (world, planner, 4))
    study = adapt_study(scores.STUDY, scenarios=[world], planners=[planner], seeds="4")
    row = fly_trial(next(task for task in list_trials(study) if task.planner == planner)).row
    shown = [[metrics[name] for name in scores.METRICS] for metrics in (row.metrics, listed.metrics)]
    np.testing.assert_allclose(*shown, rtol=1e-9)
