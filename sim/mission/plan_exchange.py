"""Radio links between UAVs, the exchange of plans over them, and the knowledge of each UAV about the others."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from typing import NamedTuple

import numpy as np

from planning.planner import Exchange, Plan, Situation, Vehicle
from planning.prediction.response import vehicle_after
from sim.scenario.fleet import Link, Network
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.distances import length


class Links(NamedTuple):
    """Links between UAVs in one scan."""

    up: Flags  # (n, n) True where the row's UAV receives from the column's, unless the message is lost
    lost: Flags | None  # (L, n, n) lost messages of consensus per round; None if the network loses none

    @property
    def contact(self) -> Flags:
        """Pairs (n, n) with at least one received message of consensus in this scan."""
        if self.lost is None or len(self.lost) == 0:
            return self.up
        return np.asarray(self.up & ~np.all(self.lost, axis=0))


def open_links(network: Network, time: float, positions: Array) -> Flags:
    """Adjacency (n, n) of UAVs at positions (n, 3) m: within range, with a link that exists and is not cut."""
    gap = length(positions[:, None] - positions[None])
    heard = np.asarray((gap <= network.range) & ~np.eye(len(gap), dtype=np.bool_))
    if network.links:
        heard &= _adjacency(network.links, len(gap))
    for cut in network.cuts:
        if cut.start <= time and (cut.end is None or time < cut.end):
            heard &= ~_adjacency(cut.links, len(gap))
    return heard


def lost_messages(network: Network, uavs: int, rng: np.random.Generator) -> Flags | None:
    """Mask (L, n, n) of one scan's lost messages, by round, receiver and sender; None if the network loses none.

    The random numbers do not depend on the probability: with a higher one the same messages are lost, and more.
    """
    if network.loss == 0.0:
        return None
    return rng.random((network.rounds, uavs, uavs)) < network.loss


def _adjacency(links: Sequence[Link], uavs: int) -> Flags:
    table = np.zeros((uavs, uavs), dtype=np.bool_)
    ends = np.array(links)
    table[ends[:, 0], ends[:, 1]] = table[ends[:, 1], ends[:, 0]] = True
    return table


_NOTHING = Plan(np.zeros((0, 2)))


class _Known(NamedTuple):
    """Knowledge of one UAV about another."""

    vehicle: Vehicle
    plan: Plan  # as of the last decision


class PlanExchange:
    """Knowledge of each UAV about each other one: position, velocity and last known plan.

    Plans are sent over the links at the time of the decision and are not forwarded; each message is lost with the
    network's probability. Positions and velocities of UAVs in contact (`Links.contact`) are known. A UAV out of contact
    is predicted by its last known plan and its lag, and forgotten once that plan has ended. A plan that is not renewed
    is shifted by one control per decision.
    """

    def __init__(self, network: Network, exchange: Exchange, rng: np.random.Generator) -> None:
        self._loss, self._exchange, self._rng = network.loss, exchange, rng
        self.own: dict[int, Plan] = {}  # the last plan of each UAV
        self._known: dict[tuple[int, int], _Known] = {}  # by receiver and sender
        self._fleet: Sequence[Vehicle] = ()
        self._contact = self._up = np.zeros((0, 0), dtype=np.bool_)
        self._received: list[Flags] = []  # (n, n) for each round, True where the plan of a column's UAV reaches a row's

    def begin(self, fleet: Sequence[Vehicle], links: Links, working: Sequence[int], step: float) -> None:
        """Start an instant of planning, `step` s after the last; those that do not work are forgotten."""
        works = np.isin(np.arange(len(fleet)), working)
        both = works[:, None] & works
        self._fleet, self._up, self._contact = fleet, links.up & both, links.contact & both
        self.own = {i: plan for i, plan in self.own.items() if works[i]}
        before = self._known
        self._known = {  # UAVs out of contact are assumed to have flown as planned
            pair: _Known(vehicle_after(known.vehicle, known.plan.controls[0], step), known.plan)
            for pair, known in before.items()
            if both[pair] and not self._contact[pair] and len(known.plan.controls) > 1
        }
        for i, j in np.argwhere(self._contact).tolist():
            self._known[i, j] = _Known(fleet[j], before[i, j].plan if (i, j) in before else _NOTHING)
        self._received = self._receptions()

    def _receptions(self) -> list[Flags]:
        rounds, n = self._exchange.rounds, len(self._fleet)
        if self._loss == 0.0 or self._exchange.centre:
            return [self._up] * rounds
        return [self._up & (draw >= self._loss) for draw in self._rng.random((rounds, n, n))]

    def informed(self, situation: Situation) -> Situation:
        """A UAV's situation, completed with its knowledge of the other UAVs."""
        own = situation.own.id
        known = {j: self._known[i, j] for i, j in sorted(self._known) if i == own}
        plans = {j: k.plan for j, k in known.items() if len(k.plan.controls)}
        if own in self.own:
            plans[own] = self.own[own]
        return replace(
            situation,
            neighbours=tuple(k.vehicle for k in known.values()),
            intents={j: plans[j] for j in sorted(plans)},
            reception=tuple(tuple(np.flatnonzero(received[own]).tolist()) for received in self._received),
        )

    def end(self, plans: Mapping[int, Plan]) -> Indices:
        """Send the plan of each working UAV to the UAVs that it reaches; return the bytes (n,) that each UAV sent."""
        self.own = dict(plans)
        reached = np.zeros_like(self._up) if self._exchange.centre or not self._received else self._received[-1]
        for i, j in permutations(plans, 2):
            known = self._known.get((i, j))
            if reached[i, j]:
                self._known[i, j] = _Known(self._fleet[j], Plan(plans[j].controls))
            elif self._contact[i, j] and j in plans[i].others:
                self._known[i, j] = _Known(self._fleet[j], Plan(plans[i].others[j]))
            elif known:
                self._known[i, j] = known._replace(plan=Plan(known.plan.controls[1:]))
        return self._sent(plans)

    def _sent(self, plans: Mapping[int, Plan]) -> Indices:
        sent = np.zeros(len(self._fleet), dtype=np.int64)
        if self._exchange.centre:
            first, *others = plans
            for i in others:
                sent[first] += self._exchange.rounds * plans[i].size
            return sent
        for i, plan in plans.items():
            if self._up[:, i].any():
                sent[i] = self._exchange.rounds * plan.size
        return sent
