"""The check of planners: planners of ours pass it, and each kind of broken planner fails the check that fits."""

import dataclasses
import random
import re
import sys
from functools import partial

import numpy as np
import pytest
from helpers.teams import with_little_effort

from planning.catalogue import PLANNERS
from planning.planner import Plan
from planning.planner_check import CHECKS, check_planner
from planning.planner_loading import load_planner
from tracking.errors import InputError


def find_failures(planner):
    return {finding.check: finding.seen for finding in check_planner(planner) if finding.passed is False}


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_of_ours_conforms(name):
    findings = check_planner(with_little_effort(name))
    assert [str(f) for f in findings if f.passed is False] == [] and [f.check for f in findings] == list(CHECKS)
    untried = {f.check for f in findings if f.passed is None}
    assert untried == ({"decentralised"} if name in ("centralized", "lawnmower") else set())


@pytest.mark.parametrize("planner", ["sma-nbo-mwtp", "sma-nbo-mwtp(horizon=1)", "pma-nbo(horizon=1)"])
def test_with_all_their_evaluations_nothing_is_known_by_what_others_drew(planner):
    """Elites of one-step plans are few, and their number depends on beliefs."""
    assert CHECKS["decentralised"](lambda: load_planner(planner))


class Good:
    """Flies towards the mean of the tracks at a speed drawn by chance."""

    decentralised = True

    def plan(self, team, rng):
        streams = rng.spawn(len(team))
        return [self.one(s, stream, team) for s, stream in zip(team, streams, strict=True)]

    def one(self, s, rng, team):
        gap = np.mean([t.belief.mean[:2] for t in s.tracks] or [s.own.position[:2]], axis=0) - s.own.position[:2]
        return Plan(rng.uniform(0, 1) * s.own.max_speed * gap[None] / max(np.linalg.norm(gap), 1e-9))


def kind(name, **changed):
    """A class of this module that is `Good` but for what is changed."""
    globals()[name] = type(name, (Good,), changed)
    return globals()[name]


class Counting(Good):
    calls = 0

    def plan(self, team, rng):
        self.calls += 1
        return [Plan(plan.controls / self.calls) for plan in super().plan(team, rng)]


class Recurrent(Good):
    """Remembers, by UAV, what it planned before, and its share, which the seed gives."""

    stateful = True

    def reset(self, seed):
        self.share, self.before = np.random.default_rng(seed).random(), {}

    def one(self, s, rng, team):
        before = self.before.get(s.own.id, np.zeros((1, 2)))
        self.before[s.own.id] = self.share * super().one(s, rng, team).controls + (1.0 - self.share) * before
        return Plan(self.before[s.own.id].copy())


class Gossip(Recurrent):
    """Remembers what others that it does not hear held at the last decision."""

    def reset(self, seed):
        super().reset(seed)
        self.held = {}

    def plan(self, team, rng):
        before, self.held = self.held, {s.own.id: sum(t.belief.mean[0] for t in s.tracks) for s in team}
        unheard = [before.keys() - {v.id for v in s.vehicles} for s in team]
        rumours = [1e-3 * sum(before[i] for i in sorted(ids)) for ids in unheard]
        plans = zip(super().plan(team, rng), rumours, strict=True)
        return [Plan(0.9 * plan.controls + np.array([[0.0, rumour]])) for plan, rumour in plans]


class Clinging(Recurrent):
    """Forgets its share alone."""

    def reset(self, seed):
        before = getattr(self, "before", {})
        super().reset(seed)
        self.before = before


class Forgetful(Good):
    share = 0.5

    def __getstate__(self):
        return {"share": 1.0}

    def one(self, s, rng, team):
        return Plan(self.share * super().one(s, rng, team).controls)


class Eavesdropping(Good):
    """Reads the minds of those it hears."""

    def one(self, s, rng, team):
        ids = {v.id for v in s.vehicles}
        tracks = tuple(t for o in team if o.own.id in ids for t in o.tracks)
        return super().one(dataclasses.replace(s, tracks=tracks), rng, team)


