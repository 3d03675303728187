"""Changed copies of a team: fewer UAVs, lost contact, lost plans, other knowledge."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from planning.conformance.situations import displaced, ordinary_team
from planning.planner import Plan, Situation, Vehicle
from tracking.geometry.visibility import Forest

_ASIDE = np.array([2.0, -1.0, 0.0])  # m
# Kinds of knowledge, and how each is changed.
KNOWLEDGE: dict[str, Callable[[Situation], Situation]] = {
    "tracks": lambda s: replace(s, tracks=tuple(displaced(t, np.array([3.0, -2.0, 0.5, 0.3]), 4.0) for t in s.tracks)),
    "received intents": lambda s: replace(s, intents={i: Plan(-plan.controls) for i, plan in s.intents.items()}),
    "own measured position": lambda s: replace(s, own=replace(s.own, position=s.own.position + _ASIDE)),
    "neighbours' positions": lambda s: replace(
        s, neighbours=tuple(replace(v, position=v.position - _ASIDE) for v in s.neighbours)
    ),
    "people not found": lambda s: replace(
        s, unseen=s.unseen and replace(s.unseen, people=s.unseen.people[::-1].copy())
    ),
}


def subteam(team: Sequence[Situation], ids: Collection[int]) -> list[Situation]:
    """The team if only UAVs `ids` work."""
    return [_in_contact(s, ids) for s in team if s.own.id in ids]


def out_of_contact(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team if one UAV has no contact to the others."""
    ids = {s.own.id for s in team}
    return [_in_contact(s, {uav} if s.own.id == uav else ids - {uav}) for s in team]


def immobilised(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team if one UAV can hardly move, so that its plan reveals nothing of its knowledge.

    Its top speed is 1e-20 m/s: not zero, by which planners may divide, but too little to change a position.
    """

    def slow(vehicle: Vehicle) -> Vehicle:
        return replace(vehicle, max_speed=1e-20) if vehicle.id == uav else vehicle

    return [
        replace(
            s,
            own=slow(s.own),
            neighbours=tuple(slow(v) for v in s.neighbours),
            intents={i: plan for i, plan in s.intents.items() if i != uav},
        )
        for s in team
    ]


def plan_not_received(team: Sequence[Situation], uav: int, rounds: int) -> list[Situation]:
    """The team if no other UAV receives the plan of one UAV in any round; positions and last plans are known."""
    heard = {s.own.id: tuple(v.id for v in s.neighbours if v.id != uav) for s in team}
    return [replace(s, reception=(heard[s.own.id],) * max(rounds, 1)) for s in team]


def with_other_knowledge(team: Sequence[Situation], uavs: Collection[int], kinds: Collection[str]) -> list[Situation]:
    """The team if UAVs `uavs` have other knowledge of some kinds of `KNOWLEDGE`; as many tracks as before."""
    changes = [KNOWLEDGE[kind] for kind in kinds]
    return [reduce(lambda known, change: change(known), changes, s) if s.own.id in uavs else s for s in team]


def _in_contact(s: Situation, ids: Collection[int]) -> Situation:
    return replace(
        s,
        neighbours=tuple(v for v in s.neighbours if v.id in ids),
        intents={i: plan for i, plan in s.intents.items() if i in ids},
    )


def _situations() -> dict[str, list[Situation]]:
    team = ordinary_team()
    return {
        "one UAV": subteam(team, {0}),
        "no tracks": [replace(s, tracks=()) for s in team],
        "no trees": [replace(s, forest=Forest(())) for s in team],
        "a UAV broken down": subteam(team, {0, 2}),  # ids are not places
        "out of contact": [out_of_contact(team, s.own.id)[k] for k, s in enumerate(team)],
        "first decision": [replace(s, time=0.0, intents={}) for s in team],
        "fifty tracks": ordinary_team(targets=50),
    }


SITUATIONS = _situations()
