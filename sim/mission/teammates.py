"""What each UAV knows about its teammates, and the sending of plans over the radio."""

from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from planning.planner import Exchange, Plan, Vehicle
from planning.prediction.response import vehicle_after
from sim.mission.radio import Inbox, RadioLinks, draw_jitter
from sim.mission.scan_relay import ScanRelay
from sim.scenario.uavs import Network
from tracking.numerics.arrays import Flags, Indices

_NO_PLAN = Plan(np.zeros((0, 2)))


class _Teammate(NamedTuple):
    """What one UAV knows about another."""

    vehicle: Vehicle
    plan: Plan  # as of the last decision


class Teammates:
    """What each UAV knows about each other one: position, velocity and last known plan.

    UAVs send their plans over the links at the time of the decision and do not forward them. The network loses each
    message with its probability. A UAV knows position and velocity of those in contact (`RadioLinks.contact`). It
    predicts the others by their last known plan and their lag, and drops them once that plan has ended. A plan that is
    not renewed is shifted by one control per decision.
    """

    def __init__(self, network: Network, exchange: Exchange, rng: np.random.Generator) -> None:
        """Begin without knowledge; `exchange` says how plans are sent, and `rng` decides which of them are lost."""
        self._loss = network.loss
        self._exchange = exchange
        self._rng = rng
        self.own: dict[int, Plan] = {}  # the last plan of each UAV
        self._known: dict[tuple[int, int], _Teammate] = {}  # by receiver and sender
        self._fleet: Sequence[Vehicle] = ()
        self._contact = np.zeros((0, 0), dtype=np.bool_)
        self._up = np.zeros((0, 0), dtype=np.bool_)
        self._received: list[Flags] = []  # (n, n) for each round, True where the plan of a column's UAV reaches a row's

    def update(
        self, time: float, fleet: Sequence[Vehicle], links: RadioLinks, working: Sequence[int], step: float
    ) -> None:
        """Go on to the next decision, `step` s after the last: drop failed UAVs, and predict those out of contact."""
        works = np.zeros(len(fleet), dtype=np.bool_)
        works[list(working)] = True
        both = works[:, None] & works
        self._fleet = fleet
        self._up = links.up & both
        self._contact = links.contact & both
        self.own = {i: plan for i, plan in self.own.items() if works[i]}
        before = self._known
        self._known = {  # UAVs out of contact are assumed to have flown as planned
            pair: _Teammate(vehicle_after(known.vehicle, known.plan.controls[0], step), known.plan)
            for pair, known in before.items()
            if both[pair] and not self._contact[pair] and len(known.plan.controls) > 1
        }
        for i, j in np.argwhere(self._contact).tolist():
            self._known[i, j] = _Teammate(fleet[j], before[i, j].plan if (i, j) in before else _NO_PLAN)
        self._received = self._draw_receptions()

    def _draw_receptions(self) -> list[Flags]:
        rounds = self._exchange.rounds
        n = len(self._fleet)
        if self._loss == 0.0 or self._exchange.centre:
            return [self._up] * rounds
        return [self._up & (draw >= self._loss) for draw in self._rng.random((rounds, n, n))]

    def tell(self, own: int) -> dict[str, Any]:
        """Fields of a UAV's situation: what it knows about the others, known plans, and which plans will reach it."""
        known = {j: self._known[i, j] for i, j in sorted(self._known) if i == own}
        plans = {j: k.plan for j, k in known.items() if len(k.plan.controls)}
        if own in self.own:
            plans[own] = self.own[own]
        return {
            "neighbours": tuple(k.vehicle for k in known.values()),
            "intents": {j: plans[j] for j in sorted(plans)},
            "reception": tuple(tuple(np.flatnonzero(received[own]).tolist()) for received in self._received),
        }

    def send(self, plans: Mapping[int, Plan]) -> Indices:
        """Send the plan of each working UAV to the UAVs that it reaches; return the bytes (n,) that each UAV sent."""
        self.own = dict(plans)
        reached = np.zeros_like(self._up) if self._exchange.centre or not self._received else self._received[-1]
        for i, j in permutations(plans, 2):
            known = self._known.get((i, j))
            if reached[i, j]:
                self._known[i, j] = _Teammate(self._fleet[j], Plan(plans[j].controls))
            elif self._contact[i, j] and j in plans[i].others:
                self._known[i, j] = _Teammate(self._fleet[j], Plan(plans[i].others[j]))
            elif known:
                self._known[i, j] = known._replace(plan=known.plan.after(1))
        return self._count_bytes(plans)

    def _count_bytes(self, plans: Mapping[int, Plan]) -> Indices:
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


