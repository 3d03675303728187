"""Registration of one UAV: what its tracker knows about the errors of the camera's pose."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import rotate
from tracking.navigation import NAVIGATION, Navigation
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.exponential import log
from tracking.numerics.factorisation import inverses
from tracking.numerics.matrices import apply, product
from tracking.registration.own_motion import Odds, OwnMotion
from tracking.registration.pose_errors import CLOCK, ERRORS, error_slopes, move_to_believed, sandwich
from tracking.track import Beliefs, Scan

_SURE = 0.9  # least probability of an association whose residual is used for the pose
_TRACK_TIME = 1.0  # s for which the error of a track stays about the same


# Densities (N,) 1/m² of measurements (N, 2) m of covariances (N, 2, 2) m², as tracks and new people explain them
Explain = Callable[[Array, Array], Array]


class _Residual(NamedTuple):
    """A measurement that is surely of a track, before fusion."""

    id: int
    covariance: Array  # (4, 4), of the track before the scan
    offset: Array  # (2,) m, of the measurement from the track
    noise: Array  # (2, 2) m², covariance without the errors of the pose that stay
    inflated: Array  # (2, 2) m², as the tracker has it
    slopes: Array  # (2, 7)


def make_registration(navigation: Navigation, pose_errors: str, *, known: bool) -> "Registration | None":
    """Registration as `tracking.pose_errors` says; None if there is nothing to register.

    known: True if the fleet knows at the start where people are.
    """
    if pose_errors == "ignore" or navigation == NAVIGATION["exact"]:
        return None
    return Registration(navigation, estimates=pose_errors == "estimate", known=known)


class Registration:
    """Kalman filter of the errors of a camera's pose, relative to the poses that the fleet's tracks imply.

    Its measurements are the differences between a scan and the tracks. Tracks contain earlier scans with the same pose
    errors, so each track has a cross-covariance C with them, which follows from the gains of the fused track
    ([Schmidt66]). For the tracker the remaining errors are noise of measurements; without estimation all errors are.

    A lost fix, after which the believed positions jump, moves the error at once, as far as the scan makes the jump
    likely. Only velocities that `OwnMotion` tells from noise teach the offset of the clock.

    Note: what would need the other UAVs' filters is approximate. Their filters are assumed to be like this one, and to
    drift apart; residuals within `_TRACK_TIME` count as one, because tracks of the fleet depend on one another. Bias
    and drift of an angle are one state with one correlation over a scan, the correlation of their sum. So a bias is
    forgotten too soon: of `consumer` tilts 0.91 is kept over 40 s and 0.50 over 300 s, instead of 0.93 and 0.86.
    A jump is found in the scan after it, or not at all; the altitude is assumed not to jump.
    """

    def __init__(self, navigation: Navigation, *, estimates: bool, known: bool) -> None:
        """Begin with the figures; `known` as in `make_registration`."""
        self._navigation = navigation
        self._estimates = estimates
        self._known = known
        self._stay = np.square([*navigation.biases, navigation.clock_deviation])
        self._vary = np.square([*navigation.drifts, 0.0])
        self.errors = np.zeros(ERRORS)
        self.covariance = np.diag(self._stay + self._vary)
        self._common: Array | None = None  # (7, 7), covariance of what the whole fleet shares, which no residual shows
        self._crosses: dict[int, Array] = {}  # C (4, 7) of the state of each track and the errors
        self._pose = Pose.level(0.0, 0.0, 0.0)  # of the last scan, corrected
        self._time = -np.inf  # s, of the last scan
        self._fleet = 1  # number of UAVs that fuse
        self._same = 1.0  # number of scans within `_TRACK_TIME`
        self._motion: OwnMotion | None = None  # believed, up to the last scan
        self._velocity = np.zeros(2)  # m/s
        self._acceleration = np.zeros(2)  # m/s²
        self._residuals: list[_Residual] = []
        self._noise = np.zeros((0, 2, 2))  # m², covariances of the last scan without the errors of the pose that stay

    def correct(self, scan: Scan, explain: Explain | None = None) -> Scan:
        """A scan seen from the estimated pose, with covariances that include the errors of the pose.

        explain: what tracks, predicted to the scan, make of its measurements; without it they do not tell of jumps.
        """
        place = scan.pose.position[:2]
        velocity_variance = self._predict(scan.time, place)
        pose, z, clock = scan.pose, scan.measurements, self.errors[CLOCK]
        if self._estimates:
            # The believed velocity is that at the offset of the clock.
            moved = clock * (self._velocity - clock * self._acceleration)
            back = self.errors[:3] + np.append(moved, 0.0)
            pose = Pose(pose.position - back, rotate(pose.quaternion, -self.errors[3:CLOCK], 1.0))
            seen = move_to_believed(z, scan.pose, pose)
            z = np.where(np.isnan(seen), z, seen)  # above the horizon
        bent = np.sqrt(3.0) * self.covariance[CLOCK, CLOCK] * self._acceleration  # m, what is not linear in the offset
        noise = np.diag(np.square([*self._navigation.noises, 0.0]))
        noise[[0, 1], [0, 1]] += (clock**2 + self.covariance[CLOCK, CLOCK]) * velocity_variance
        slopes = self._find_slopes(pose, z)
        self._noise = scan.covariances + sandwich(slopes, noise) + np.outer(bent, bent)
        covariances = self._noise + sandwich(slopes, self.covariance)
        if self._motion is None:
            self._motion = OwnMotion.start(place, self._navigation)
        else:
            odds = self._motion.judge(place)
            if self._estimates and self._navigation.horizontal_drift > 0.0:
                odds, moved = self._follow_jump(place, z, covariances, explain)
                pose = Pose(pose.position - np.append(moved, 0.0), pose.quaternion)
                z = z - moved
                covariances = self._noise + sandwich(slopes, self.covariance)
            self._motion = self._motion.update(place, odds)
        self._pose = pose
        return replace(scan, pose=pose, measurements=z, covariances=covariances)

    def _follow_jump(self, place: Array, z: Array, R: Array, explain: Explain | None) -> tuple[Odds, Array]:
        """Add a jump of the position to its error as far as the jump is likely; returns the odds and what is added, m.

        A jump moves all of a scan's measurements z (N, 2) m alike, of covariances R (N, 2, 2) m². The two hypotheses
        are merged to one Gaussian by their moments.
        """
        assert self._motion is not None
        size, variance = self._motion.find_jump(place)
        ratio = 0.0
        if explain is not None:
            stayed, jumped = explain(z, R), explain(z - size, R + variance * np.eye(2))
            ratio = sum(log(b) - log(a) for a, b in zip(stayed.tolist(), jumped.tolist(), strict=True))
        odds = self._motion.judge(place, ratio)
        moved = odds.jump * size
        self.errors = self.errors + np.append(moved, np.zeros(ERRORS - 2))
        self.covariance = self.covariance.copy()
        self.covariance[:2, :2] += odds.jump * (variance * np.eye(2) + (1.0 - odds.jump) * np.outer(size, size))
        return odds, moved

    def _find_slopes(self, pose: Pose, points: Array) -> Array:
        """Derivatives (N, 2, 7) of measurements at points (N, 2) m by the errors, near what is known of these."""
        return error_slopes(points, pose, self._velocity - 2.0 * self.errors[CLOCK] * self._acceleration)

    def _predict(self, time: float, place: Array) -> float:
        """Predict the errors to a scan; drifts lose their correlation, and what has no drift keeps it.

        Returns the variance [m²/s²] of the velocity along an axis, of which place (2,) m tells something.
        """
        elapsed, variance = time - self._time, 0.0
        self._time = time
        if self._motion is not None:
            self._motion = motion = self._motion.predict(elapsed)
            self._velocity, self._acceleration = motion.reliability * motion.mean[1:]
            variance = motion.find_velocity_variance(motion.judge(place))
            self._same = max(_TRACK_TIME / elapsed, 1.0)
            whole = self._stay + self._vary
            kept = np.append(self._navigation.kept(elapsed), 1.0)
            kept = (self._stay + kept * self._vary) / np.where(whole > 0.0, whole, 1.0)
            new = np.diag(whole * (1.0 - kept * kept)) * self._estimates
            if self._estimates:
                self.errors = kept * self.errors
                self.covariance = kept[:, None] * self.covariance * kept + new
            F = np.eye(4) + elapsed * np.eye(4, k=2)  # of people
            self._crosses = {id: product(F, cross) * kept for id, cross in self._crosses.items()}
            if self._common is not None:
                self._common = kept[:, None] * self._common * kept + new
        return variance

    def note(self, ids: Indices, beliefs: Beliefs, scan: Scan, gates: Indices, weights: Array) -> None:
        """Note how a corrected scan was associated with tracks.

        ids (T,) and beliefs of tracks before the scan; scan: the corrected one; gates (G, 2): pairs of a track and a
        measurement in its gate; weights (G,): probabilities that the measurement is the person's.
        """
        slopes = self._find_slopes(scan.pose, scan.measurements)
        self._residuals = [
            _Residual(
                int(ids[t]),
                beliefs.covariances[t],
                scan.measurements[j] - beliefs.means[t, :2],
                self._noise[j],
                scan.covariances[j],
                slopes[j],
            )
            for t, j in gates[weights > _SURE].tolist()
        ]

    def learn(self, ids: Indices, covariances: Array, fleet: int) -> None:
        """Update by the residuals noted; ids (T,) and covariances (T, 4, 4) of the tracks after fusion.

        fleet: number of UAVs that fuse, this one included.
        """
        residuals, self._residuals, self._fleet = self._residuals, [], fleet
        if not self._estimates:
            return
        if self._common is None:
            spread = (self._stay + self._vary) / fleet
            if self._known:  # known people show these errors, but those of clocks too late if UAVs fly alike
                spread[:CLOCK] = 0.0
            self._common = np.diag(spread)
        fused = dict(zip(ids.tolist(), covariances, strict=True))
        self._crosses = {id: cross for id, cross in self._crosses.items() if id in fused}
        noted = self.errors
        for residual in residuals:
            if residual.id in fused:
                offset = residual.offset - apply(residual.slopes, self.errors - noted)
                self._update(residual._replace(offset=offset), fused[residual.id])

    def _update(self, residual: _Residual, posterior: Array) -> None:
        """Update the errors and the cross-covariances by one residual; posterior (4, 4): of its track after fusion."""
        id, P, offset, R, inflated, G = residual
        B, C = self.covariance, self._crosses.pop(id, np.zeros((4, ERRORS)))
        BG, CG = product(B, G.T), product(C, G.T)  # (7, 2), (4, 2)
        whole = P + self._find_shared(C, _invert(B))
        S = whole[:2, :2] + CG[:2] + CG[:2].T + product(G, BG) + R + (self._same - 1.0) * (P[:2, :2] + R)
        with_error = C[:2].T + BG  # (7, 2), covariance of the errors with the residual
        K = product(with_error, inverses(0.5 * (S + S.T)[None])[0])
        # The error of the fused track is D times the error of the track before, less L times the measurement's error.
        L = product(posterior[:, :2], inverses(inflated[None])[0])
        D = product(posterior, inverses(P[None])[0])
        with_fused = product(D, whole[:, :2] + CG) - product(L, product(G, BG) + CG[:2].T + R)
        self.errors = self.errors + apply(K, offset)
        B = B - product(K, with_error.T)
        self.covariance = 0.5 * (B + B.T)
        self._crosses = {other: held - product(product(held, G.T), K.T) for other, held in self._crosses.items()}
        self._crosses[id] = product(D, C) - product(L, BG.T) - product(with_fused, K.T)

    def _find_shared(self, cross: Array, inverse: Array) -> Array:
        """Covariance (4, 4) of a track by the errors of the poses of the fleet, which the tracker takes for noise."""
        return np.asarray(self._fleet * product(product(cross, inverse), cross.T))

    def find_added(self, ids: Sequence[int], means: Array) -> Array:
        """Covariances (T, 4, 4) that tracks with means (T, 4) have in addition, as errors of poses stay."""
        added = np.zeros((len(ids), 4, 4))
        if self._common is None or not len(ids):
            return added
        added[:, :2, :2] = sandwich(self._find_slopes(self._pose, means[:, :2]), self._common)
        inverse = _invert(self.covariance)
        for t, id in enumerate(ids):
            if id in self._crosses:
                added[t] += self._find_shared(self._crosses[id], inverse)
        return added


def _invert(B: Array) -> Array:
    """Inverse (7, 7) of a covariance, in which some errors may be known."""
    return np.asarray(inverses((B + 1e-12 * np.eye(ERRORS))[None])[0])
