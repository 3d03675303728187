"""Conformance of a planner to `planning.planner.Planner`, checked on synthetic situations, without an engine."""

import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from statistics import median

import numpy as np

from planning.conformance.calls import SEED, Attempt, attempt, attempt_in_other_process, differences
from planning.conformance.situations import (
    KNOWLEDGE,
    SITUATIONS,
    immobilised,
    ordinary_team,
    out_of_contact,
    with_other_knowledge,
)
from planning.contract import exchange_of, is_stateful, reset
from planning.loading import ANY_PLANNER, checked_planner, load_planner
from planning.planner import Planner, Situation
from tracking.errors import InputError
from tracking.plugins.findings import Finding, Unfit, Untried, finding
from tracking.plugins.plugin_error import PluginError, plugin_call

_DECISIONS = 5  # number of decisions that are timed
Maker = Callable[[], Planner]
ROUNDING = 1e-9  # m/s; smaller differences of plans count as rounding


class Subject:
    """A planner under test: its maker, and its plans for the ordinary situation."""

    def __init__(self, make: Maker, named: object) -> None:
        self._make, self.text = make, named if isinstance(named, str) else None
        self.team = ordinary_team()
        planner = self.make()
        self.remembers = is_stateful(planner)
        with ANY_PLANNER.errors(type(planner).__qualname__, "say whether it is decentralised"):
            self.claims = bool(getattr(planner, "decentralised", False))
        self.rounds = exchange_of(planner).rounds
        self.first = attempt(planner, self.team, watched=True)

    def make(self) -> Planner:
        """A new planner, reset with a seed if it is stateful."""
        planner = self._make()
        reset(planner, SEED)
        return planner

    @cached_property
    def repeats(self) -> str:
        """Difference of the plans that another instance makes with the same seed, in words; empty if there is none."""
        return _difference_of_plans(self.first, attempt(self.make(), self.team))

    def planned(self) -> Attempt:
        """The first plans; `Untried` if there are none."""
        if "plans" in self.first.defects:
            raise Untried("it does not plan")
        return self.first

    def compare(self, other: Attempt, when: str, within: float = 0.0) -> None:
        """Raise `Unfit` if plans differ from the first ones by more than `within` m/s."""
        difference = _difference_of_plans(self.planned(), other, within)
        if difference:
            raise Unfit(f"{when}, {difference}")

    def comparable(self) -> None:
        """Raise `Untried` if the planner's plans do not repeat, so that no comparison can tell anything."""
        self.planned()
        if self.repeats:
            raise Untried("its plans do not repeat anyway")


def _difference_of_plans(first: Attempt, other: Attempt, within: float = 0.0) -> str:
    """Difference of the plans of two attempts by more than `within` m/s, in words; empty if there is none."""
    if other.defects != first.defects:
        return next((text for kind, text in other.defects.items() if kind not in first.defects), "plans differ")
    gaps = np.array([differences(a, b) for a, b in zip(first.copies, other.copies, strict=False)]).reshape(-1, 2)
    worst = zip(("plans", "others of plans"), gaps.max(axis=0, initial=0.0), strict=True)
    return next((f"{what} differ by {gap:.3g} m/s" for what, gap in worst if gap > within), "")


def _proper_plans(subject: Subject, team: Sequence[Situation]) -> Attempt:
    """Plans for a team, which a stateful planner makes in its second decision; `Unfit` if it does not plan."""
    planner = subject.make()
    if subject.remembers:
        attempt(planner, team)
    tried = attempt(planner, team)
    _check_free(tried, "plans")
    return tried


def _check_free(tried: Attempt, kind: str) -> None:
    """Raise `Unfit` if an attempt has a defect of that kind."""
    if kind in tried.defects:
        raise Unfit(tried.defects[kind])


