"""Pages in docs/how-to on plug-ins and studies: plug-ins, study files, SQL, Python and tables are as they say."""

import re

import numpy as np
import pytest
from helpers.pages import DOCS, blocks
from helpers.studies import short, sql, store

from planning.planner import Plan
from planning.planner_check import CHECKS
from sim.mission.mission import Mission
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from sim.sensing.detector_check import check_detector
from sim.study.cells import list_cells
from sim.study.definition import read_study
from sim.study.trial_flight import fly_trial
from sim.study.trials import list_trials
from tracking.fusion.rule import LocalBeliefs
from tracking.fusion.tracker_check import check_tracker

PAGE = (DOCS / "how-to" / "planners.md").read_text(encoding="utf-8")
PLUGINS_PAGE = (DOCS / "how-to" / "plugins.md").read_text(encoding="utf-8")
STUDIES_PAGE = (DOCS / "how-to" / "studies.md").read_text(encoding="utf-8")
TRACKERS_PAGE = (DOCS / "how-to" / "trackers.md").read_text(encoding="utf-8")
PLANNER, SEEN, KNOWN, TEST = (content for language, content in blocks(PAGE) if language == "python")
NEAR = [(x, y) for x in (-20.0, 0.0, 20.0) for y in (-20.0, 0.0, 20.0)]  # m


def test_the_planner_of_the_page_conforms_as_the_test_of_the_page_says(shell, tmp_path):
    (tmp_path / "myplanner.py").write_text(PLANNER)
    names = {}
    exec(compile(TEST, "planners.md", "exec"), names)
    names["test_it_conforms"]()


def test_what_a_planner_can_know_is_what_the_scenario_says():
    names, seen = {}, []
    exec(compile(SEEN + KNOWN, "planners.md", "exec"), names)

    class Asking:
        def plan(self, team, rng):
            seen.append(team)
            return [Plan(np.ones((3, 2)) * situation.time) for situation in team]

    setting = Scenario(duration=2.0, sensing=Sensing(mode="ideal"))
    for _ in Mission(setting, Asking(), 0).fly():
        pass
    for situation, uav in zip(seen[2], setting.uavs, strict=True):
        assert names["tracker_step"](situation) == pytest.approx(1 / setting.rates.sensing)
        assert names["footprint"](situation.own) == pytest.approx(uav.footprint, rel=1e-3)
        assert names["alpha"](situation.own) == pytest.approx(uav.alpha)
        people = np.array([track.belief.mean[:2] for track in situation.tracks])
        shown = [
            names["seen"](situation, situation.own, np.add(situation.own.position, (*gap, 0.0)), people) for gap in NEAR
        ]
        assert np.any(shown) and not np.all(shown)
        assert names["measurement_covariance"](situation.own, situation.tracks[0].belief.mean[:2]).shape == (2, 2)
        # Made at 1 s, and not yet shortened by the control that was flown since.
        told = {j: plan.controls.tolist() for j, plan in situation.intents.items()}
        assert told == dict.fromkeys(range(3), [[1, 1]] * 3)
    assert not seen[0][0].intents


def listed(page, before, after="\n\n"):
    """Names in the first column of a table."""
    rows = re.findall(r"^\| (`.*?`) \|", page.partition(before)[2].partition(after)[0], flags=re.M)
    return [name for row in rows for name in re.findall(r"`(.*?)`", row)]


def test_every_check_is_listed_in_its_order():
    assert listed(PAGE, "## Does it conform?", "\n#") == list(CHECKS)
    assert listed(PLUGINS_PAGE, "| check of a detector |") == [f.check for f in check_detector("blob")]
    assert listed(TRACKERS_PAGE, "| check of a tracker |") == [f.check for f in check_tracker("jpda")]


EXAMPLES = tuple(f"examples/{name}/README.md" for name in ("shepherd", "seedling", "soup"))


def test_links_lead_to_pages_and_headings_that_exist():
    how_to = (f"how-to/{name}.md" for name in ("planners", "plugins", "plugin-faults", "trackers"))
    for name in (*how_to, "tutorials/learning.md", *EXAMPLES):
        page = DOCS / name
        for target in re.findall(r"\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            file, _, heading = target.partition("#")
            assert (page.parent / file).is_file() or not file, target
            text = (page.parent / file if file else page).read_text(encoding="utf-8")
            headings = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")]
            assert not heading or heading in [line.lower().replace(" ", "-") for line in headings], target


def block(language):
    """The only block of a language on the page on studies."""
    (content,) = [content for kind, content in blocks(STUDIES_PAGE) if kind == language]
    return content


def test_study_files_on_pages_are_valid(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(block("toml"))
    assert len(list_trials(read_study(str(path)))) == 10 * 2 * (1 + 2)
    path = tmp_path / "trackers.toml"
    path.write_text(next(content for language, content in blocks(TRACKERS_PAGE) if language == "toml"))
    assert [cell.settings for cell in list_cells(read_study(str(path)))] == [
        {"tracking.tracker": "jpda"}, {"tracking.management": "m_of_n"}, {"tracking.tracker": "mytracker:Nearest"}
    ]  # fmt: skip


def test_all_that_a_fusion_rule_is_given_is_listed():
    assert set(listed(PLUGINS_PAGE, "| of `local` |")) == set(LocalBeliefs._fields)


def test_the_query_on_a_study_answers(tmp_path):
    made = short(["hover"], "0-1", factors={"lambda": {"15": {"trees": {"density": 15}}}})
    mean = np.mean([row.metrics["ospa.share_under_1m"] for row in store(tmp_path, made)])
    (found,) = sql(tmp_path, block("sql"))
    assert found == ("15", "hover", pytest.approx(mean))


def test_the_python_on_studies_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(block("python"), "studies.md", "exec"), {})
    assert "breakdown" in capsys.readouterr().out


def test_the_page_on_studies_names_metrics():
    (task,) = short(["hover"], "0")
    for name in fly_trial(task).row.metrics:
        assert f"`{name}`" in STUDIES_PAGE or name.startswith("seconds.")
