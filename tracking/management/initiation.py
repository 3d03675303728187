"""Track initiation: from measurements that no track explains to confirmed tracks."""

from dataclasses import dataclass

import numpy as np

from tracking.account import Origin
from tracking.filter.kalman import Gaussian
from tracking.filter.motion import predict_steps
from tracking.geometry.lens import Lens
from tracking.geometry.visibility import Forest, at_target_height, visible_samples
from tracking.measurement_update import Measured, ScanPrediction, ScanUpdate, update_scan
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import power
from tracking.parameters import TrackerParameters
from tracking.track import Beliefs

# s without a measurement after which a tentative track is deleted; a later one could be another person's
PATIENCE = 1.0


@dataclass(frozen=True, eq=False)
class Tentative:
    """Tentative track."""

    belief: Gaussian
    origins: tuple[Origin, ...]  # its measurements
    existence: float = 1.0  # probability
    scans: int = 1  # since its first measurement, which counts
    unseen: float = 0.0  # steps of motion since its last measurement


def initiate_tracks(
    tentative: list[Tentative],
    z: Array,
    R: Array,
    *,
    time: float,
    elapsed: float,
    forest: Forest,
    lens: Lens,
    p: TrackerParameters,
) -> tuple[list[Tentative], list[Tentative]]:
    """Confirmed and remaining tentative tracks after a scan.

    A track starts with the probability of existence birth_density / (birth_density + clutter_density). It is confirmed
    at `confirmation_threshold`, and ends below `deletion_threshold` times its start, or after `PATIENCE` s without a
    measurement. With m of n, it needs m measurements within its first n scans. A measurement counts if it is the
    track's with a probability above one half. Source: [Musicki04], [Williams15].

    z (N, 2) m: measurements that no track explains; R (N, 2, 2) m²: their covariances; time: of the scan [s]; elapsed:
    steps of motion since tentative tracks were last predicted; lens: the camera at its pose in the scan.
    """
    if not tentative and not len(z):
        return [], []
    shares = forest.detectabilities_through_leaves(lens, at_target_height(z))
    before = _predict(tentative, elapsed, forest, lens, p)
    after = update_scan(before, Measured(z, R, shares, np.zeros(len(z))), p.association)
    grown = []
    for t, track in enumerate(tentative):
        j = _find_likeliest(after, t)
        grown.append(
            Tentative(
                Gaussian(after.means[t], after.covariances[t]),
                track.origins if j is None else (*track.origins, Origin(time, z[j])),
                float(after.existence[t]),
                track.scans + 1,
                track.unseen + elapsed if j is None else 0.0,
            )
        )
    grown += [_begin(Origin(time, z[j]), R[j], p) for j in np.flatnonzero(~after.explained).tolist()]
    verdicts = [(t, _decide(t, p)) for t in grown]
    return [t for t, confirmed in verdicts if confirmed], [t for t, confirmed in verdicts if confirmed is None]


def _find_first_existence(p: TrackerParameters) -> float:
    return p.settings.birth_density / (p.settings.birth_density + p.settings.clutter_density)


def _begin(origin: Origin, R: Array, p: TrackerParameters) -> Tentative:
    """Track of a single measurement with covariance R (2, 2) m².

    Its mean velocity is zero. The variance along each axis, `max_speed`² / 4, is that of velocities spread evenly over
    the disc of radius `max_speed` m/s.
    """
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = R
    covariance[2, 2] = covariance[3, 3] = p.settings.max_speed * p.settings.max_speed / 4
    belief = Gaussian(np.array([*origin.place, 0.0, 0.0]), covariance)
    return Tentative(belief, (origin,), 1.0 if p.settings.management == "m_of_n" else _find_first_existence(p))


def _decide(track: Tentative, p: TrackerParameters) -> bool | None:
    """True if the track is confirmed, False if it ends, None if it stays tentative."""
    if p.settings.management == "m_of_n":
        m, n = p.settings.confirm
        hits = len(track.origins)
        if hits >= m:
            return True
        return False if hits + n - track.scans < m else None
    if track.existence >= p.settings.confirmation_threshold:
        return True
    late = track.unseen > round(PATIENCE / p.motion.dt)
    return False if late or track.existence < p.settings.deletion_threshold * _find_first_existence(p) else None


def _predict(
    tentative: list[Tentative], elapsed: float, forest: Forest, lens: Lens, p: TrackerParameters
) -> ScanPrediction:
    """Prediction of tentative tracks to a scan."""
    means = np.array([t.belief.mean for t in tentative]).reshape(-1, 4)
    covariances = np.array([t.belief.covariance for t in tentative]).reshape(-1, 4, 4)
    means, covariances = predict_steps(p.motion, means, covariances, elapsed)
    existence = np.array([t.existence for t in tentative], dtype=float) * power(p.step_survival, elapsed)
    detectable = visible_samples(forest, means, covariances, lens)[:, 0].mean(axis=1)
    return ScanPrediction(means, covariances, Beliefs(means, covariances), existence, detectable, detectable)


def _find_likeliest(after: ScanUpdate, t: int) -> int | None:
    """The measurement that is the likeliest one of track t; None if the track has probably none."""
    if after.missed[t] >= 0.5:
        return None
    own = after.gates[:, 0] == t
    return int(after.gates[own, 1][after.weights[own].argmax()])
