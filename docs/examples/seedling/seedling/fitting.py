"""Fitting the policy's weights to the moves that an expert chose: cross-entropy, its gradient, and Adam.

This does not fly, so it may use all of NumPy.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seedling.weights import PAIR_FEATURES, Weights
from understory import Array

_SPREAD = 0.2  # of the reach: an expert's move stands for moves so near to it
_BATCH = 64  # decisions
_DECAY, _FORGET, _FORGET_SQUARES = 1e-4, 0.9, 0.99


class Example(NamedTuple):
    """A decision: features of the moves of a UAV, see `described`, and how much each is like the expert's (K,)."""

    pairs: Array  # (K, T, P)
    places: Array  # (K, Q)
    alike: Array  # (K,), adds up to one


class _Batch(NamedTuple):
    """Decisions side by side: R pairs of M moves of D decisions."""

    pairs: Array  # (R, P)
    places: Array  # (M, Q)
    alike: Array  # (M,)
    first: NDArray[np.int64]  # (M,): row of each move's first pair
    begins: NDArray[np.int64]  # (D,): each decision's first move


def example(choice: tuple[Array, Array, Array], wanted: Array, reach: float) -> Example:
    """The example of a decision between moves, with their features, when the expert flew (2,) m of `reach`."""
    moves, pairs, places = choice
    off = np.square((moves - wanted) / max(reach, 1e-9)).sum(axis=1) / (2 * _SPREAD**2)
    alike = np.exp(off.min() - off)
    return Example(pairs.astype(np.float32), places.astype(np.float32), (alike / alike.sum()).astype(np.float32))


def loss(weights: Weights, examples: Sequence[Example]) -> float:
    """Mean of what the policy's choice differs from the expert's [nats]; zero where it is the same."""
    total, single = 0.0, _single(weights)
    for k in range(0, len(examples), _BATCH):
        some = examples[k : k + _BATCH]
        total += _value_and_gradient(single, _batch(some))[0] * len(some)
    return total / len(examples)


def fitted(weights: Weights, examples: Sequence[Example], epochs: int, rate: float, seed: int) -> Weights:
    """Weights after some epochs of Adam, whose rate falls to zero; source: arXiv:1412.6980."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(examples))
    batches = [_batch([examples[i] for i in order[k : k + _BATCH]]) for k in range(0, len(order), _BATCH)]
    now = list(_single(weights))
    mean, square = [np.zeros_like(w) for w in now], [np.zeros_like(w) for w in now]
    total, done = epochs * len(batches), 0
    for _ in range(epochs):
        for b in rng.permutation(len(batches)):
            gradient = _value_and_gradient(Weights(*now), batches[b])[1]
            done += 1
            step = rate * (1 - (done - 1) / total) * np.sqrt(1 - _FORGET_SQUARES**done) / (1 - _FORGET**done)
            for k, g in enumerate(gradient):
                mean[k] = _FORGET * mean[k] + (1 - _FORGET) * g
                square[k] = _FORGET_SQUARES * square[k] + (1 - _FORGET_SQUARES) * g * g
                now[k] = now[k] - step * mean[k] / (np.sqrt(square[k]) + 1e-8) - step * _DECAY * now[k]
    return Weights(*(w.astype(float) for w in now))


def _single(weights: Weights) -> Weights:
    """Weights in single precision, which takes half the time."""
    return Weights(*(w.astype(np.float32) for w in weights))  # type: ignore[arg-type]


def _batch(examples: Sequence[Example]) -> _Batch:
    """A batch; a move without tracks has a pair of zeros, which adds nothing."""
    nothing = np.zeros((1, PAIR_FEATURES), np.float32)
    pairs = [e.pairs if e.pairs.shape[1] else np.tile(nothing, (len(e.pairs), 1, 1)) for e in examples]
    counts = np.concatenate([np.full(len(p), p.shape[1]) for p in pairs])
    moves = np.array([len(p) for p in pairs])
    return _Batch(
        np.concatenate([p.reshape(-1, p.shape[2]) for p in pairs]),
        np.concatenate([e.places for e in examples]),
        np.concatenate([e.alike for e in examples]),
        np.cumsum(counts) - counts,
        np.cumsum(moves) - moves,
    )


def _value_and_gradient(w: Weights, b: _Batch) -> tuple[float, Weights]:
    """Mean relative entropy of the policy's choices to the expert's, and its gradient; see `seedling.policy.scores`."""
    pooled, D = len(w.pair), len(b.begins)
    A = b.pairs @ w.pair.T
    slope = 1 / (1 + np.abs(A))
    U = np.concatenate([np.add.reduceat(A * slope, b.first), b.places], axis=1)
    B = U @ w.joint.T
    bend = 1 / (1 + np.abs(B))
    Y = B * bend
    s = Y @ w.score + U @ w.linear
    sizes = np.diff(np.append(b.begins, len(s)))
    s = s - np.repeat(np.maximum.reduceat(s, b.begins), sizes)
    s = s - np.repeat(np.log(np.add.reduceat(np.exp(s), b.begins)), sizes)
    value = float((b.alike * (np.log(np.maximum(b.alike, 1e-30)) - s)).sum() / D)
    ds = (np.exp(s) - b.alike) / np.float32(D)
    dB = ds[:, None] * w.score * bend * bend
    dU = dB @ w.joint + ds[:, None] * w.linear
    dA = np.repeat(dU[:, :pooled], np.diff(np.append(b.first, len(A))), axis=0) * slope * slope
    return value, Weights(dA.T @ b.pairs, dB.T @ U, Y.T @ ds, U.T @ ds)
