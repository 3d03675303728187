"""Track initiation: from measurements that no track explains to confirmed tracks."""

from dataclasses import dataclass

import numpy as np

from tracking.filter.kalman import Gaussian
from tracking.geometry.lens import Lens
from tracking.geometry.visibility import Forest, visible_samples
from tracking.measurement_update import ScanPrediction, scan_update
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.exponential import power
from tracking.parameters import TrackerParameters

PATIENCE = 1.0  # s without a measurement after which a tentative track ends; a later one could be another person's


@dataclass(frozen=True, eq=False)
class Tentative:
    """Tentative track; its first measurement counts as a hit."""

    belief: Gaussian
    existence: float = 1.0  # probability
    hits: int = 1
    scans: int = 1
    unseen: int = 0  # steps of motion since its last measurement


def initiated(
    tentative: list[Tentative], z: Array, R: Array, *, elapsed: int, view: tuple[Forest, Lens], p: TrackerParameters
) -> tuple[list[Tentative], list[Tentative]]:
    """Confirmed and remaining tentative tracks after a scan, which is `elapsed` steps of motion later.

    z (N, 2) m, R (N, 2, 2) m²: measurements that no track explains; view: map of trees, and the camera of the scan.
    A track starts with the probability of existence birth_density / (birth_density + clutter_density). It is confirmed
    at `confirmation_threshold`, and ends below `deletion_threshold` times its start, or after `PATIENCE` s without a
    measurement. With m of n, it needs m measurements within its first n scans. A measurement counts if it is the
    track's with a probability above one half. Source: [Musicki04], [Williams15].
    """
    if not tentative and not len(z):
        return [], []
    grown, known = _updated(tentative, z, R, (elapsed, view), p)
    grown += [_started(z[j], R[j], p) for j in np.flatnonzero(~known).tolist()]
    verdicts = [(t, _verdict(t, p)) for t in grown]
    return [t for t, confirmed in verdicts if confirmed], [t for t, confirmed in verdicts if confirmed is None]


def _start(p: TrackerParameters) -> float:
    return p.birth_density / (p.birth_density + p.clutter_density)


def _started(z: Array, R: Array, p: TrackerParameters) -> Tentative:
    """Track at a measurement z (2,) m with covariance R (2, 2) m².

    Its mean velocity is zero. The variance along each axis, `max_speed`² / 4, is that of velocities spread evenly over
    the disc of radius `max_speed` m/s.
    """
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = R
    covariance[2, 2] = covariance[3, 3] = p.max_speed * p.max_speed / 4
    belief = Gaussian(np.array([z[0], z[1], 0.0, 0.0]), covariance)
    return Tentative(belief, 1.0 if p.management == "m_of_n" else _start(p))


def _verdict(track: Tentative, p: TrackerParameters) -> bool | None:
    """True if the track is confirmed, False if it ends, None if it stays tentative."""
    if p.management == "m_of_n":
        m, n = p.confirm
        if track.hits >= m:
            return True
        return False if track.hits + n - track.scans < m else None
    if track.existence >= p.confirmation_threshold:
        return True
    late = track.unseen > round(PATIENCE / p.motion.dt)
    return False if late or track.existence < p.deletion_threshold * _start(p) else None


def _updated(
    tentative: list[Tentative], z: Array, R: Array, step: tuple[int, tuple[Forest, Lens]], p: TrackerParameters
) -> tuple[list[Tentative], Flags]:
    """Tentative tracks after a scan, and flags (N,) of the measurements that they explain."""
    elapsed, (forest, lens) = step
    means = np.array([t.belief.mean for t in tentative]).reshape(-1, 4)
    covariances = np.array([t.belief.covariance for t in tentative]).reshape(-1, 4, 4)
    for _ in range(elapsed):
        means, covariances = p.motion.predict_all(means, covariances)
    existence = np.array([t.existence for t in tentative], dtype=float) * power(p.step_survival, elapsed)
    detectable = visible_samples(forest, (means, covariances), lens)[:, 0].mean(axis=1)
    before = ScanPrediction(means, covariances, (means, covariances), existence, detectable, detectable)
    after = scan_update(before, z, R, np.zeros(len(z)), p)
    seen = after.missed < 0.5
    rows = zip(tentative, after.means, after.covariances, seen, after.existence.tolist(), strict=True)
    grown = [
        Tentative(Gaussian(mean, covariance), r, t.hits + hit, t.scans + 1, 0 if hit else t.unseen + elapsed)
        for t, mean, covariance, hit, r in rows
    ]
    return grown, after.explained