def check(planner: str | Maker, *, other_process: bool = True) -> list[Finding]:
    """Findings of all checks of a planner, which conforms if no finding has `passed` False.

    planner: text for `planning.loading.load_planner`, or a class or function that makes planners. A planner object
    does not do, because the checks need several. `other_process`: plan in another process, too, which takes seconds.
    A defect in the ordinary situation is not reported again in special ones. InputError if there is no such planner.
    """
    if not isinstance(planner, str) and not callable(planner):
        raise InputError(f"planner: {planner!r} is an object; expected text, or a class or function that makes one")
    make = partial(load_planner, planner) if isinstance(planner, str) else partial(_made, planner)
    subject = Subject(make, planner)
    skipped = () if other_process else ("other process",)
    return [finding(name, partial(ask, subject)) for name, ask in CHECKS.items() if name not in skipped]


def _made(maker: Maker) -> Planner:
    name = getattr(maker, "__qualname__", type(maker).__qualname__)
    with ANY_PLANNER.errors(name, "be made"):
        planner = maker()
    return checked_planner(planner, name)


def _plans(subject: Subject) -> str:
    _check_free(subject.first, "plans")
    steps = " or ".join(str(h) for h in sorted({len(p.controls) for p in subject.first.copies}))
    return f"one (H, 2) for each UAV, H = {steps}"


def _finite(subject: Subject) -> str:
    _check_free(subject.planned(), "finite")
    return "all numbers are"


def _speed(subject: Subject) -> str:
    _check_free(subject.planned(), "speed")
    return "top speeds of " + ", ".join(f"{s.own.max_speed:g}" for s in subject.team) + " m/s are kept"


def _inputs(subject: Subject) -> str:
    if subject.planned().touched:
        raise Unfit(subject.first.touched)
    return "the situations are as they were"


def _special(team: Sequence[Situation], subject: Subject) -> str:
    general = subject.planned().defects
    tried = attempt(subject.make(), team)
    for kind, text in tried.defects.items():
        if kind not in general:
            raise Unfit(text)
    return f"planned in {1e3 * tried.seconds:.3g} ms"


def _repeatable(subject: Subject) -> str:
    subject.planned()
    if subject.repeats:
        raise Unfit(f"of another instance, {subject.repeats}")
    return "equal bit for bit, on another instance"


def _other_process(subject: Subject) -> str:
    subject.comparable()
    try:
        with plugin_call():
            sent = subject.text or pickle.dumps(subject.make())
    except PluginError as error:
        raise Untried("it cannot be pickled") from error
    # Arrays have other addresses in another process, for which linear algebra may round sums differently.
    subject.compare(attempt_in_other_process(sent, subject.team), "in a process with other hashes of strings", ROUNDING)
    return "equal but for rounding, with other hashes of strings"


def _chance(subject: Subject) -> str:
    subject.comparable()
    drew = attempt(subject.make(), subject.team, world=1)
    if drew.drew:
        raise Unfit(f"uses the global random numbers of {drew.drew}")
    subject.compare(drew, "with other global random numbers")
    return "global random numbers play no part"


def _memory(subject: Subject) -> str:
    """Check that a planner has no memory or, if it is stateful, that `reset` clears its memory."""
    subject.comparable()
    planner, calls = subject.make(), (subject.team, ordinary_team(1), subject.team)
    before = [attempt(planner, team) for team in calls]
    if any(each.altered for each in before):
        raise Unfit("a later decision changes plans that were returned before")
    if not subject.remembers:
        found = _difference_of_plans(before[0], before[-1])
        if found:
            raise Unfit(f"after another situation, {found}; a memory needs stateful = True and reset(seed)")
        return "a situation, another one, the first again: equal"
    reset(planner, SEED)
    for k, (first, team) in enumerate(zip(before, calls, strict=True)):
        found = _difference_of_plans(first, attempt(planner, team))
        if found:
            raise Unfit(f"after reset(seed) with the same seed and calls, {found} in call {k + 1}")
    return "stateful: after reset(seed) the same calls give the same plans"


