"""Does a planner keep the contract of `planning.planner.Planner`? Tried on synthetic situations, without an engine."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from statistics import median

from planning.conformance.calls import Attempt, attempt, attempt_elsewhere, difference
from planning.conformance.situations import KNOWLEDGE, among, apart, held, lost, ordinary_team, otherwise
from planning.planner import Planner, Situation, exchange_of
from planning.registry import load_planner
from tracking.geometry.visibility import Forest

Maker = Callable[[], Planner]

_DECISIONS = 5  # that are timed
_ROUNDING = 1e-9  # m/s, by which a plan may depend on what should not matter
_MARKS = {True: "passed", False: "FAILED", None: "-"}


@dataclass(frozen=True)
class Finding:
    """What one check came to."""

    check: str
    passed: bool | None  # None: not tried
    seen: str

    def __str__(self) -> str:
        """One line."""
        return f"{_MARKS[self.passed]:<8}{self.check:<26}{self.seen}"


class _Unfit(Exception):
    """A planner does not do what a check asks for."""


class _Untried(Exception):
    """A check could say nothing."""


def check(planner: str | Maker, *, other_process: bool = True) -> list[Finding]:
    """What each check of a planner came to; it conforms if no finding has `passed` False.

    planner: text as `planning.registry.load_planner` takes it, or a class or function that makes one.
    `other_process`: whether to plan in another process too, which takes seconds. PlannerError where the text names
    no planner. What goes wrong in general is found once, and not again in each special situation.
    """
    subject = _Subject(partial(load_planner, planner) if isinstance(planner, str) else planner, planner)
    skipped = () if other_process else ("other process",)
    return [_tried(name, ask, subject) for name, ask in CHECKS.items() if name not in skipped]


def _tried(name: str, ask: Callable[[_Subject], str], subject: _Subject) -> Finding:
    try:
        return Finding(name, True, ask(subject))
    except _Unfit as error:
        return Finding(name, False, str(error))
    except _Untried as error:
        return Finding(name, None, f"not tried: {error}")


class _Subject:
    """A planner under test: how to make it anew, and what it makes of the ordinary situation."""

    def __init__(self, make: Maker, named: object) -> None:
        self.make, self.text = make, named if isinstance(named, str) else None
        self.team = ordinary_team()
        planner = make()
        self.claims = bool(getattr(planner, "decentralised", False))
        self.rounds = exchange_of(planner).rounds
        self.first = attempt(planner, self.team, watched=True)

    @cached_property
    def repeats(self) -> str:
        """How plans of another instance differ, with the same seed; empty: they do not."""
        return _differ(self.first, attempt(self.make(), self.team))

    def planned(self) -> Attempt:
        """The first plans, if there are any."""
        if "plans" in self.first.defects:
            raise _Untried("it does not plan")
        return self.first

    def compare(self, other: Attempt, when: str, within: float = 0.0) -> None:
        """Unfit unless plans equal the first ones, within so many m/s."""
        difference = _differ(self.planned(), other, within)
        if difference:
            raise _Unfit(f"{when}, {difference}")

    def comparable(self) -> None:
        """Untried where plans are not to be compared because they never repeat."""
        self.planned()
        if self.repeats:
            raise _Untried("its plans do not repeat anyway")


def _differ(first: Attempt, other: Attempt, within: float = 0.0) -> str:
    if other.defects != first.defects:
        return next((text for kind, text in other.defects.items() if kind not in first.defects), "plans differ")
    gap = max(map(difference, first.controls, other.controls), default=0.0)
    return f"plans differ by {gap:.3g} m/s" if gap > within else ""


def _plans(subject: _Subject) -> str:
    first = subject.first
    if "plans" in first.defects:
        raise _Unfit(first.defects["plans"])
    steps = " or ".join(str(h) for h in sorted({len(c) for c in first.controls}))
    return f"one (H, 2) for each UAV, H = {steps}"


def _finite(subject: _Subject) -> str:
    defects = subject.planned().defects
    if "finite" in defects:
        raise _Unfit(defects["finite"])
    return "all numbers are"


def _speed(subject: _Subject) -> str:
    defects = subject.planned().defects
    if "speed" in defects:
        raise _Unfit(defects["speed"])
    return "top speeds of " + ", ".join(f"{s.own.max_speed:g}" for s in subject.team) + " m/s are kept"


def _inputs(subject: _Subject) -> str:
    if subject.planned().touched:
        raise _Unfit(subject.first.touched)
    return "the situations are as they were"


def _special(team: Sequence[Situation], subject: _Subject) -> str:
    """Nothing may be wrong here that is not wrong in general."""
    general = subject.planned().defects
    tried = attempt(subject.make(), team)
    for kind, text in tried.defects.items():
        if kind not in general:
            raise _Unfit(text)
    return f"planned in {1e3 * tried.seconds:.3g} ms"


def _repeatable(subject: _Subject) -> str:
    subject.planned()
    if subject.repeats:
        raise _Unfit(f"of another instance, {subject.repeats}")
    return "equal bit for bit, on another instance"


def _other_process(subject: _Subject) -> str:
    subject.comparable()
    try:
        sent = subject.text or pickle.dumps(subject.make())
    except Exception as error:  # a stranger's code may raise anything
        raise _Untried("it cannot be pickled") from error
    # Arrays lie elsewhere in memory there, and sums of linear algebra may round otherwise for that.
    subject.compare(attempt_elsewhere(sent, subject.team), "in a process with other hashes of strings", _ROUNDING)
    return "equal but for rounding, with other hashes of strings"


def _chance(subject: _Subject) -> str:
    subject.comparable()
    drew = attempt(subject.make(), subject.team, world=1)
    if drew.drew:
        raise _Unfit(f"uses the global random numbers of {drew.drew}")
    subject.compare(drew, "with other global random numbers")
    return "global random numbers play no part"


def _memory(subject: _Subject) -> str:
    subject.comparable()
    planner = subject.make()
    before = attempt(planner, subject.team)
    attempt(planner, ordinary_team(1))
    if before.altered:
        raise _Unfit("a later decision changes plans that were returned before")
    subject.compare(attempt(planner, subject.team), "after another situation")
    return "a situation, another one, the first again: equal"


def _pickling(subject: _Subject) -> str:
    subject.comparable()
    planner = subject.make()
    attempt(planner, subject.team)
    try:
        data = pickle.dumps(planner)
        copy = pickle.loads(data)
    except Exception as error:  # a stranger's code may raise anything
        raise _Unfit(f"{type(error).__name__}: {error}") from error
    found = _differ(attempt(planner, subject.team), attempt(copy, subject.team))
    if found:
        raise _Unfit(f"of a pickled copy, {found}")
    return f"a copy of {len(data)} bytes plans the same"


def _unheard(subject: _Subject) -> str:
    _claimed(subject)
    if "plans" in attempt(subject.make(), SITUATIONS["nobody in hearing"]).defects:
        raise _Untried("it does not plan where nobody is in hearing")
    for s in subject.team:
        others = [o.own.id for o in subject.team if o is not s]
        found = _influence(subject, apart(subject.team, s.own.id), others, [s.own.id])
        if found:
            raise _Unfit(f"UAV {s.own.id} hears nobody, but others' {found}")
    return "whoever hears nobody plans the same whatever others hold"


def _heard(subject: _Subject) -> str:
    _claimed(subject)
    for s in subject.team:
        others, uav = [o.own.id for o in subject.team if o is not s], s.own.id
        silent = {"says nothing": held(subject.team, uav), "is lost": lost(subject.team, uav, subject.rounds)}
        for how, team in silent.items():
            found = _influence(subject, team, [uav], others)
            if found:
                raise _Unfit(f"UAV {uav}'s plan {how}, but its {found}")
    return "what a UAV holds reaches others through its plan alone"


def _claimed(subject: _Subject) -> None:
    subject.comparable()
    if not subject.claims:
        raise _Untried("it does not claim to be decentralised")


def _influence(subject: _Subject, team: Sequence[Situation], changed: Sequence[int], kept: Sequence[int]) -> str:
    """What UAVs `changed` hold that has an influence on the plans of UAVs `kept`."""
    base = _proper(subject, team)

    def influence(kinds: Sequence[str]) -> str:
        tried = _proper(subject, otherwise(team, changed, kinds))
        gaps = {s.own.id: gap for s, gap in zip(team, map(difference, base.controls, tried.controls), strict=True)}
        worst = max(kept, key=gaps.__getitem__)
        what = f"{', '.join(kinds)} change the plan of UAV {worst} by {gaps[worst]:.3g} m/s"
        return what if gaps[worst] > _ROUNDING else ""

    together = influence(KNOWLEDGE)
    return together and next(filter(None, (influence((kind,)) for kind in KNOWLEDGE)), together)


def _proper(subject: _Subject, team: Sequence[Situation]) -> Attempt:
    """Plans of a situation that only the claim makes special."""
    tried = attempt(subject.make(), team)
    if "plans" in tried.defects:
        raise _Unfit(tried.defects["plans"])
    return tried


def _time(subject: _Subject) -> str:
    subject.planned()
    planner, team = subject.make(), subject.team
    attempt(planner, team)
    took = [attempt(planner, team).seconds for _ in range(_DECISIONS)]
    late = "; longer than a step of its plan" if median(took) > team[0].step else ""
    scene = f"{len(team)} UAVs, {len(team[0].tracks)} tracks, {len(team[0].forest.trees)} trees"
    return f"{1e3 * median(took):.3g} ms a decision, at most {1e3 * max(took):.3g} ms ({scene}){late}"


def _situations() -> dict[str, list[Situation]]:
    """What a planner has to cope with, and a mission may bring."""
    team = ordinary_team()
    return {
        "one UAV": among(team, {0}),
        "no tracks": [replace(s, tracks=()) for s in team],
        "no trees": [replace(s, forest=Forest(())) for s in team],
        "a UAV broken down": among(team, {0, 2}),  # ids are not places
        "nobody in hearing": [apart(team, s.own.id)[k] for k, s in enumerate(team)],
        "first decision": [replace(s, time=0.0, intents={}) for s in team],
        "fifty tracks": ordinary_team(targets=50),
    }


SITUATIONS = _situations()
CHECKS: dict[str, Callable[[_Subject], str]] = {
    "plans": _plans,
    "finite": _finite,
    "speed limit": _speed,
    "inputs untouched": _inputs,
    "same seed, same plan": _repeatable,
    "other process": _other_process,
    "chance only from rng": _chance,
    "no memory": _memory,
    "pickling": _pickling,
    "nothing from the unheard": _unheard,
    "only plans from others": _heard,
    **{name: partial(_special, team) for name, team in SITUATIONS.items()},
    "time": _time,
}
