"""`understory compare` refuses the plug-ins that `understory run` refuses, in the same words and before it flies."""

import sys

import pytest
from helpers.studies import Serial

FLAGS = ["--duration", "1", "--set", "sensing.mode=ideal"]
MODULE = """
from planning.planner import Exchange
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.tracker import Tracker

made = []


class Stepless:
    def __init__(self, *given): pass


class Raising:
    def __init__(self, *given): raise ValueError("no table")


class Forgetful:
    stateful = True

    def plan(self, team, rng): return []


class Counted(Tracker):
    def __init__(self, *given):
        made.append("tracker")
        super().__init__(*given)


class Planner:
    exchange = property(lambda self: made.append("planner") or Exchange())

    def plan(self, team, rng): return []
"""
STUDY = """
study = { name = "mine", planners = ["hover"], seeds = "0-1" }
factors.rule.ours.network.fusion = "kla"
factors.rule.theirs.network.fusion = "theirs:Stepless"
"""
REFUSED = {
    "tracking.tracker=theirs:Raising": "'theirs:Raising' cannot be made: ValueError: no table (",
    "sensing.mode=theirs:Stepless": "'theirs:Stepless' has no method sense(",
}


@pytest.fixture(autouse=True)
def theirs(tmp_path, monkeypatch):
    """A module with plug-ins in the current folder, imported anew; plug-ins fly in this process."""
    (tmp_path / "theirs.py").write_text(MODULE)
    monkeypatch.delitem(sys.modules, "theirs", raising=False)


@pytest.mark.parametrize(("override", "words"), REFUSED.items())
def test_what_a_run_refuses_a_comparison_refuses_in_the_same_words(refused, override, words):
    flags = ["--planner", "hover", "--duration", "1", "--set", override]
    told = refused("run", *flags)
    assert words in told and refused("compare", *flags) == told


def test_trackers_planners_and_levels_that_cannot_be_made_are_refused_too(refused, tmp_path):
    told = refused("compare", "--tracker", "jpda", "--tracker", "theirs:Stepless", *FLAGS)
    assert told == "understory: tracking.tracker: 'theirs:Stepless' has no method step(scan)\n"
    told = refused("run", "--planner", "theirs:Forgetful")
    assert "no method reset(seed)" in told
    assert refused("compare", "--planner", "hover", "--planner", "theirs:Forgetful", *FLAGS) == told
    (tmp_path / "mine.toml").write_text(STUDY)
    told = refused("compare", "mine.toml", *FLAGS)
    assert told.startswith("understory: mine.toml: factors.rule.theirs: network.fusion: 'theirs:Stepless' has no")


def test_plug_ins_are_made_once_for_each_setting_and_planner_and_not_for_trials(compare):
    flags = ["--tracker", "theirs:Counted", "--seeds", "0-3", "--repeats", "3", *FLAGS]

    def counts(*more):
        """Numbers of trackers and of planners made, and of trials flown."""
        executor = Serial({"no planner": []})  # invents its rows, so that all that is made is made before the flights
        assert compare("--planner", "theirs:Planner", *flags, *more, executor=executor)[0] == 0
        made = sys.modules["theirs"].made
        trackers, planners = made.count("tracker"), made.count("planner")
        made.clear()
        return trackers, planners, len(executor.flown)

    assert counts() == (3, 1, 12)  # three UAVs
    assert counts() == (0, 0, 0)  # all trials are in the store
    assert counts("--redo") == (3, 1, 12)
    assert counts("--planner", "hover") == (3, 0, 12)
    assert counts("--planner", "hover", "--tracker", "jpda") == (0, 1, 24)  # both planners in the new setting