class _Report(NamedTuple):
    """The message of a UAV to the others at a decision."""

    time: float  # s
    vehicle: Vehicle
    plan: Plan  # empty if the planner sends none


class LateTeammates(Teammates):
    """The same in a network that takes time.

    At each decision each UAV sends one message with its position, velocity and plan, if the planner sends plans. No UAV
    receives a plan of this instant. A UAV knows from each other one the latest message that has arrived. It predicts
    the sender to the present by that plan, or without one at the velocity of then for `network.hold`.
    Note: with `Exchange.centre` plans arrive at once; their bytes keep other messages waiting.
    """

    def __init__(self, network: Network, exchange: Exchange, rng: np.random.Generator, relay: ScanRelay) -> None:
        super().__init__(network, exchange, rng)
        self._network = network
        self._relay = relay
        self._inboxes = [Inbox[_Report]() for _ in relay.senders]
        self._heard: dict[tuple[int, int], _Report] = {}  # latest message, by receiver and sender
        self._time = 0.0  # s

    def update(
        self, time: float, fleet: Sequence[Vehicle], links: RadioLinks, working: Sequence[int], step: float
    ) -> None:
        """As `Teammates.update`; takes in what has arrived."""
        self._time = time
        self._fleet = fleet
        works = np.zeros(len(fleet), dtype=np.bool_)
        works[list(working)] = True
        self._up = links.up & works[:, None] & works
        self._contact = np.zeros_like(self._up)
        self._received = [self._up if self._exchange.centre else self._contact] * self._exchange.rounds
        self.own = {i: plan for i, plan in self.own.items() if works[i]}
        for i in working:
            for report in self._inboxes[i].take(time):
                pair = i, report.vehicle.id
                if pair not in self._heard or self._heard[pair].time < report.time:
                    self._heard[pair] = report
        expected, self._known = self._known, {}
        for pair, report in self._heard.items():
            steps, plan = round((time - report.time) / step), report.plan.controls
            if works[list(pair)].all() and (steps <= len(plan) or time - report.time <= self._network.longest_wait):
                vehicle = report.vehicle
                for n in range(steps):
                    vehicle = vehicle_after(vehicle, plan[n] if n < len(plan) else vehicle.velocity, step)
                told = expected[pair].plan if pair in expected and not len(plan) else report.plan.after(steps - 1)
                self._known[pair] = _Teammate(vehicle, told)

    def send(self, plans: Mapping[int, Plan]) -> Indices:
        """As `Teammates.send`."""
        self.own = dict(plans)
        n = len(self._up)
        silent = not self._exchange.rounds or self._exchange.centre
        arrives = self._up & (self._rng.random((n, n)) >= self._network.loss) if self._network.loss else self._up
        jitter = draw_jitter(self._network, n, self._rng)
        sent = self._count_bytes(plans) if self._exchange.centre else np.zeros(n, dtype=np.int64)
        for i, plan in plans.items():
            for j in [j for j in plan.others if (i, j) in self._known]:
                self._known[i, j] = self._known[i, j]._replace(plan=Plan(plan.others[j]))
            report = _Report(self._time, self._fleet[i], _NO_PLAN if silent else Plan(plan.controls))
            sent[i] += report.plan.size * bool(self._up[:, i].any())
            done = self._relay.transmit(i, self._time, int(sent[i]))
            if done is None:
                sent[i] = 0
                continue
            for j in np.flatnonzero(arrives[:, i]).tolist():
                late = 0.0 if jitter is None else float(jitter[j, i])
                self._inboxes[j].put(done + self._network.delay + late, report)
        return sent


def make_teammates(network: Network, exchange: Exchange, rng: np.random.Generator, relay: ScanRelay) -> Teammates:
    """What UAVs know about their teammates in a network; plans are sent by the transmitters of the scans' `relay`."""
    return LateTeammates(network, exchange, rng, relay) if network.takes_time else Teammates(network, exchange, rng)
