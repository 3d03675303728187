"""The conformance check: planners of ours pass it, and each kind of broken planner fails the check that fits."""

import dataclasses
import random
import re

import numpy as np
import pytest

from planning.composition import Composition
from planning.conformance.checks import CHECKS, Subject, check
from planning.coordination.schemes import Centralised, Sequential
from planning.loading import load_planner
from planning.planner import Plan
from planning.registry import PLANNERS
from tracking.errors import InputError
from tracking.plugins.findings import Unfit

CLAIM = {"nothing from the unheard", "only plans from others"}
BARE, DIFFER = "plan 0: it is no Plan but of type ndarray", "plans differ by"
HASHES, OTHERS = f"in a process with other hashes of strings, {DIFFER}", f"others of {DIFFER}"
CHANCE, DOWN, GLOBAL = "chance only from rng", "a UAV broken down", "uses the global random numbers"
LITTLE = {"mcr": "(samples=5, evaluations=64)"}  # effort
LITTLE |= dict.fromkeys(["lawnmower", "greedy", "random", "hover", "thompson"], "")


def failed(planner, **options):
    return {finding.check: finding.seen for finding in check(planner, **options) if finding.passed is False}


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_of_ours_conforms(name):
    findings = check(name + LITTLE.get(name, "(evaluations=64)"), other_process=False)
    assert [str(f) for f in findings if f.passed is False] == []
    assert {f.check for f in findings} == set(CHECKS) - {"other process"}
    untried = {f.check for f in findings if f.passed is None}
    assert untried == (CLAIM if name in ("centralized", "lawnmower") else set())


@pytest.mark.parametrize("planner", ["sma-nbo-mwtp", "sma-nbo-mwtp(horizon=1)", "pma-nbo(horizon=1)"])
def test_with_all_their_evaluations_nothing_is_known_by_what_others_drew(planner):
    """Elites of one-step plans are few, and their number depends on beliefs."""
    subject = Subject(lambda: load_planner(planner), planner)
    assert all(CHECKS[name](subject) for name in CLAIM)


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


class Raising(Good):
    def one(self, s, rng, team):
        raise RuntimeError("two\nlines")


class Writing(Good):
    def one(self, s, rng, team):
        for track in s.tracks[3:]:
            track.belief.mean[0] += 1.0
        return Plan(np.zeros((1, 2)))


class Sorting(Good):
    def plan(self, team, rng):
        plans = super().plan(team, rng)
        team.reverse()
        return plans


class Counting(Good):
    calls = 0

    def plan(self, team, rng):
        self.calls += 1
        return [Plan(plan.controls / self.calls) for plan in super().plan(team, rng)]


class Buffering(Good):
    def __init__(self):
        self.buffer = np.zeros((3, 1, 2))

    def plan(self, team, rng):
        for row, plan in zip(self.buffer, super().plan(team, rng), strict=False):
            row[:] = plan.controls
        return [Plan(row) for row, _ in zip(self.buffer, team, strict=False)]


class Amending(Good):
    """Changes, at each decision, what earlier plans expect of another UAV."""

    def __init__(self):
        self.expected = np.zeros((1, 2))

    def plan(self, team, rng):
        self.expected[:] = sum(tree.x for tree in team[0].forest.trees)
        return [Plan(plan.controls, {7: self.expected}) for plan in super().plan(team, rng)]


class Fading(Good):
    """Has no plan for the first UAV from the second call on."""

    def __init__(self):
        self.calls = 0

    def plan(self, team, rng):
        self.calls += 1
        plans = Good.plan(self, team, rng)
        return [None, *plans[1:]] if self.calls > 1 else plans


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
    def __init__(self):
        self.share = 0.5

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


class Nosy(Good):
    """Goes by where those it hears look for people."""

    def plan(self, team, rng):
        north = {s.own.id: s.undetected.people[10:].sum() / max(s.undetected.people.sum(), 1e-9) for s in team}
        return [Plan(np.array([[0.0, 0.1 * sum(north[v.id] for v in s.vehicles if v.id in north)]])) for s in team]


class Centre(Composition):
    decentralised = True

    def __init__(self):
        super().__init__(coordination=Centralised())


class WorstFirst(Composition):
    decentralised = True

    def __init__(self):
        super().__init__(coordination=Sequential("worst-first"))


def leaking(self, s, rng, team):
    """Plans as it should, but expects of another UAV what those it does not hear know."""
    unheard = [o for o in team if o.own.id not in {v.id for v in s.vehicles}]
    expected = sum(t.belief.mean[0] for o in unheard for t in o.tracks)
    return Plan(Good.one(self, s, rng, team).controls, {7: np.array([[expected, 0.0]])})


