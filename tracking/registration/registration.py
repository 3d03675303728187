"""Registration of a fleet: errors of poses estimated from the people that UAVs see, and what they add to tracks."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tracking.filter.kalman import Gaussian
from tracking.filter.motion import MotionModel, count_steps, predict_steps
from tracking.navigation import Navigation
from tracking.numerics.arrays import Array
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import gaussian_costs, squared_distance
from tracking.numerics.exponential import log
from tracking.numerics.factorisation import inverses
from tracking.numerics.matrices import apply, product
from tracking.registration.pose_errors import ERRORS, ErrorModel, error_slopes, sandwich
from tracking.track import Scan, Track, beliefs_of

_OTHERS = 1e-3  # 1/m², density of people without a track
_SUREST = -2.0 * log(_OTHERS * math.tau)  # largest of `gaussian_costs` of a measurement that is likelier the track's
_LAG = 0.4  # m, deviation by which tracks are off, scan after scan alike, because people do not move as predicted
_OWN = 0.8  # share of a track from which on it has the errors of the UAVs that see it
_UNKNOWN = 10.0  # m, deviation of a place of which nothing is known


class _Residual(NamedTuple):
    """A measurement near the predicted track of a person."""

    track: int  # row
    block: slice  # of the errors of its UAV
    slopes: Array  # (2, 7 n) of the measurement by all errors
    z: Array  # (2,) m
    R: Array  # (2, 2) m²
    sole: bool  # it can be of no other track, and no other measurement can be of this one


class _Rows(NamedTuple):
    """Beliefs of T tracks as if no errors of poses were left, and what such errors do to them."""

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    sensitivities: Array  # (T, 4, 7 n) to the errors that are left
    shifts: Array  # (T, 4), error that has become known since

    def take(self, r: _Residual, errors: Array) -> None:
        """Update a track with a measurement that is corrected by estimated errors."""
        t, P = r.track, self.covariances[r.track].copy()
        gain = product(P[:, :2], inverses((P[:2, :2] + r.R)[None])[0])
        self.means[t] += apply(gain, r.z - apply(r.slopes, errors) - self.means[t, :2])
        self.covariances[t] = P - product(gain, P[:2])
        self.sensitivities[t] += product(gain, r.slopes - self.sensitivities[t, :2])
        self.shifts[t] -= apply(gain, self.shifts[t, :2])


class Registration:
    """What one UAV knows of the errors of all poses of its fleet, by a two-stage Kalman filter ([Friedland69]).

    Trackers filter measurements corrected by the estimated errors, as if none were left. The sensitivity of a track is
    what it has taken over of the errors left. So a residual measures these errors without counting anything twice, and
    a track is told with its whole error. What all UAVs have in common shows only in tracks of known people.
    """

    def __init__(
        self, navigations: Sequence[Navigation], initial: Sequence[Track], gate: float, *, learns: bool = True
    ) -> None:
        """`gate`: squared distance within which a measurement may be of a track.

        learns: False to add the errors to the covariances of measurements, as if they were new at each scan.
        """
        self._models, self.learns, self._gate = [ErrorModel(n) for n in navigations], learns, gate
        self._variances = np.concatenate([model.variances for model in self._models])
        size = len(self._variances)
        self.errors, self.covariance = np.zeros(size), np.diag(self._variances)
        self._time = 0.0  # s, of the last scan
        self._seen: dict[int, tuple[float, Array]] = {}  # time [s] and place (2,) m of each UAV's last scan
        self._velocities: dict[int, Array] = {}  # (2,) m/s, of each UAV's camera at its last scan
        self._near: list[tuple[Array, Array]] = []  # places (N, 2) m and slopes (N, 2, 7 n) of the last measurements
        self._tracks = {track.id: (np.zeros((4, size)), np.zeros(4)) for track in initial}

    def observe(self, time: float, scans: Mapping[int, Scan], tracks: Sequence[Track], motion: MotionModel) -> None:
        """Learn from this UAV's scan and those that it received, given its tracks at the time of the last scan."""
        self._follow(scans)
        elapsed, self._time = time - self._time, time
        if not self.learns:
            return
        kept = np.concatenate([model.correlation(elapsed) for model in self._models])
        self.errors = kept * self.errors
        self.covariance = kept[:, None] * self.covariance * kept + np.diag(self._variances * (1.0 - kept * kept))
        rows = self._predict(tracks, motion, elapsed)
        self._near = []
        residuals = [residual for scan in scans.values() for residual in self._find_residuals(scan, rows)]
        before = self.errors
        self._learn(residuals, rows)
        rows.shifts[:] += apply(rows.sensitivities, self.errors - before)
        for residual in residuals:
            rows.take(residual, self.errors)
        parts = zip(tracks, rows.sensitivities, rows.shifts, strict=True)
        self._tracks = {track.id: (sensitivity, shift) for track, sensitivity, shift in parts}

    def correct(self, scan: Scan) -> Scan:
        """A scan of the time of the last `observe` without the errors that are known of it."""
        slopes, model = self._find_slopes(scan), self._models[scan.uav]
        added = sandwich(slopes, np.diag(model.noise if self.learns else model.noise + model.variances))
        known = apply(slopes, self.errors[_block(scan.uav)])
        return replace(scan, measurements=scan.measurements - known, covariances=scan.covariances + added)

    def tell(self, tracks: Sequence[Track]) -> tuple[Track, ...]:
        """Tracks after the scan of the last `observe`, with the errors of poses that they have taken over."""
        if not self.learns:
            return tuple(tracks)
        self._tracks = {track.id: self._tracks.get(track.id) or self._begin(track) for track in tracks}
        told = []
        for track in tracks:
            sensitivity, shift = self._tracks[track.id]
            whole = track.belief.covariance + sandwich(sensitivity[None], self.covariance)[0]
            told.append(replace(track, belief=Gaussian(track.belief.mean - shift, 0.5 * (whole + whole.T))))
        return tuple(told)

    def _follow(self, scans: Mapping[int, Scan]) -> None:
        """Find the velocities of cameras since their last scans."""
        for uav, scan in scans.items():
            place = scan.pose.position[:2]
            time, before = self._seen.get(uav, (-math.inf, place))
            self._velocities[uav] = (place - before) / (scan.time - time)
            self._seen[uav] = scan.time, place

    def _find_slopes(self, scan: Scan) -> Array:
        """Derivatives (N, 2, 7) of a scan's measurements by the errors of its UAV."""
        return error_slopes(scan.measurements, scan.pose, self._velocities[scan.uav])

    def _predict(self, tracks: Sequence[Track], motion: MotionModel, elapsed: float) -> _Rows:
        means, covariances = beliefs_of(tracks)
        if tracks:
            means, covariances = predict_steps(motion, means, covariances, count_steps(motion, elapsed))
        known = [self._tracks[track.id] for track in tracks]
        sensitivities = np.array([part for part, _ in known]).reshape(-1, 4, len(self.errors))
        shifts = np.array([part for _, part in known]).reshape(-1, 4)
        for part in (sensitivities, shifts):
            part[:, :2] += elapsed * part[:, 2:]
        return _Rows(np.array(means), np.array(covariances), sensitivities, shifts)

    def _find_residuals(self, scan: Scan, rows: _Rows) -> list[_Residual]:
        """The nearest pairs of tracks and measurements, within the gate."""
        block, z = _block(scan.uav), scan.measurements
        slopes = np.zeros((len(z), 2, len(self.errors)))
        slopes[:, :, block] = self._find_slopes(scan)
        corrected = z - apply(slopes, self.errors)
        self._near.append((corrected, slopes))
        R = scan.covariances + sandwich(slopes[:, :, block], np.diag(self._models[scan.uav].noise))
        places = (rows.means - rows.shifts)[:, :2]
        if not len(z) or not len(places):
            return []
        S = sandwich(slopes[None] - rows.sensitivities[:, None, :2], self.covariance)
        S += rows.covariances[:, None, :2, :2] + R[None]
        away = corrected[None] - places[:, None]
        distance = squared_distance(away, S)
        # A measurement teaches only if it is likelier to be of the track's person than of one without a track.
        sole, within = gaussian_costs(away, S) < _SUREST, distance <= self._gate
        sole &= (within.sum(axis=1, keepdims=True) == 1) & (within.sum(axis=0) == 1)
        found = []
        for t, j in pairs_within(distance, self._gate):
            # At the measurement, its noise would be in both slopes and residual, and bias the height.
            at = np.zeros((2, len(self.errors)))
            at[:, block] = error_slopes(places[t : t + 1], scan.pose, self._velocities[scan.uav])[0]
            found.append(_Residual(t, block, at, z[j], R[j], bool(sole[t, j])))
        return found

    def _learn(self, residuals: Sequence[_Residual], rows: _Rows) -> None:
        """Learn from the residuals of one scan.

        A track's lag behind its person would pass for errors of poses. So where UAVs see a track of their own, only the
        differences of their measurements teach. Other tracks teach until the errors are as well known as tracks are.
        Covariances with axes by the measurement itself, as of [Li22] eq. (4), would bias the residuals, as well.
        """
        rows = _Rows(*(part.copy() for part in rows))
        shares = np.zeros(len(rows.means))  # of each track that is from the UAVs that see it now
        for r in residuals:
            shares[r.track] += np.trace(rows.sensitivities[r.track, :2, r.block]) / 2.0
        for t, a in np.ndindex(len(rows.means), 2):
            rows.covariances[t, a, a] += _UNKNOWN * _UNKNOWN if shares[t] > _OWN else _LAG * _LAG
        taken = set[int]()
        for given in residuals:
            r, t = given._replace(R=np.trace(given.R) / 2.0 * np.eye(2)), given.track
            H = r.slopes - rows.sensitivities[t, :2]
            PH = product(self.covariance, H.T)
            left = product(H, PH)
            own = shares[t] > _OWN
            if r.sole and (t in taken if own else np.trace(left) > 2.0 * _LAG * _LAG):
                nu = r.z - apply(r.slopes, self.errors) - (rows.means - rows.shifts)[t, :2]
                K = product(PH, inverses((left + rows.covariances[t, :2, :2] + r.R)[None])[0])
                change, P = apply(K, nu), self.covariance - product(K, PH.T)
                self.errors, self.covariance = self.errors + change, 0.5 * (P + P.T)
                rows.shifts[:] += apply(rows.sensitivities, change)
            rows.take(r, self.errors)
            taken.add(t)

    def _begin(self, track: Track) -> tuple[Array, Array]:
        """Sensitivity and shift of a new track: those of the nearest measurement."""
        nearest, found = math.inf, np.zeros((4, len(self.errors)))
        for places, slopes in self._near:
            for place, slope in zip(places, slopes, strict=True):
                east, north = (place - track.belief.mean[:2]).tolist()
                if east * east + north * north < nearest:
                    nearest, found[:2] = east * east + north * north, slope
        return found, np.zeros(4)


def _block(uav: int) -> slice:
    """The errors of a UAV among those of its fleet."""
    return slice(ERRORS * uav, ERRORS * (uav + 1))
