"""Measurement update: beliefs predicted to a scan's time, associated with its measurements and updated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tracking.association.gating_batches import find_gating_batches
from tracking.association.jpda import existence_association, gated_likelihood, mixture_update
from tracking.filter.negative_information import negative_information_update, temper
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, merged
from tracking.numerics.exponential import exp
from tracking.numerics.stacks import row_sums
from tracking.parameters import AssociationSettings, ScanSettings
from tracking.track import Beliefs

# Probability that two people in one place give one measurement, and the distance [m] over which it falls.
_UNRESOLVED, _RESOLUTION = 0.12, 1.0


class ScanPrediction(NamedTuple):
    """Beliefs of T tracks, predicted to a scan's time."""

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    undetected: Beliefs  # given that the scan does not detect the person
    existence: Array  # (T,)
    visible: Array  # (T,), probability of being in plain view
    detectable: Array  # (T,), `visible`, but less if frames before showed no person there or if another person is near


class Measured(NamedTuple):
    """N measurements of a scan, and what is known of their places."""

    places: Array  # (N, 2) m
    covariances: Array  # (N, 2, 2) m²
    shares: Array  # (N,), probability that enough of a person there shows through leaves to detect them
    lost: Array  # (N,) 1/m², density of lost people away from their tracks


class ScanUpdate(NamedTuple):
    """Beliefs of T tracks after a scan, and the association of its N measurements.

    A belief without a measurement in its gate stays as predicted; negative information is applied after fusion.
    """

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    existence: Array  # (T,)
    missed: Array  # (T,), probability that none of the measurements is the person's
    gates: Indices  # (G, 2), pairs of a track and a measurement in its gate
    weights: Array  # (G,), probability of each pair that the measurement is the person's
    explained: Flags  # (N,), measurements that tracks make likelier than clutter


@compiled
def predict_scan(
    beliefs: Beliefs, existence: Array, visible: Array, missed: Array, settings: ScanSettings, starts: Indices
) -> ScanPrediction:
    """Prediction from the beliefs of N UAVs at a scan's time; those of UAV n begin at `starts[n]` (N + 1,).

    beliefs: means (T, 4) and covariances (T, 4, 4); existence and visible (T,): probabilities; missed (T, 36):
    likelihoods as from `tracking.filter.negative_information.miss_likelihood`.
    """
    means, covariances = beliefs
    moved, spread = negative_information_update(means, covariances, temper(missed, settings.negative_information))
    sums, count, detectable = row_sums(missed), missed.shape[1], np.empty(len(means))
    for t in range(len(means)):
        detectable[t] = (1.0 - sums[t] / count) / settings.detection_probability
    for n in range(len(starts) - 1 if settings.by_existence else 0):
        rows = slice(starts[n], starts[n + 1])
        near = _compute_unresolved_probability(means[rows], existence[rows])
        for t in range(len(near)):
            detectable[starts[n] + t] *= 1.0 - near[t]
    return ScanPrediction(means, covariances, Beliefs(moved, spread), existence, visible, detectable)


@merged
def _compute_unresolved_probability(means: Array, existence: Array) -> Array:
    """Probability (T,) that another person is so near that both give one measurement; means (T, 4), existence (T,).

    Without it, one of two people who pass each other would look like a false track. Source: [Koch97], nearest only.
    Note: in one place it is 0.12, not 1, because people keep apart; two tracks that stay in one place are one person.
    """
    nearest = np.zeros(len(means))
    for a in range(len(means)):
        for b in range(len(means)):
            if a != b:
                x, y = means[a, 0] - means[b, 0], means[a, 1] - means[b, 1]
                power = -0.5 / (_RESOLUTION * _RESOLUTION) * (x * x + y * y)
                if power > -800.0:  # of others the exponential is zero
                    nearest[a] = max(nearest[a], existence[b] * exp(power))
    return _UNRESOLVED * nearest


@compiled
def select_tracks(before: ScanPrediction, rows: Indices | slice) -> ScanPrediction:
    """Prediction of some of the tracks."""
    undetected = Beliefs(before.undetected[0][rows], before.undetected[1][rows])
    rest = before.existence[rows], before.visible[rows], before.detectable[rows]
    return ScanPrediction(before.means[rows], before.covariances[rows], undetected, rest[0], rest[1], rest[2])


