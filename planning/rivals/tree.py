"""The search tree of a UAV in decentralised Monte Carlo tree search, compiled."""

import math
from typing import NamedTuple

import numpy as np

from planning.rivals.distribution import Team, draw_information
from planning.rivals.gathered_information import gain_of
from planning.rivals.moves import Moves
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import log


class SearchTree(NamedTuple):
    """Nodes of a search tree, the root first; a node is a sequence of controls."""

    children: Indices  # (N, A): -1 where a control has not been tried
    sums: Array  # (N,): sums of rewards [nats], discounted by the iterations since
    visits: Array  # (N,): numbers of visits, discounted likewise
    last: Indices  # (N,): the iteration of the last visit
    best: Array  # (N,): the greatest reward of a rollout
    sequences: Indices  # (N, H): controls of that rollout
    counts: Indices  # (2,): nodes and iterations so far


def make_tree(iterations: int, horizon: int, controls: int) -> SearchTree:
    """An empty tree with room for one node per iteration."""
    room = iterations + 1
    return SearchTree(
        np.full((room, controls), -1),
        np.zeros(room),
        np.zeros(room),
        np.zeros(room, np.int64),
        np.full(room, -1.0),
        np.zeros((room, horizon), np.int64),
        np.array([1, 0]),
    )


@compiled
def grow(tree: SearchTree, moves: Moves, team: Team, draws: Array, fading: Array, exploration: float) -> None:
    """Search for as many iterations as there are rows of uniform numbers.

    Each iteration draws the others' sequences, descends by discounted upper confidence bounds (D-UCT), tries a new
    control, completes the sequence at random, and adds the reward to the nodes on its path. The reward is the gain over
    the others' information.
    The tree is changed in place. draws (I, n - 1 + H): uniform numbers; fading: powers of the discount; exploration:
    weight of the confidence bounds.
    """
    H = tree.sequences.shape[1]
    controls, path = np.empty(H, np.int64), np.zeros(H + 1, np.int64)  # each path begins at the root
    for i in range(len(draws)):
        information = draw_information(team, draws[i])
        reward = -gain_of(team.prior, information)
        node, place, depth = 0, -1, 0
        for h in range(H):
            chance = draws[i, len(team.first) - 1 + h]
            if depth == h:  # in the tree
                controls[h] = _choose_control(tree, node, chance, fading, exploration)
                if tree.children[node, controls[h]] < 0:
                    tree.children[node, controls[h]] = tree.counts[0]
                    tree.counts[0] += 1
                else:
                    depth += 1
                node = tree.children[node, controls[h]]
                path[h + 1] = node
                length = h + 1
            else:
                controls[h] = int(chance * len(moves.controls))
            place = moves.onward[place, controls[h]]
            information[h] += team.own[place]
        _add_reward(tree, path[: length + 1], reward + gain_of(team.prior, information), controls, fading)


@compiled
def _choose_control(tree: SearchTree, node: int, chance: float, fading: Array, exploration: float) -> int:
    """Control to try at a node: a random untried one, else the one with the largest upper confidence bound."""
    children, now = tree.children[node], tree.counts[1]
    untried = np.flatnonzero(children < 0)
    if len(untried):
        return int(untried[int(chance * len(untried))])
    here = tree.visits[node] * fading[now - tree.last[node]]
    scale = tree.best[0] if tree.best[0] > 0.0 else 1.0
    best, most = 0, -math.inf
    for a in range(len(children)):
        child = children[a]
        visits = tree.visits[child] * fading[now - tree.last[child]]
        spread = math.sqrt(2.0 * max(log(here), 0.0) / visits)
        bound = tree.sums[child] / tree.visits[child] / scale + exploration * spread
        if bound > most:
            best, most = a, bound
    return best


@compiled
def _add_reward(tree: SearchTree, path: Indices, reward: float, controls: Indices, fading: Array) -> None:
    tree.counts[1] += 1
    now = tree.counts[1]
    for node in path:
        fade = fading[now - tree.last[node]]
        tree.sums[node] = tree.sums[node] * fade + reward
        tree.visits[node] = tree.visits[node] * fade + 1.0
        tree.last[node] = now
        if reward > tree.best[node]:
            tree.best[node] = reward
            tree.sequences[node] = controls


def find_promising_sequences(tree: SearchTree, most: int) -> Indices:
    """Sequences (S, H) of controls, at most `most`: distinct best rollouts of the nodes of largest mean reward."""
    nodes = int(tree.counts[0])
    found: dict[tuple[int, ...], None] = {}
    for node in np.argsort(-tree.sums[1:nodes] / tree.visits[1:nodes], kind="stable") + 1:
        found[tuple(tree.sequences[node].tolist())] = None
        if len(found) == most:
            break
    return np.array(list(found))
