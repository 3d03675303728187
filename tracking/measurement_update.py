"""What a scan makes of the beliefs predicted to its time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.association.clusters import blocks
from tracking.association.jipda import associated
from tracking.association.jpda import gated_likelihood, mixture_update
from tracking.filter.negative_information import given_undetected
from tracking.management.deletion import own_measurements
from tracking.numerics.compiled import Array
from tracking.numerics.elementary import power_each
from tracking.parameters import TrackerParameters

Flags = NDArray[np.bool_]

_AT_ONCE = 10_000  # pairs of tracks and measurements beyond which it pays to look for those that can be


@dataclass(frozen=True, eq=False)
class Predicted:
    """Beliefs before a scan, of T tracks."""

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    undetected: tuple[Array, Array]  # the same, given that the person gives no measurement
    existence: Array  # (T,)
    visible: Array  # (T,), probability to be in plain view
    shown: Array  # (T,), the same, less where the last frame has shown nobody

    def __getitem__(self, rows: NDArray[np.int64]) -> Predicted:
        """Of some of the tracks."""
        means, covariances = self.undetected
        undetected = means[rows], covariances[rows]
        rest = self.existence[rows], self.visible[rows], self.shown[rows]
        return Predicted(self.means[rows], self.covariances[rows], undetected, *rest)


@dataclass(frozen=True, eq=False)
class Corrected:
    """Beliefs after it, and whose its N measurements are."""

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    existence: Array  # (T,)
    nobody: Array  # (T,), probability that none of the measurements is the person's
    own: Flags  # (T,), whether it has a measurement of its own
    gates: NDArray[np.int64]  # (G, 2), pairs of a track and a measurement in its gate
    explained: Flags  # (N,), which measurements tracks make likelier than clutter


def foreseen(
    beliefs: tuple[Array, Array], existence: Array, seen: Flags, missed: Array, p: TrackerParameters
) -> Predicted:
    """Beliefs predicted to a scan's time, means (T, 4) and covariances (T, 4, 4), as the scan finds them.

    existence (T,); seen and missed (T, 36): what `tracking.filter.negative_information.look` says of the frame.
    """
    undetected = given_undetected(beliefs, power_each(missed, p.absence_weight))
    shown = (1.0 - missed.mean(axis=1)) / p.detection_probability
    return Predicted(*beliefs, undetected, existence, seen.mean(axis=1), shown)


def corrected(before: Predicted, z: Array, R: Array, p: TrackerParameters) -> Corrected:
    """Associate a scan's measurements z (N, 2) m, R (N, 2, 2) m², and update.

    Large scenes are worked on in blocks that have nothing to do with each other. The result is the same, up to the
    rounding of existence.
    """
    count, found = len(before.means), len(z)
    if count * found <= _AT_ONCE:
        return _at_once(before, z, R, p)
    means, covariances, existence, nobody = (
        np.empty((count, 4)),
        np.empty((count, 4, 4)),
        np.empty(count),
        np.empty(count),
    )
    own, explained, gates = np.empty(count, np.bool_), np.zeros(found, np.bool_), []
    for rows, columns in blocks(before.means, before.covariances, z, R, p.measurement_gate):
        part = _at_once(before[rows], z[columns], R[columns], p)
        means[rows], covariances[rows], existence[rows] = part.means, part.covariances, part.existence
        nobody[rows], own[rows], explained[columns] = part.nobody, part.own, part.explained
        gates.append(np.column_stack([rows[part.gates[:, 0]], columns[part.gates[:, 1]]]))
    return Corrected(means, covariances, existence, nobody, own, np.concatenate(gates), explained)


def weighed(before: Predicted, z: Array, R: Array, p: TrackerParameters) -> tuple[Array, Array, Array, Array]:
    """Whose the measurements z (N, 2) m, R (N, 2, 2) m² are.

    Returns the likelihood (T, N) 1/m² of each for each track, zero outside its gate; and what
    `tracking.association.jipda.associated` makes of it.
    """
    likelihood = gated_likelihood(before.means, before.covariances, z, R, p.gate_probability)
    detection = p.detection(before.shown, len(z))
    return likelihood, *associated(likelihood, detection, p.clutter_density, before.existence)


def _at_once(before: Predicted, z: Array, R: Array, p: TrackerParameters) -> Corrected:
    likelihood, beta, given, existence = weighed(before, z, R, p)
    means, covariances = mixture_update((before.means, before.covariances), before.undetected, z, R, given)
    # A wide belief far off must not swallow newcomers: it explains only what it makes likelier than clutter.
    explained = p.detection_probability * likelihood.max(axis=0, initial=0.0) > p.clutter_density
    own = own_measurements(beta, p.seen) >= 0
    return Corrected(means, covariances, existence, beta[:, 0], own, np.argwhere(likelihood), explained)