class Telepathic(Good):
    """Knows the plans of UAVs that it does not hear, but nothing besides."""

    def knows(self, s, other, ids):
        return other not in ids

    def plan(self, team, rng):
        plans = {}
        for s in team:
            ids = {v.id for v in s.neighbours}
            before = sum((plans[i] for i in plans if self.knows(s, i, ids)), np.zeros((1, 2)))
            plans[s.own.id] = 0.5 * super().one(s, rng, team).controls + 0.05 * before
        return [Plan(controls) for controls in plans.values()]


class Sequence(Telepathic):
    """Knows the plans that it receives, as is right."""

    def knows(self, s, other, ids):
        return s.receives(other)


class Deaf(Telepathic):
    """Takes the plans of those it hears to arrive, whatever gets lost."""

    def knows(self, s, other, ids):
        return other in ids


def leaking(self, s, rng, team):
    """Plans as it should, but expects of another UAV what those it does not hear know."""
    unheard = [o for o in team if o.own.id not in {v.id for v in s.vehicles}]
    expected = sum(t.belief.mean[0] for o in unheard for t in o.tracks)
    return Plan(Good.one(self, s, rng, team).controls, {7: np.array([[expected, 0.0]])})


def writing(self, s, rng, team):
    for track in s.tracks[3:]:
        track.belief.mean[0] += 1.0
    return Plan(np.zeros((1, 2)))


def twenty_speeds(self, s, rng, team):
    speeds = np.zeros((20, 2))
    speeds[: len(s.tracks)] = [t.belief.mean[2:] * 1e-6 for t in s.tracks] or 0.0
    return Plan(speeds)


def always(make):
    """A way to plan the same controls for every UAV."""
    return lambda self, s, rng, team: Plan(np.array(make()))


def after(use):
    """A way to plan as it should, after a use of the situation."""
    return lambda self, s, rng, team: (use(s, team), Good.one(self, s, rng, team))[1]


# What is wrong, the check that finds it, and what that says.
REPEATED, CLAIM = "same seed, same plan", "decentralised"
BROKEN = [
    (kind("Raising", one=after(lambda s, team: {}["two\nlines"])), "plans", "KeyError: 'two\\nlines' (/"),
    (kind("Silent", plan=lambda self, team, rng: None), "plans", "None in place of plans for 3 UAVs (/"),
    (kind("Spatial", one=always(lambda: [[0.0] * 3] * 2)), "plans", "controls of shape (2, 3), not (H, 2)"),
    (kind("Fast", one=always(lambda: [[4, 0]])), "speed limit", "the plan of UAV 2 reaches 4 m/s; 3 m/s is what"),
    (kind("Writing", one=writing), "inputs untouched", "team[0].tracks[3].belief.mean is changed"),
    (kind("Legacy", one=always(lambda: [[np.random.uniform(-1, 1), 0]])), REPEATED, "it uses global random numbers"),  # noqa: NPY002
    (kind("Guessing", one=always(lambda: [[random.SystemRandom().random(), 0]])), REPEATED, "of another instance"),
    (Counting, "memory", "without stateful = True, but after another situation, plans differ by"),
    (Clinging, "memory", "after reset(seed) with the same seed and calls, plans differ by"),
    (kind("Unpicklable", __init__=lambda self: setattr(self, "speed", lambda: 1.0)), "pickling", "pickle"),
    (Forgetful, "pickling", "of a pickled copy, plans differ by"),
    (kind("Leaking", one=leaking), CLAIM, "UAV 0 is out of contact, but what others know changes the plan of UAV 0"),
    (Gossip, CLAIM, "UAV 0 is out of contact, but what others know changes the plan of UAV 0"),
    (Telepathic, CLAIM, "UAV 1 is out of contact, but what others know changes the plan of UAV 1"),
    (Eavesdropping, CLAIM, "UAV 0 cannot move, but what it knows changes the plan of UAV 1"),
    (Deaf, CLAIM, "UAV 0's plan is lost, but what it knows changes the plan of UAV"),
    (kind("Pair", one=after(lambda s, team: team[1])), "one UAV", "IndexError"),
    (kind("Needy", one=after(lambda s, team: s.tracks[0])), "no tracks", "IndexError"),
    (kind("Wooden", one=after(lambda s, team: s.forest.trees[0])), "no trees", "IndexError"),
    (kind("Placing", one=after(lambda s, team: team[s.own.id])), "a UAV broken down", "IndexError"),
    (kind("Sociable", one=after(lambda s, team: len(team) > 1 and s.neighbours[0])), "out of contact", "IndexError"),
    (kind("Hasty", one=after(lambda s, team: s.own.id == 0 and s.intents[0])), "first decision", "KeyError"),
    (kind("Small", one=twenty_speeds), "fifty tracks", "could not broadcast"),
]


