"""Checks of a planner's claim to be decentralised: UAVs use nothing of each other but plans that they receive."""

from collections.abc import Sequence

from planning.conformance.calls import attempt, difference
from planning.conformance.perturbations import (
    KNOWLEDGE,
    SITUATIONS,
    immobilised,
    out_of_contact,
    plan_not_received,
    with_other_knowledge,
)
from planning.conformance.subject import ROUNDING, Subject, proper_plans
from planning.planner import Situation
from tracking.plugins.findings import Unfit, Untried


def check_independence(subject: Subject) -> str:
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


def check_exchange(subject: Subject) -> str:
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

    together = influence(KNOWLEDGE)
    return together and next(filter(None, (influence((kind,)) for kind in KNOWLEDGE)), together)
