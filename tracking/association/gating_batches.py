"""Independent batches of tracks and measurements: they make the cost of a scan linear, not quadratic, in the people."""

import math

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import log

_TRACKS = 64  # number of tracks to collect in a batch: for smaller batches calls cost more than arithmetic
_ROOM = 1.001  # factor by which boxes exceed gates, for rounding


@compiled
def find_gating_batches(
    means: Array, covariances: Array, measurements: Array, noise: Array, gate_probability: float
) -> tuple[Indices, Indices]:
    """Numbers of the batches (T,) of tracks and (N,) of measurements; batches share no gate.

    Each track is in one batch; a measurement near no track is in none, -1. A batch consists of whole connected
    components of the graph of gates, which JPDA calls clusters. There may be numbers without a batch.
    means (T, 4) and covariances (T, 4, 4) of tracks; measurements (N, 2) m and their covariances `noise` (N, 2, 2) m²;
    gate_probability: that a person's measurement is in the gate.
    """
    roots = _find_roots(means, covariances, measurements, noise, -2.0 * log(1.0 - gate_probability))
    sizes, batches, before = np.zeros(len(roots), np.int64), np.full(len(roots), -1), 0
    for t in range(len(means)):
        sizes[roots[t]] += 1
    for t in range(len(means)):
        if sizes[t] > 0:
            batches[t] = before // _TRACKS  # whole components, one after the other
            before += sizes[t]
    numbers = batches[roots]
    return numbers[: len(means)], numbers[len(means) :]


@compiled
def _find_roots(means: Array, covariances: Array, measurements: Array, noise: Array, gate: float) -> Indices:
    """Roots (T + N,) of tracks, then measurements: the smallest index among those that boxes around gates connect."""
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
                a, b = _find_root(parents, i), _find_root(parents, len(means) + j)
                parents[max(a, b)] = min(a, b)
    for i in range(len(parents)):
        parents[i] = _find_root(parents, i)
    return parents


@compiled
def _find_root(parents: Indices, i: int) -> int:
    """Root of a node; the search halves the path to the root."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i