def noted(self, s, rng, team):
    s.intents[9] = Plan(np.zeros((1, 2)))
    return Good.one(self, s, rng, team)


def nearest(self, s, rng, team):
    return Plan(1e-6 * min((t.belief.mean[:2] for t in s.tracks), key=np.linalg.norm)[None])


def first_tree(self, s, rng, team):
    return Plan(s.forest.cylinders[:1, :2] * 1e-6) if len(s.forest.cylinders) else Plan(np.zeros((0, 2)))


def first_neighbour(self, s, rng, team):
    return Plan((s.neighbours if len(team) > 1 else (s.own,))[0].position[None, :2] * 1e-6)


def last_intent(self, s, rng, team):
    return Plan(1e-3 * s.intents[min(s.intents)].controls) if s.own.id == 0 else Good.one(self, s, rng, team)


def twenty_speeds(self, s, rng, team):
    speeds = np.zeros((20, 2))
    speeds[: len(s.tracks)] = [t.belief.mean[2:] * 1e-6 for t in s.tracks] or 0.0
    return Plan(speeds)


def expecting(make):
    """A way to plan as it should, but to expect of another UAV what `make` returns, m/s eastwards."""
    return lambda self, s, rng, team: Plan(Good.one(self, s, rng, team).controls, {7: np.array([[make(), 0.0]])})


def with_rng(make):
    """A way to plan with random numbers of one's own."""
    return lambda self, s, rng, team: Good.one(self, s, np.random.default_rng(make()), team)


def always(make):
    """A way to plan the same controls for every UAV."""
    return lambda self, s, rng, team: Plan(np.array(make()))


# What is wrong, the check that finds it, and what that says.
BROKEN = [
    (Raising, "plans", "RuntimeError: two lines"),
    (kind("Few", plan=lambda self, team, rng: Good.plan(self, team, rng)[1:]), "plans", "2 plans for 3 UAVs"),
    (kind("Silent", plan=lambda self, team, rng: None), "plans", "None in place of plans for 3 UAVs (/"),
    (kind("Bare", plan=lambda *given: [p.controls for p in Good.plan(*given)]), "plans", BARE),
    (kind("Spatial", one=always(lambda: [[0.0] * 3] * 2)), "plans", "plan 0: controls of shape (2, 3), not (H, 2)"),
    (kind("Presuming", one=lambda *given: Plan(np.zeros((1, 2)), {9: [[np.nan, 0]]})), "plans", "0: others[9] are not"),
    (kind("Endless", one=always(lambda: [[0, 1], [np.nan, 0]])), "finite", "the plan of UAV 0 is not finite"),
    (kind("Fast", one=always(lambda: [[4, 0]])), "speed limit", "the plan of UAV 2 reaches 4 m/s; 3 m/s is what"),
    (Writing, "inputs untouched", "team[0].tracks[3].belief.mean is changed"),
    (Sorting, "inputs untouched", "team[0].own.id is changed"),
    (kind("Noting", one=noted), "inputs untouched", "team[0].intents is changed"),
    (kind("Irreproducible", one=with_rng(lambda: None)), "same seed, same plan", "of another instance, plans differ"),
    (kind("Guessing", one=expecting(random.SystemRandom().random)), "same seed, same plan", OTHERS),
    (kind("Expecting", one=expecting(lambda: hash("some string") % 2**32 / 2**32)), "other process", OTHERS),
    (kind("Hashing", one=with_rng(lambda: hash("some string") % 2**32)), "other process", HASHES),
    (kind("Legacy", one=always(lambda: [[np.random.uniform(-1, 1), 0]])), CHANCE, f"{GLOBAL} of numpy.random"),  # noqa: NPY002
    (kind("Random", one=always(lambda: [[random.uniform(-1, 1), 0]])), CHANCE, f"{GLOBAL} of random"),
    (Counting, "memory", "; a memory needs stateful = True and reset(seed)"),
    (Buffering, "memory", "a later decision changes plans that were returned before"),
    (Amending, "memory", "a later decision changes plans that were returned before"),
    (Fading, "memory", "no Plan but of type NoneType"),
    (Clinging, "memory", "with the same seed and calls, plans differ by"),
    (kind("Leaking", one=leaking), "nothing from the unheard", "others' tracks change the plan of UAV 0 by"),
    (Gossip, "nothing from the unheard", "UAV 0 is out of contact, but others' tracks change the plan of UAV 0"),
    (kind("Unpicklable", __init__=lambda self: setattr(self, "speed", lambda: 1.0)), "pickling", "pickle"),
    (Forgetful, "pickling", "of a pickled copy, plans differ by"),
    (Eavesdropping, "only plans from others", "UAV 0's plan says nothing, but its tracks change the plan of UAV 2"),
    (Deaf, "only plans from others", "UAV 0's plan is lost, but its tracks change the plan of UAV"),
    (Nosy, "only plans from others", "UAV 0's plan says nothing, but its people not found change the plan of UAV"),
    (Telepathic, "nothing from the unheard", "UAV 1 is out of contact, but others' tracks change the plan of UAV 1"),
    (kind("Pair", one=lambda self, s, rng, team: Good.one(self, s, rng, [team[1]])), "one UAV", "IndexError"),
    (kind("Needy", one=nearest), "no tracks", "ValueError"),
    (kind("Wooden", one=first_tree), "no trees", "plan 0: controls of shape (0, 2)"),
    (kind("Placing", one=lambda self, s, *given: Good.one(self, given[-1][s.own.id], *given)), DOWN, "IndexError"),
    (kind("Sociable", one=first_neighbour), "out of contact", "IndexError"),
    (kind("Hasty", one=last_intent), "first decision", "ValueError"),
    (kind("Small", one=twenty_speeds), "fifty tracks", "could not broadcast"),
]


