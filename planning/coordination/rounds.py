"""Sequential assignment in rounds: greedy submodular maximisation over a team, and randomised sequential partitions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planning.coordination.decision import Decider, decide_own_plan
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import expect_plans
from tracking.numerics.arrays import Array


@dataclass(frozen=True)
class SequentialPartitions:
    """Rounds of decisions: the UAVs of a round decide at once, given the plans that they received in earlier rounds.

    A UAV leaves out the UAVs whose plans it does not know, so that it maximises the gain over the plans that it knows.
    With `rounds` of 0 each round has one UAV, in the team's order. If the objective is monotone and submodular and each
    decision is exact, the team reaches at least half of the optimum. Otherwise each UAV draws its round (randomised
    sequential partitions, RSP), and the bound falls by at most half of the redundancy among UAVs of the same round.
    Source: [Fisher78] for the first bound, [Corah18] and [Corah21] for RSP.
    """

    rounds: int = 0
    exchange = Exchange()
    decentralised = True

    def make_plans(self, team: Sequence[Situation], decider: Decider, rng: np.random.Generator) -> list[Plan]:
        """As `planning.coordination.decision.Coordination.make_plans`."""
        drawn = rng.integers(self.rounds, size=len(team)) if self.rounds else np.arange(len(team))
        known: dict[int, dict[int, Array]] = {s.own.id: {} for s in team}  # plans by receiver and sender
        made: dict[int, Array] = {}
        for now in range(int(drawn.max(initial=-1)) + 1):
            deciding = [s for s, own in zip(team, drawn.tolist(), strict=True) if own == now]
            for s in deciding:
                heard = known[s.own.id]
                among = replace(s, neighbours=tuple(v for v in s.neighbours if v.id in heard))
                made[s.own.id] = decide_own_plan(among, expect_plans(among, decider.horizon, heard), decider, rng)
            for sender in deciding:
                for s in team:
                    if s.receives(sender.own.id):
                        known[s.own.id][sender.own.id] = made[sender.own.id]
        return [Plan(made[s.own.id]) for s in team]
