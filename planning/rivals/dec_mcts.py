"""Decentralised Monte Carlo tree search (Dec-MCTS): a tree of own sequences, distributions over the others' ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from planning.options import Range, check_options
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import policy_of_intent
from planning.prediction.propagation import Nominal
from planning.prediction.response import camera_paths
from planning.rivals.distribution import Team, compute_gains, optimise_probabilities
from planning.rivals.gathered_information import build_prior, gather_information
from planning.rivals.moves import make_moves
from planning.rivals.tree import find_promising_sequences, grow, make_tree
from tracking.numerics.arrays import Array, Indices


@dataclass(frozen=True)
class DecMCTS:
    """Each UAV searches a tree of its own sequences of controls, and sends the likely ones to the others.

    In each of `rounds` rounds a UAV grows its tree, with the others' sequences drawn from the distributions that it
    has received; gives a few promising sequences probabilities by their gain in mutual information; and sends them. The
    distributions become sharper from round to round. In the end the UAV flies its most probable sequence, or its policy
    of intent if no sequence gains anything. UAVs that are not heard are assumed to fly their policy of intent.
    Within a round UAVs take turns, like UAVs that send whenever they are ready: if all answered the last round at once,
    they would all go to one place, or all leave it.
    Source: [Best19], with D-UCT and Algorithm 3.

    Note: each sequence is sent as a plan, which may be lost; the eight bytes of its probability are not counted. The
    value of a node is its best rollout; in the paper it is the first. Gradient steps converge in each round; the paper
    makes one step between two messages.
    """

    horizon: Annotated[int, Range(1, 8)] = 5  # steps of a plan
    directions: Annotated[int, Range(1, 16)] = 8  # directions of a control at top speed; hovering is one control more
    evaluations: Annotated[int, Range(1, 1_000_000)] = 500  # sequences that each tree tries
    rounds: Annotated[int, Range(1, 100)] = 5  # rounds in which UAVs send their distributions
    sequences: Annotated[int, Range(1, 10)] = 10  # sequences of a distribution
    # weight of the confidence bounds, as a share of the greatest reward found
    exploration: Annotated[float, Range(0, 1e6)] = 0.3
    # factor of earlier rewards for each later iteration
    discount: Annotated[float, Range(0, 1, above=True)] = 0.995
    samples: Annotated[int, Range(1, 1000)] = 6  # draws of the others' sequences for a distribution
    # temperature of the first distribution, as a share of the greatest mean gain
    temperature: Annotated[float, Range(0, 1, above=True)] = 0.1
    # factor of the temperature from round to round
    cooling: Annotated[float, Range(0, 1, above=True)] = 0.5
    updates: Annotated[int, Range(1, 10_000)] = 100  # gradient steps of a distribution
    decentralised: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_options(self)
        if self.evaluations < self.rounds:
            raise ValueError(f"evaluations must be at least the {self.rounds} rounds, is {self.evaluations!r}")

    @property
    def exchange(self) -> Exchange:
        """One message for each sequence in each round."""
        return Exchange(self.rounds * self.sequences)

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Most probable sequences of controls."""
        searches = [TreeSearch(self, s, stream) for s, stream in zip(team, rng.spawn(len(team)), strict=True)]
        for now in range(self.rounds):
            for sender in searches:
                sender.advance(now)
                for search in searches:
                    search.receive(sender, now)
        return [Plan(search.decision()) for search in searches]


class _Distribution(NamedTuple):
    """Sequences that another UAV may fly."""

    information: Array  # (S, H, B, 3 LANES), of each sequence
    chances: Array  # (S,): probabilities of the sequences


