"""Measurement update: beliefs predicted to a scan's time, associated with its measurements and updated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tracking.association.clusters import gating_clusters
from tracking.association.jpda import existence_association, gated_likelihood, mixture_update
from tracking.association.resolution import unresolved
from tracking.filter.negative_information import negative_information_update
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.universal import power_each
from tracking.parameters import TrackerParameters

_AT_ONCE = 10_000  # pairs of tracks and measurements beyond which gating clusters pay


class ScanPrediction(NamedTuple):
    """Beliefs of T tracks, predicted to a scan's time."""

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    undetected: tuple[Array, Array]  # the same, given that the scan does not detect the person
    existence: Array  # (T,)
    visible: Array  # (T,), probability of being in plain view
    detectable: Array  # (T,), the same, less where negative information or a nearer person's measurement counts

    def only(self, rows: Indices) -> ScanPrediction:
        """Prediction of some of the tracks."""
        means, covariances = self.undetected
        rest = self.existence[rows], self.visible[rows], self.detectable[rows]
        return ScanPrediction(self.means[rows], self.covariances[rows], (means[rows], covariances[rows]), *rest)


class ScanUpdate(NamedTuple):
    """Beliefs of T tracks after a scan, and the association of its N measurements.

    Without a measurement in its gate a belief is as predicted: negative information counts once the fleet has it.
    """

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    existence: Array  # (T,)
    missed: Array  # (T,), probability that none of the measurements is the person's
    gates: Indices  # (G, 2), pairs of a track and a measurement in its gate
    explained: Flags  # (N,), measurements that tracks make likelier than clutter


def scan_prediction(
    beliefs: tuple[Array, Array], existence: Array, seen: Flags, missed: Array, p: TrackerParameters
) -> ScanPrediction:
    """Prediction from beliefs at a scan's time, means (T, 4) and covariances (T, 4, 4).

    existence (T,); seen (T, 36): flags of the samples in view; missed (T, 36) as from
    `tracking.filter.negative_information.miss_likelihood`.
    """
    tempered = missed if p.absence_weight == 1.0 else power_each(missed, p.absence_weight)
    undetected = negative_information_update(beliefs, tempered)
    detectable = (1.0 - missed.mean(axis=1)) / p.detection_probability
    if p.life == "existence":
        detectable *= 1.0 - unresolved(beliefs[0], existence)
    return ScanPrediction(*beliefs, undetected, existence, seen.mean(axis=1), detectable)


def scan_update(before: ScanPrediction, z: Array, R: Array, lost: Array, p: TrackerParameters) -> ScanUpdate:
    """Associate a scan's measurements z (N, 2) m, R (N, 2, 2) m², and update; lost (N,) as in `associate`.

    Large scenes are updated by independent gating clusters. The result is the same, up to the rounding of existence.
    """
    count = len(before.means)
    if count * len(z) <= _AT_ONCE:
        return _at_once(before, z, R, lost, p)
    means, covariances, existence, missed = (np.empty((count, *n)) for n in ((4,), (4, 4), (), ()))
    explained, gates = np.zeros(len(z), np.bool_), []
    for rows, columns in gating_clusters(before.means, before.covariances, z, R, p.measurement_gate):
        part = _at_once(before.only(rows), z[columns], R[columns], lost[columns], p)
        means[rows], covariances[rows], existence[rows] = part.means, part.covariances, part.existence
        missed[rows], explained[columns] = part.missed, part.explained
        gates.append(np.column_stack([rows[part.gates[:, 0]], columns[part.gates[:, 1]]]))
    return ScanUpdate(means, covariances, existence, missed, np.concatenate(gates), explained)


def associate(
    before: ScanPrediction, z: Array, R: Array, lost: Array, p: TrackerParameters
) -> tuple[Array, Array, Array, Array]:
    """Associate the measurements z (N, 2) m, R (N, 2, 2) m².

    lost (N,) 1/m²: density there of lost people away from their tracks. It adds to that of clutter, which
    here is the same as to lower the likelihoods.
    Returns the likelihood (T, N) 1/m² of each for each track, zero outside its gate; and the result of
    `tracking.association.jpda.existence_association`.
    """
    return _updated(before, z, R, lost, (p.gate_probability, p.clutter_density, p.detection_probability))[1]


def _at_once(before: ScanPrediction, z: Array, R: Array, lost: Array, p: TrackerParameters) -> ScanUpdate:
    settings = p.gate_probability, p.clutter_density, p.detection_probability
    return ScanUpdate(*_updated(before, z, R, lost, settings)[0])


_Settings = tuple[float, float, float]  # probability of a gate, density of clutter [1/m²], probability of detection
_Association = tuple[Array, Array, Array, Array]  # what `associate` returns


@compiled
def _updated(
    before: ScanPrediction, z: Array, R: Array, lost: Array, settings: _Settings
) -> tuple[tuple[Array, Array, Array, Array, Indices, Flags], _Association]:
    """The fields of `ScanUpdate`, and the result of `associate`."""
    gate_probability, clutter, detection = settings
    likelihood = gated_likelihood(before.means, before.covariances, z, R, gate_probability)
    # Where a measurement was made the view is free: only the probability of a miss depends on the whole belief. So a
    # person who leaves the cover of a tree earlier than predicted is detected at once.
    chances = np.full((len(likelihood), len(z) + 1), detection * gate_probability)
    for t in range(len(likelihood)):
        chances[t, 0] *= before.detectable[t]
        for j in range(len(z)):
            likelihood[t, j] *= clutter / (clutter + lost[j])
    beta, given, existence = existence_association(likelihood, chances, clutter, before.existence)
    means, covariances = mixture_update((before.means, before.covariances), before.undetected, z, R, given)
    gates, count, explained = np.empty((likelihood.size, 2), np.int64), 0, np.zeros(len(z), np.bool_)
    for t in range(len(likelihood)):
        first = count
        for j in range(len(z)):
            if likelihood[t, j] > 0.0:
                gates[count, 0], gates[count, 1] = t, j
                count += 1
                # A wide belief must not take measurements of new people: it explains those that it makes likelier than
                # clutter.
                explained[j] |= detection * likelihood[t, j] > clutter
        for a in range(4 if count == first else 0):
            means[t, a] = before.means[t, a]
            for b in range(4):
                covariances[t, a, b] = before.covariances[t, a, b]
    updated = means, covariances, existence, beta[:, 0].copy(), gates[:count].copy(), explained
    return updated, (likelihood, beta, given, existence)
