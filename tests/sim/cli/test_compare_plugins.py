"""`understory compare` refuses the plug-ins that `understory run` refuses, in the same words and before it flies."""

import sys

import pytest

FLAGS = ["--duration", "1", "--set", "sensing.mode=ideal"]
MODULE = """
class Stepless:
    def __init__(self, *given): pass


class Raising:
    def __init__(self, *given): raise ValueError("no table")


class Forgetful:
    stateful = True

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