@pytest.mark.parametrize(("planner", "name", "seen"), BROKEN, ids=[planner.__name__ for planner, _, _ in BROKEN])
def test_a_broken_planner_fails_the_check_that_fits_and_no_other(planner, name, seen):
    found = failed(planner, other_process=name == "other process")
    assert list(found) == [name] and seen in found[name] and "\n" not in found[name]


@pytest.mark.parametrize("planner", [Good, Sequence, Recurrent])
def test_a_good_planner_passes_all(planner):
    assert {finding.passed for finding in check(planner, other_process=planner is Good)} == {True}


@pytest.mark.parametrize(
    ("planner", "name"), [(Centre, "nothing from the unheard"), (WorstFirst, "only plans from others")]
)
def test_a_planner_that_compares_beliefs_cannot_claim_to_be_decentralised(planner, name):
    with pytest.raises(Unfit):
        CHECKS[name](Subject(planner, planner))


def test_without_plans_nothing_is_tried_and_broken_kinds_cover_every_check():
    findings = check(Raising)
    assert [f.passed for f in findings] == [False] + [None] * (len(CHECKS) - 1)
    assert {f.seen for f in findings[1:]} == {"not tried: it does not plan"}
    assert {name for _, name, _ in BROKEN} == set(CHECKS) - {"time"}
    with pytest.raises(InputError, match="did you mean hover"):
        check("hoover")
    with pytest.raises(InputError, match="is an object; expected text, or a class or function that makes one"):
        check(Good())


def test_what_makes_no_planner_is_refused_in_one_line():
    for maker, text in (
        (kind("Heavy", __init__=lambda self: {}["weights"]), "planner: 'Heavy' cannot be made: KeyError: 'weights'"),
        (type("Planless", (), {}), "planner: 'Planless' has no method plan(team, rng)"),
        (type("Narrow", (), {"plan": lambda self, team: []}), "planner: plan of 'Narrow' takes (team); it must take"),
    ):
        with pytest.raises(InputError, match=f"^{re.escape(text)}"):
            check(maker)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({}, "planner: 'Odd' cannot say what it remembers: it is stateful, but has no method reset(seed)"),
        ({"reset": 3}, "planner: 'Odd' cannot say what it remembers: it is stateful, but has no method reset(seed)"),
        ({"reset": lambda self, seed: {}[seed]}, "planner: 'Odd' cannot be reset: KeyError: 5"),
    ],
)
def test_a_memory_that_cannot_be_reset_is_refused_in_one_line(changed, text):
    with pytest.raises(InputError) as refused:
        check(type("Odd", (Good,), {"stateful": True, **changed}))
    assert str(refused.value).startswith(text) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("exchange", "planner: 'Odd' cannot say what it sends: KeyError: 'gone'"),
        ("decentralised", "planner: 'Odd' cannot say whether it is decentralised: KeyError: 'gone'"),
        ("stateful", "planner: 'Odd' cannot say what it remembers: KeyError: 'gone'"),
    ],
)
def test_a_planner_that_cannot_be_asked_is_refused_in_one_line(name, text):
    def gone(self):
        raise KeyError("gone")

    with pytest.raises(InputError) as refused:
        check(type("Odd", (Good,), {name: property(gone)}))
    assert str(refused.value).startswith(text) and "\n" not in str(refused.value)


def test_global_random_numbers_are_left_as_they_were():
    random.seed(3)
    np.random.seed(3)  # noqa: NPY002
    before = random.random(), np.random.random()  # noqa: NPY002
    random.seed(3)
    np.random.seed(3)  # noqa: NPY002
    for planner in (kind for kind, name, _ in BROKEN if name == CHANCE):
        check(planner, other_process=False)
    assert (random.random(), np.random.random()) == before  # noqa: NPY002
