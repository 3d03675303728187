"""docs/how-to/plugins.md: its planner flies, conforms and has the checks that are listed."""

import re
from pathlib import Path

import numpy as np
import pytest

from planning.conformance.checks import CHECKS
from planning.planner import Plan
from sim.conformance.detector import check as check_detector
from sim.mission.mission import Mission
from sim.scenario.perception import Sensing
from sim.scenario.scenario import Scenario

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "how-to" / "plugins.md").read_text(encoding="utf-8")


def test_the_planner_of_the_page_conforms_as_the_test_of_the_page_says(tmp_path, monkeypatch):
    planner, _, test = re.findall(r"^```python\n(.*?)^```$", PAGE, flags=re.M | re.S)
    (tmp_path / "myplanner.py").write_text(planner)
    monkeypatch.syspath_prepend(tmp_path)
    names = {}
    exec(compile(test, "plugins.md", "exec"), names)
    names["test_it_conforms"]()


def test_what_a_planner_can_know_is_what_the_scenario_says():
    _, known, _ = re.findall(r"^```python\n(.*?)^```$", PAGE, flags=re.M | re.S)
    names, seen = {}, []
    exec(compile(known, "plugins.md", "exec"), names)

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
        assert names["measurement_covariance"](situation.own, situation.tracks[0].belief.mean[:2]).shape == (2, 2)
        # Made at 1 s, and not yet shortened by the control that was flown since.
        assert {j: plan.controls.tolist() for j, plan in situation.intents.items()} == dict.fromkeys(
            range(3), [[1, 1]] * 3
        )
    assert not seen[0][0].intents


def test_every_check_is_listed_in_its_order():
    rows = re.findall(r"^\| (`.*?`) \|", PAGE.partition("## Does it conform?")[2].partition("\n#")[0], flags=re.M)
    listed = [name for row in rows for name in re.findall(r"`(.*?)`", row)]
    assert listed == list(CHECKS)


def test_every_check_of_a_detector_is_listed_in_its_order():
    rows = re.findall(r"^\| (`.*?`) \|", PAGE.partition("| check of a detector |")[2].partition("\n\n")[0], flags=re.M)
    assert [name for row in rows for name in re.findall(r"`(.*?)`", row)] == [f.check for f in check_detector("blob")]


def test_links_lead_somewhere():
    for page in (DOCS / "how-to" / "plugins.md", DOCS / "examples" / "shepherd" / "README.md"):
        for target in re.findall(r"\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            file, _, heading = target.partition("#")
            assert (page.parent / file).is_file() or not file, target
            text = (page.parent / file if file else page).read_text(encoding="utf-8")
            headings = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")]
            assert not heading or heading in [line.lower().replace(" ", "-") for line in headings], target
