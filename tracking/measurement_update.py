"""Measurement update: beliefs predicted to a scan's time, associated with its measurements and updated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.association.clusters import gating_clusters
from tracking.association.jpda import existence_association, gated_likelihood, mixture_update
from tracking.association.resolution import unresolved
from tracking.filter.negative_information import negative_information_update
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.universal import power_each
from tracking.parameters import TrackerParameters

_AT_ONCE = 10_000  # pairs of tracks and measurements beyond which gating clusters pay


@dataclass(frozen=True, eq=False)
class ScanPrediction:
    """Beliefs of T tracks, predicted to a scan's time."""

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    undetected: tuple[Array, Array]  # the same, given that the scan does not detect the person
    existence: Array  # (T,)
    visible: Array  # (T,), probability of being in plain view
    detectable: Array  # (T,), the same, less where the last frame was negative information

    def __getitem__(self, rows: Indices) -> ScanPrediction:
        """Prediction of some of the tracks."""
        means, covariances = self.undetected
        rest = self.existence[rows], self.visible[rows], self.detectable[rows]
        return ScanPrediction(self.means[rows], self.covariances[rows], (means[rows], covariances[rows]), *rest)


@dataclass(frozen=True, eq=False)
class ScanUpdate:
    """Beliefs of T tracks after a scan, and the association of its N measurements."""

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

    existence (T,); seen and missed (T, 36) as from `tracking.filter.negative_information.miss_likelihood`.
    """
    undetected = negative_information_update(beliefs, power_each(missed, p.absence_weight))
    detectable = (1.0 - missed.mean(axis=1)) / p.detection_probability
    if p.life == "existence":
        detectable = detectable * (1.0 - unresolved(beliefs[0], existence))
    return ScanPrediction(*beliefs, undetected, existence, seen.sum(axis=1) / seen.shape[1], detectable)


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
        part = _at_once(before[rows], z[columns], R[columns], lost[columns], p)
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
    likelihood = gated_likelihood(before.means, before.covariances, z, R, p.gate_probability)
    likelihood *= p.clutter_density / (p.clutter_density + lost)
    detection = p.detection(before.detectable, len(z))
    return likelihood, *existence_association(likelihood, detection, p.clutter_density, before.existence)


def _at_once(before: ScanPrediction, z: Array, R: Array, lost: Array, p: TrackerParameters) -> ScanUpdate:
    likelihood, beta, given, existence = associate(before, z, R, lost, p)
    means, covariances = mixture_update((before.means, before.covariances), before.undetected, z, R, given)
    # A wide belief must not take measurements of new people: it explains those that it makes likelier than clutter.
    explained = p.detection_probability * likelihood.max(axis=0, initial=0.0) > p.clutter_density
    return ScanUpdate(means, covariances, existence, beta[:, 0], np.argwhere(likelihood), explained)
