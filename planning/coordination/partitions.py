"""Sequential assignment in rounds: greedy submodular maximisation over a team, and randomised sequential partitions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planning.coordination.decision import Decision, own_plan
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import expected_plans
from tracking.numerics.arrays import Array


@dataclass(frozen=True)
class Partitions:
    """Rounds of decisions: UAVs of one round decide at once and count only the plans of earlier rounds they receive.

    The other UAVs are left out, so that each UAV maximises the gain over what is decided.
    With `rounds` of 0 there is one UAV a round, by id: where the objective is monotone and submodular and decisions are
    exact, the team has at least half of the optimum. Else each UAV draws its round (randomised sequential partitions,
    RSP), and loses at most half of what those of one round have in common besides.
    Source: [Fisher78] for the first bound, [Corah18] and [Corah21] for RSP.
    """

    rounds: int = 0
    exchange = Exchange()

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """As `composition.Coordination.plans`."""
        drawn = rng.integers(self.rounds, size=len(team)) if self.rounds else np.arange(len(team))
        known: dict[int, dict[int, Array]] = {s.own.id: {} for s in team}  # to each UAV, the plans that it received
        made: dict[int, Array] = {}
        for now in range(int(drawn.max(initial=-1)) + 1):
            deciding = [s for s, own in zip(team, drawn.tolist(), strict=True) if own == now]
            made |= {s.own.id: _answer(s, known[s.own.id], decision, rng) for s in deciding}
            for sender in deciding:
                for s in team:
                    if s.receives(sender.own.id):
                        known[s.own.id][sender.own.id] = made[sender.own.id]
        return [Plan(made[s.own.id]) for s in team]


def _answer(situation: Situation, known: dict[int, Array], decision: Decision, rng: np.random.Generator) -> Array:
    """Plan (H, 2) m/s of a UAV among those with known plans alone."""
    among = replace(situation, neighbours=tuple(v for v in situation.neighbours if v.id in known))
    plans = expected_plans(among, decision.horizon, known)
    return own_plan(among, plans, decision, rng)
