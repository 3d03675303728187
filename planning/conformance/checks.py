"""Conformance of a planner to `planning.planner.Planner`, checked on synthetic situations, without an engine."""

import pickle
from collections.abc import Callable, Sequence
from functools import partial
from statistics import median

from planning.conformance.calls import attempt, attempt_in_other_process, difference
from planning.conformance.perturbations import (
    KNOWLEDGE,
    SITUATIONS,
    immobilised,
    out_of_contact,
    plan_not_received,
    with_other_knowledge,
)
from planning.conformance.situations import ordinary_team
from planning.conformance.subject import ROUNDING, Maker, Subject, difference_of_plans, proper_plans
from planning.loading import load_planner
from planning.planner import Situation
from tracking.plugins.findings import Finding, Unfit, Untried, finding

_DECISIONS = 5  # that are timed


def check(planner: str | Maker, *, other_process: bool = True) -> list[Finding]:
    """Findings of all checks of a planner; it conforms if none has `passed` False.

    planner: text as `planning.loading.load_planner` takes it, or a class or function that makes one.
    `other_process`: plan in another process too, which takes seconds. PlannerError if the text names no planner.
    A defect in the ordinary situation is not reported again in each special one.
    """
    subject = Subject(partial(load_planner, planner) if isinstance(planner, str) else planner, planner)
    skipped = () if other_process else ("other process",)
    return [finding(name, partial(ask, subject)) for name, ask in CHECKS.items() if name not in skipped]


def _plans(subject: Subject) -> str:
    first = subject.first
    if "plans" in first.defects:
        raise Unfit(first.defects["plans"])
    steps = " or ".join(str(h) for h in sorted({len(c) for c in first.controls}))
    return f"one (H, 2) for each UAV, H = {steps}"


def _finite(subject: Subject) -> str:
    defects = subject.planned().defects
    if "finite" in defects:
        raise Unfit(defects["finite"])
    return "all numbers are"


def _speed(subject: Subject) -> str:
    defects = subject.planned().defects
    if "speed" in defects:
        raise Unfit(defects["speed"])
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
        sent = subject.text or pickle.dumps(subject.make())
    except Exception as error:  # a plug-in may raise anything
        raise Untried("it cannot be pickled") from error
    # Arrays lie elsewhere in memory there, and sums of linear algebra may round otherwise for that.
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
    subject.comparable()
    planner = subject.make()
    before = attempt(planner, subject.team)
    attempt(planner, ordinary_team(1))
    if before.altered:
        raise Unfit("a later decision changes plans that were returned before")
    subject.compare(attempt(planner, subject.team), "after another situation")
    return "a situation, another one, the first again: equal"


def _pickling(subject: Subject) -> str:
    subject.comparable()
    planner = subject.make()
    attempt(planner, subject.team)
    try:
        data = pickle.dumps(planner)
        copy = pickle.loads(data)
    except Exception as error:  # a plug-in may raise anything
        raise Unfit(f"{type(error).__name__}: {error}") from error
    found = difference_of_plans(attempt(planner, subject.team), attempt(copy, subject.team))
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
            "is lost": plan_not_received(subject.team, uav, subject.rounds),
        }
        for how, team in silent.items():
            found = _influence(subject, team, [uav], others)
            if found:
                raise Unfit(f"UAV {uav}'s plan {how}, but its {found}")
    return "what a UAV holds reaches others through its plan alone"


def _claimed(subject: Subject) -> None:
    subject.comparable()
    if not subject.claims:
        raise Untried("it does not claim to be decentralised")


def _influence(subject: Subject, team: Sequence[Situation], changed: Sequence[int], kept: Sequence[int]) -> str:
    """Knowledge of UAVs `changed` that influences the plans of UAVs `kept`, in words; empty: none."""
    base = proper_plans(subject, team)

    def influence(kinds: Sequence[str]) -> str:
        tried = proper_plans(subject, with_other_knowledge(team, changed, kinds))
        gaps = {s.own.id: gap for s, gap in zip(team, map(difference, base.controls, tried.controls), strict=True)}
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
    "no memory": _memory,
    "pickling": _pickling,
    "nothing from the unheard": _independence,
    "only plans from others": _exchange,
    **{name: partial(_special, team) for name, team in SITUATIONS.items()},
    "time": _time,
}
