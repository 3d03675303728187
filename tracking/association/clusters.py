"""Parts of a scan that have nothing to do with each other: a scan's cost grows with people, not their square."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tracking.numerics.compiled import Array, compiled

Indices = NDArray[np.int64]

_TRACKS = 64  # of a block, at least: of smaller ones calls cost more than what they work on
_ROOM = 1.001  # by which reaches exceed gates, for rounding


def blocks(
    means: Array, covariances: Array, measurements: Array, noise: Array, gate: float
) -> list[tuple[Indices, Indices]]:
    """Tracks and measurements, ascending, of blocks between which no measurement is in a track's gate.

    means (T, 4), covariances (T, 4, 4), measurements (N, 2) m, noise (N, 2, 2) m²; gate is the squared distance
    allowed. Each track is in one block; a measurement near no track is in none.
    """
    roots = _roots(means, covariances, measurements, noise, gate)
    firsts, component, counts = np.unique(roots[: len(means)], return_inverse=True, return_counts=True)
    block = (np.cumsum(counts) - counts) // _TRACKS  # whole components, one after the other
    near = np.minimum(np.searchsorted(firsts, roots[len(means) :]), len(firsts) - 1)
    of_measurements = np.where(firsts[near] == roots[len(means) :], block[near], -1)
    numbers = np.unique(block)
    return list(zip(_members(block[component], numbers), _members(of_measurements, numbers), strict=True))


def _members(values: Indices, numbers: Indices) -> list[Indices]:
    """Where each of the numbers, ascending, stands among values."""
    order = np.argsort(values, kind="stable")
    left, right = (np.searchsorted(values[order], numbers, side=side) for side in ("left", "right"))
    return [order[a:b] for a, b in zip(left.tolist(), right.tolist(), strict=True)]


@compiled
def _roots(means: Array, covariances: Array, measurements: Array, noise: Array, gate: float) -> Indices:
    """For each track, then each measurement (T + N,), the smallest index of all connected by boxes round gates."""
    order = np.argsort(measurements[:, 0], kind="mergesort")
    xs = measurements[order, 0]
    parents = np.arange(len(means) + len(measurements))
    widest = noise[:, 0, 0].max() if len(noise) > 0 else 0.0
    for i in range(len(means)):
        reach = _ROOM * math.sqrt(gate * (covariances[i, 0, 0] + widest))
        for k in range(np.searchsorted(xs, means[i, 0] - reach), len(xs)):
            if xs[k] > means[i, 0] + reach:
                break
            j = order[k]
            dy = measurements[j, 1] - means[i, 1]
            if dy * dy <= _ROOM * gate * (covariances[i, 1, 1] + noise[j, 1, 1]):
                a, b = _root(parents, i), _root(parents, len(means) + j)
                parents[max(a, b)] = min(a, b)
    for i in range(len(parents)):
        parents[i] = _root(parents, i)
    return parents


@compiled
def _root(parents: Indices, i: int) -> int:
    """Where a chain of parents ends; it is halved on the way."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i