@pytest.mark.parametrize(("planner", "name", "seen"), BROKEN, ids=[planner.__name__ for planner, _, _ in BROKEN])
def test_a_broken_planner_fails_the_check_that_fits_and_no_other(planner, name, seen):
    found = find_failures(planner)
    assert list(found) == [name] and seen in found[name] and "\n" not in found[name]


def test_broken_planners_cover_every_check():
    assert {name for _, name, _ in BROKEN} == set(CHECKS) - {"time"}


@pytest.mark.parametrize("planner", [Good, Sequence, Recurrent])
def test_a_good_planner_passes_all(planner):
    assert {finding.passed for finding in check_planner(planner)} == {True}


def gone(module):
    """A class that is not to be found where it says to be, as of a notebook's cell that was run again."""
    return type("Gone", (Good,), {"__module__": module})


@pytest.mark.parametrize(
    ("make", "place"),
    [
        (gone("elsewhere"), "elsewhere"),
        (partial(gone("__main__")), "__main__"),
        (type("Local", (Good,), {"__qualname__": "make.<locals>.Local"}), "a function"),
    ],
)
def test_where_pickle_cannot_find_the_class_nothing_is_said_of_the_planner(make, place):
    findings = {finding.check: finding for finding in check_planner(make)}
    assert {finding.passed for name, finding in findings.items() if name != "pickling"} == {True}
    told = f"not tried: its class is defined in {place}, where pickle does not find it"
    assert (findings["pickling"].passed, findings["pickling"].seen) == (None, told)


@pytest.mark.parametrize("make", [lambda: Good(), "__main__:Mine"])
def test_classes_of_scripts_and_lambdas_are_checked_as_any(make, monkeypatch):
    mine = type("Mine", (Good,), {"__module__": "__main__"})
    monkeypatch.setattr(sys.modules["__main__"], "Mine", mine, raising=False)
    assert {finding.passed for finding in check_planner(make)} == {True}


def test_without_plans_nothing_else_is_tried():
    findings = check_planner(kind("Mute", plan=lambda self, team, rng: None))
    assert [f.passed for f in findings] == [False] + [None] * (len(CHECKS) - 1)
    assert {f.seen for f in findings[1:]} == {"not tried: it fails 'plans'"}


def test_without_repetition_nothing_is_compared():
    odd = kind("Odd", one=always(lambda: [[np.random.uniform(-1, 1), 0]]))  # noqa: NPY002
    untried = {f.check for f in check_planner(odd) if f.passed is None}
    assert untried == {"memory", "pickling", "decentralised"}


@pytest.mark.parametrize(
    ("maker", "text"),
    [
        ("hoover", "planner: 'hoover' is unknown; allowed are "),
        (Good(), "planner: <"),
        (kind("Heavy", __init__=lambda self: {}["weights"]), "planner: 'Heavy' cannot be made: KeyError: 'weights'"),
        (type("Planless", (), {}), "planner: 'Planless' has no method plan(team, rng)"),
        (type("Narrow", (), {"plan": lambda self, team: []}), "planner: plan of 'Narrow' takes (team); it must take"),
        (kind("Odd", stateful=True), "planner: 'Odd' is stateful, but has no method reset(seed)"),
    ],
)
def test_what_makes_no_planner_is_refused_in_one_line(maker, text):
    with pytest.raises(InputError, match=f"^{re.escape(text)}.*$"):
        check_planner(maker)