def _pickling(subject: Subject) -> str:
    subject.comparable()
    planner = subject.make()
    attempt(planner, subject.team)
    try:
        with plugin_call():
            data = pickle.dumps(planner)
            copy = pickle.loads(data)
    except PluginError as error:
        raise Unfit(str(error)) from error
    found = _difference_of_plans(attempt(planner, subject.team), attempt(copy, subject.team))
    if found:
        raise Unfit(f"of a pickled copy, {found}")
    return f"a copy of {len(data)} bytes plans the same"


def _independence(subject: Subject) -> str:
    """Check that a UAV out of contact plans the same whatever the others know."""
    _claimed(subject)
    if "plans" in attempt(subject.make(), SITUATIONS["out of contact"]).defects:
        raise Untried("it does not plan out of contact")
    for s in subject.team:
        others = [o.own.id for o in subject.team if o is not s]
        found = _influence(subject, out_of_contact(subject.team, s.own.id), others, [s.own.id])
        if found:
            raise Unfit(f"UAV {s.own.id} is out of contact, but others' {found}")
    return "a UAV out of contact plans the same whatever others hold"


def _exchange(subject: Subject) -> str:
    """Check that knowledge of a UAV reaches the others through its plan alone."""
    _claimed(subject)
    for s in subject.team:
        others, uav = [o.own.id for o in subject.team if o is not s], s.own.id
        silent = {
            "says nothing": immobilised(subject.team, uav),
            "is lost": _plan_not_received(subject, uav),
        }
        for how, team in silent.items():
            found = _influence(subject, team, [uav], others)
            if found:
                raise Unfit(f"UAV {uav}'s plan {how}, but its {found}")
    return "what a UAV holds reaches others through its plan alone"


def _plan_not_received(subject: Subject, uav: int) -> list[Situation]:
    """The team where no other UAV receives one UAV's plan in any round; all positions and last plans are known."""
    heard = {s.own.id: tuple(v.id for v in s.neighbours if v.id != uav) for s in subject.team}
    return [replace(s, reception=(heard[s.own.id],) * max(subject.rounds, 1)) for s in subject.team]


def _claimed(subject: Subject) -> None:
    subject.comparable()
    if not subject.claims:
        raise Untried("it does not claim to be decentralised")


def _influence(subject: Subject, team: Sequence[Situation], changed: Sequence[int], kept: Sequence[int]) -> str:
    """Kind of knowledge of UAVs `changed` that influences plans of UAVs `kept`, in words; empty if there is none."""
    base = _proper_plans(subject, team)

    def influence(kinds: Sequence[str]) -> str:
        tried = _proper_plans(subject, with_other_knowledge(team, changed, kinds))
        gaps = {s.own.id: max(gap) for s, gap in zip(team, map(differences, base.copies, tried.copies), strict=True)}
        worst = max(kept, key=gaps.__getitem__)
        what = f"{', '.join(kinds)} change the plan of UAV {worst} by {gaps[worst]:.3g} m/s"
        return what if gaps[worst] > ROUNDING else ""

    together = influence(list(KNOWLEDGE))
    return together and next(filter(None, (influence((kind,)) for kind in KNOWLEDGE)), together)


def _time(subject: Subject) -> str:
    subject.planned()
    planner, team = subject.make(), subject.team
    attempt(planner, team)
    took = [attempt(planner, team).seconds for _ in range(_DECISIONS)]
    late = "; longer than a step of its plan" if median(took) > team[0].step else ""
    scene = f"{len(team)} UAVs, {len(team[0].tracks)} tracks, {len(team[0].forest.trees)} trees"
    return f"{1e3 * median(took):.3g} ms a decision, at most {1e3 * max(took):.3g} ms ({scene}){late}"


CHECKS: dict[str, Callable[[Subject], str]] = {
    "plans": _plans,
    "finite": _finite,
    "speed limit": _speed,
    "inputs untouched": _inputs,
    "same seed, same plan": _repeatable,
    "other process": _other_process,
    "chance only from rng": _chance,
    "memory": _memory,
    "pickling": _pickling,
    "nothing from the unheard": _independence,
    "only plans from others": _exchange,
    **{name: partial(_special, team) for name, team in SITUATIONS.items()},
    "time": _time,
}
