"""Distributions over the sequences of a team's UAVs, compiled."""

from typing import NamedTuple

import numpy as np

from planning.rivals.gathered_information import Prior, gain_of
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import log

_RATE = 0.1  # of gradient steps


class Team(NamedTuple):
    """Beliefs of a UAV: on people, on its own sequences, and on the sequences of the others."""

    prior: Prior
    own: Array  # (M, B, 3 LANES): information from each place of its moves
    others: Array  # (S, H, B, 3 LANES): information of each sequence of the others
    first: Indices  # (n,): index of the first sequence of each of n - 1 other UAVs; last, the number S
    chances: Array  # (S,): cumulative probabilities of each UAV's sequences


@compiled
def draw_information(team: Team, draws: Array) -> Array:
    """Information (H, B, 3 LANES) of sequences of the others, drawn by uniform numbers (n - 1 or more,)."""
    information = np.zeros(team.others.shape[1:])
    for j in range(len(team.first) - 1):
        s = team.first[j]
        while s + 1 < team.first[j + 1] and team.chances[s] <= draws[j]:
            s += 1
        information += team.others[s]
    return information


@compiled
def compute_gains(team: Team, sequences: Array, draws: Array) -> Array:
    """Mean gain (S,) of a UAV's own sequences, given by their information (S, H, B, 3 LANES).

    The mean is over sequences of the other UAVs, drawn by `draws` (D, n - 1).
    """
    found = np.zeros(len(sequences))
    for i in range(len(draws)):
        others = draw_information(team, draws[i])
        alone = gain_of(team.prior, others)
        for s in range(len(sequences)):
            found[s] += gain_of(team.prior, others + sequences[s]) - alone
    return found / len(draws)


@compiled
def optimise_probabilities(gains: Array, temperature: float, updates: int) -> Array:
    """Probabilities (S,) of sequences after gradient steps from a uniform start to large gains and large entropy.

    The steps are those of [Best19] Algorithm 3; they converge to probabilities proportional to exp(gain / temperature).
    """
    q = np.full(len(gains), 1.0 / len(gains))
    for _ in range(updates):
        mean, entropy = 0.0, 0.0
        for s in range(len(q)):
            mean += q[s] * gains[s]
            entropy -= q[s] * log(q[s])
        for s in range(len(q)):
            q[s] -= _RATE * q[s] * ((mean - gains[s]) / temperature + entropy + log(q[s]))
            q[s] = max(q[s], 1e-12)
        q /= q.sum()
    return q