@compiled
def update_scan(before: ScanPrediction, found: Measured, settings: AssociationSettings) -> ScanUpdate:
    """Associate a scan's measurements with tracks, and update the tracks.

    Scenes of more pairs of tracks and measurements than `settings.at_once` are updated by independent gating batches.
    The result is the same, up to the rounding of existence.
    """
    count = len(before.means)
    if count * len(found.places) <= settings.at_once:
        return _update_beliefs(before, found, settings)
    means, covariances, existence, missed = (
        np.empty((count, 4)),
        np.empty((count, 4, 4)),
        np.empty(count),
        np.empty(count),
    )
    gates, weights, explained = np.empty((0, 2), np.int64), np.empty(0), np.zeros(len(found.places), np.bool_)
    z, R = found.places, found.covariances
    of_tracks, of_places = find_gating_batches(before.means, before.covariances, z, R, settings.gate_probability)
    for k in range(of_tracks.max() + 1):
        rows, columns = np.nonzero(of_tracks == k)[0], np.nonzero(of_places == k)[0]
        near = Measured(z[columns], R[columns], found.shares[columns], found.lost[columns])
        part = _update_beliefs(select_tracks(before, rows), near, settings)
        for i in range(len(rows)):
            t = rows[i]
            for a in range(4):
                means[t, a] = part.means[i, a]
                for b in range(4):
                    covariances[t, a, b] = part.covariances[i, a, b]
            existence[t], missed[t] = part.existence[i], part.missed[i]
        for j in range(len(columns)):
            explained[columns[j]] = part.explained[j]
        for g in range(len(part.gates)):
            part.gates[g, 0], part.gates[g, 1] = rows[part.gates[g, 0]], columns[part.gates[g, 1]]
        gates, weights = np.concatenate((gates, part.gates)), np.concatenate((weights, part.weights))
    return ScanUpdate(means, covariances, existence, missed, gates, weights, explained)


@compiled
def associate(
    before: ScanPrediction, found: Measured, settings: AssociationSettings
) -> tuple[Array, Array, Array, Array]:
    """Associate measurements with tracks.

    The density of lost people whom the scan detects adds to that of clutter, which is equivalent to lower likelihoods.
    Returns the likelihood (T, N) 1/m² of each measurement for each track, zero outside the gate, and the results of
    `tracking.association.jpda.existence_association`.
    """
    clutter = settings.clutter_density
    z, R, shares, lost = found
    likelihood = gated_likelihood(before.means, before.covariances, z, R, settings.gate_probability)
    # No opaque tree hides the place of a measurement, so only the probability of a miss depends on the whole belief.
    # Thus a person that leaves the cover of a tree earlier than predicted is detected at once. Under leaves a person
    # is measured with the probability that enough shows there: the place of the measurement, not that of the belief.
    chances = np.full((len(likelihood), len(z) + 1), settings.detection_probability * settings.gate_probability)
    for t in range(len(likelihood)):
        chances[t, 0] *= before.detectable[t]
        for j in range(len(z)):
            chances[t, j + 1] *= shares[j]
            likelihood[t, j] *= clutter / (clutter + shares[j] * lost[j])
    return likelihood, *existence_association(likelihood, chances, clutter, before.existence)


@compiled
def _update_beliefs(before: ScanPrediction, found: Measured, settings: AssociationSettings) -> ScanUpdate:
    likelihood, beta, given, existence = associate(before, found, settings)
    predicted = before.means, before.covariances
    means, covariances = mixture_update(predicted, before.undetected, found.places, found.covariances, given)
    densities = np.empty_like(likelihood)
    for t in range(densities.shape[0]):
        for j in range(densities.shape[1]):
            densities[t, j] = likelihood[t, j] * found.shares[j]
    pairs = _list_gates(before, densities, beta, (means, covariances), settings)
    return ScanUpdate(means, covariances, existence, beta[:, 0].copy(), pairs[0], pairs[1], pairs[2])


@merged
def _list_gates(
    before: ScanPrediction, likelihood: Array, beta: Array, updated: tuple[Array, Array], settings: AssociationSettings
) -> tuple[Indices, Array, Flags]:
    """The `gates`, `weights` and `explained` of an update; beliefs without a measurement in their gate are restored."""
    means, covariances = updated
    gates, weights = np.empty((likelihood.size, 2), np.int64), np.empty(likelihood.size)
    count, explained = 0, np.zeros(likelihood.shape[1], np.bool_)
    for t in range(len(likelihood)):
        first = count
        for j in range(likelihood.shape[1]):
            if likelihood[t, j] > 0.0:
                gates[count, 0], gates[count, 1], weights[count] = t, j, beta[t, j + 1]
                count += 1
                # A track explains only measurements that it makes likelier than clutter, so that a wide belief takes
                # none of new people.
                explained[j] |= settings.detection_probability * likelihood[t, j] > settings.clutter_density
        for a in range(4 if count == first else 0):
            means[t, a] = before.means[t, a]
            for b in range(4):
                covariances[t, a, b] = before.covariances[t, a, b]
    return gates[:count].copy(), weights[:count].copy(), explained
