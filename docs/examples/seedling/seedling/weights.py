"""Weights of the policy: their shapes, the hand-set ones that training begins with, and files of them."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array

TRACK_FEATURES, MOVE_FEATURES, HIDDEN = 15, 8, 4
LEARNED = Path(__file__).with_name("weights.npz")


class Weights(NamedTuple):
    """Two small networks and a few numbers, the same for all UAVs; (outputs, inputs) each.

    Each network is a linear part and one hidden layer beside it.
    """

    track_linear: Array  # (2, 15): of a track's features, the worth of seeing it and the attention to it
    track_in: Array  # (4, 15)
    track_out: Array  # (2, 4)
    move_linear: Array  # (2, 8): of a move's features, what it does for a seen track and for a pursued one
    move_in: Array  # (4, 8)
    move_out: Array  # (2, 4)
    scalars: Array  # (8,): see `seedling.policy.value_of_moves`


_NETWORKS = tuple(((2, inputs), (HIDDEN, inputs), (2, HIDDEN)) for inputs in (TRACK_FEATURES, MOVE_FEATURES))
SHAPES: tuple[tuple[int, ...], ...] = (*_NETWORKS[0], *_NETWORKS[1], (8,))  # of the weights in their order
SIZE = sum(int(np.prod(shape)) for shape in SHAPES)


def unpacked(flat: Array) -> Weights:
    """Weights from one vector (SIZE,)."""
    ends = np.cumsum([int(np.prod(shape)) for shape in SHAPES])
    parts = np.split(np.asarray(flat, dtype=float), ends[:-1])
    return Weights(*(np.ascontiguousarray(part.reshape(shape)) for part, shape in zip(parts, SHAPES, strict=True)))


def packed(weights: Weights) -> Array:
    """One vector (SIZE,) of all weights."""
    return np.concatenate([part.ravel() for part in weights])


def hand_set(seed: int) -> Array:
    """Weights (SIZE,) that training begins with: each UAV goes for uncertain tracks that it is nearest to.

    Hidden layers are drawn by chance and have no effect yet.
    """
    rng = np.random.default_rng(seed)
    start = Weights(*(np.zeros(shape) for shape in SHAPES))
    start.track_in[:] = rng.uniform(-1.0, 1.0, start.track_in.shape)
    start.move_in[:] = rng.uniform(-1.0, 1.0, start.move_in.shape)
    start.track_linear[0, [1, 2, 8]] = 1.0, 0.5, -0.7
    start.track_linear[1, [1, 2, 4, 5, 7, 8, 11, 14]] = 0.5, 1.0, 0.5, -1.0, 1.0, -0.7, 0.3, -0.7
    start.move_linear[0, [0, 1, 5]] = 1.0, 0.3, 0.5
    start.move_linear[1, [2, 3, 4]] = -1.0, 1.0, -0.5
    start.scalars[:] = 0.5, 0.5, 0.5, 2.0, 0.5, 0.02, 0.5, 0.2
    return packed(start)


def load(path: Path) -> Weights:
    """Weights of a file; ValueError if it holds others."""
    with np.load(path, allow_pickle=False) as held:
        if set(held.files) != set(Weights._fields):
            raise ValueError(f"weights: {path} holds {', '.join(held.files)}; expected {', '.join(Weights._fields)}")
        weights = Weights(*(held[name].astype(float) for name in Weights._fields))
    for name, part, shape in zip(Weights._fields, weights, SHAPES, strict=True):
        if part.shape != shape or not np.all(np.isfinite(part)):
            raise ValueError(f"weights: {name} of {path} has the shape {part.shape}; expected finite numbers {shape}")
    return weights