class TreeSearch:
    """One UAV's search within a decision."""

    def __init__(self, planner: DecMCTS, situation: Situation, rng: np.random.Generator) -> None:
        """Begin with an empty tree; the others follow their policies of intent."""
        self._planner = planner
        self._situation = situation
        self._rng = rng
        self._vehicles, horizon = situation.vehicles, planner.horizon
        existence = np.array([track.existence for track in situation.tracks], dtype=float)
        self._belief = Nominal(expected=True).predict(situation, horizon, rng)._replace(weights=existence)
        self._prior = build_prior(self._belief)
        self._moves = make_moves(horizon, planner.directions)
        own = situation.own
        places = own.position[:2] + own.max_speed * situation.step * self._moves.places
        self._own = gather_information(self._belief, self._vehicles.index(own), places, self._moves.steps)
        self._tree = make_tree(planner.evaluations, horizon, len(self._moves.controls))
        self._others: dict[int, _Distribution] = {}
        for vehicle in situation.neighbours:
            self._expect(vehicle.id, policy_of_intent(situation, vehicle, horizon)[None], np.ones(1))

    def advance(self, now: int) -> None:
        """Grow the tree by a round's share of the evaluations, and update the distribution."""
        planner, team = self._planner, self._gather_team()
        count = planner.evaluations * (now + 1) // planner.rounds - planner.evaluations * now // planner.rounds
        draws = self._rng.random((count, len(self._others) + planner.horizon))
        fading = np.cumprod(np.append(1.0, np.full(planner.evaluations, planner.discount)))
        grow(self._tree, self._moves, team, draws, fading, planner.exploration)
        chosen = find_promising_sequences(self._tree, planner.sequences)
        found = compute_gains(
            team, self._gather_information(chosen), self._rng.random((planner.samples, len(self._others)))
        )
        heat = planner.temperature * np.prod(np.full(now, planner.cooling))
        scaled = found / max(float(found.max()), 1e-12)
        self.controls = self._situation.own.max_speed * self._moves.controls[chosen]
        self.chances = optimise_probabilities(scaled, heat, planner.updates)
        if not found.max() > 0.0:
            intent = policy_of_intent(self._situation, self._situation.own, planner.horizon)
            self.controls, self.chances = intent[None], np.ones(1)

    def receive(self, sender: "TreeSearch", now: int) -> None:
        """Take the sequences of another UAV that arrive; if none arrives, the earlier ones stay."""
        uav, first = sender._situation.own.id, now * self._planner.sequences
        places = range(len(sender.controls))
        arrived = [k for k in places if uav in self._others and self._situation.receives(uav, first + k)]
        if arrived:
            self._expect(uav, sender.controls[arrived], sender.chances[arrived])

    def decision(self) -> Array:
        """The most probable sequence (H, 2) m/s."""
        return np.asarray(self.controls[np.argmax(self.chances)])

    def _expect(self, uav: int, controls: Array, chances: Array) -> None:
        row = [v.id for v in self._vehicles].index(uav)
        paths = camera_paths(self._vehicles[row].position[None], controls, self._situation.step)[:, :, :2]
        steps = np.repeat(np.arange(self._planner.horizon), len(controls))
        flat = np.ascontiguousarray(paths.swapaxes(0, 1).reshape(-1, 2))
        table = gather_information(self._belief, row, flat, steps)
        shape = (self._planner.horizon, len(controls), *table.shape[1:])
        information = np.ascontiguousarray(table.reshape(shape).swapaxes(0, 1))
        self._others[uav] = _Distribution(information, chances / chances.sum())

    def _gather_information(self, sequences: Indices) -> Array:
        """Information (S, H, B, 3 LANES) of own sequences of controls (S, H)."""
        places = np.full(len(sequences), -1)
        seen = []
        for h in range(sequences.shape[1]):
            places = self._moves.onward[places, sequences[:, h]]
            seen.append(self._own[places])
        return np.ascontiguousarray(np.stack(seen, axis=1))

    def _gather_team(self) -> Team:
        others = [self._others[uav] for uav in sorted(self._others)]
        none = np.zeros((0, self._planner.horizon, *self._own.shape[1:]))
        return Team(
            self._prior,
            self._own,
            np.concatenate([none, *(other.information for other in others)]),
            np.cumsum([0, *(len(other.chances) for other in others)]),
            np.concatenate([np.zeros(0), *(np.cumsum(other.chances) for other in others)]),
        )
