"""One UAV's tracker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaincinv

from tracking.absence import given_undetected
from tracking.camera import Camera, Pose
from tracking.compiled import Array
from tracking.evidence import Evidence, doubles
from tracking.identity import FIRST_BORN, UAVS, Message, born_id
from tracking.initiation import Initiator, Tentative
from tracking.jpda import association_probabilities, gated_likelihood, mixture_update
from tracking.kalman import Gaussian, NearlyConstantVelocity, information_form
from tracking.recovery import recoveries, sightings
from tracking.visibility import Forest, visible_samples

# Weights in the average of a UAV that looked where the person may be and saw nobody, and of one that did not look: the
# first counts only where nobody saw the person, the second only where nobody looked either.
_LOOKED, _UNSEEN = 1e-4, 1e-9


@dataclass(frozen=True, eq=False)
class Scan:
    """What one UAV measured at one instant."""

    uav: int
    time: float  # s
    pose: Pose  # of the camera
    measurements: Array  # (N, 2) m, on the ground
    covariances: Array  # (N, 2, 2) m²


@dataclass(frozen=True, eq=False)
class Track:
    """A person held by a tracker; the id is the same on all UAVs that agree on the track."""

    id: int
    belief: Gaussian


@dataclass(frozen=True)
class TrackerParameters:
    """What trackers assume of people, sensors and evidence."""

    motion: NearlyConstantVelocity  # over one scan
    detection_probability: float = 0.99  # of a person in plain view
    clutter_density: float = 1e-6  # false alarms per m²
    gate_probability: float = 0.9999
    confirm: tuple[int, int] = (2, 3)  # m of n scans
    delete: tuple[int, int] = (5, 5)  # m of n scans in which the person should have been seen
    expected: float = 0.9  # probability of being in plain view from which on a UAV should see the person
    seen: float = 0.1  # probability that a measurement is the person's from which on the person counts as seen
    double: int = 15  # scans of only shared measurements after which a track that equals another one ends
    absence_weight: float = 0.3  # exponent of the likelihood of seeing nobody; 0: an empty place is no evidence
    recovery_after: float = 1.0  # s unseen, after which somebody who turns up may be this person; inf: never
    max_variance: float = 400.0  # m², trace of the position's covariance beyond which a track says nothing and ends
    max_speed: float = 3.0  # of people, m/s
    fusion: str = "kla"

    def __post_init__(self) -> None:
        for name in ("detection_probability", "gate_probability", "expected", "seen"):
            if not 0.0 < (value := getattr(self, name)) < 1.0:
                raise ValueError(f"{name} must be in (0, 1), is {value}")
        if not self.clutter_density > 0.0:
            raise ValueError(f"clutter_density must be positive, is {self.clutter_density}")
        for name in ("confirm", "delete"):
            m, n = getattr(self, name)
            if not 1 <= m <= n <= 62:
                raise ValueError(f"{name} must be (m, n) with 1 <= m <= n <= 62, is ({m}, {n})")

    @cached_property
    def measurement_gate(self) -> float:
        """Squared distance of a measurement that `gate_probability` keeps (two degrees of freedom)."""
        return -2.0 * math.log(1.0 - self.gate_probability)

    @cached_property
    def match_gate(self) -> float:
        """Squared distance between two tracks of one person that `gate_probability` keeps (four)."""
        return float(2.0 * gammaincinv(2.0, self.gate_probability))


class Tracker:
    """Tracks people from one UAV's scans; `consensus.fuse` ends each scan, alone or with other UAVs.

    `initial` tracks hold at the time of the first scan. Their ids are below one million.

    Note: [Li22] leaves tracks to JPDA with initiation and deletion. Added here, each with a parameter that turns it
    off: a place seen empty moves the belief (`absence_weight`), somebody who turns up within reach of a lost person
    gets that person's track (`recovery_after`), tracks that share all measurements merge (`double`), and, as in the
    paper's code, a track of very large covariance ends (`max_variance`).
    """

    def __init__(
        self,
        uav: int,
        camera: Camera,
        forest: Forest,
        parameters: TrackerParameters,
        initial: Sequence[Track] = (),
    ) -> None:
        if not 0 <= uav < UAVS:
            raise ValueError(f"uav must be in [0, {UAVS}), is {uav}")
        known = sorted(initial, key=lambda track: track.id)
        ids = [track.id for track in known]
        if len(set(ids)) < len(ids) or (ids and not 0 <= ids[0] <= ids[-1] < FIRST_BORN):
            raise ValueError(f"ids of initial tracks must be distinct and in [0, {FIRST_BORN}), are {ids}")
        self.uav, self._camera, self._forest, self.parameters = uav, camera, forest, parameters
        self._time = -math.inf
        self._scans = 0
        self._ids = np.array(ids, dtype=np.int64)
        self._means = np.array([t.belief.mean for t in known], dtype=float).reshape(-1, 4)
        self._covariances = np.array([t.belief.covariance for t in known], dtype=float).reshape(-1, 4, 4)
        self._say = np.full(len(ids), _UNSEEN)  # weight of its belief in the fleet's average
        self._evidence = Evidence.at(-math.inf, len(ids))
        self._sightings = np.column_stack([self._means[:, :2], np.zeros(len(ids))])
        self._deleted: tuple[tuple[int, float], ...] = ()
        self._tentative: list[Tentative] = []
        self._waited = 0  # steps of motion since tentative tracks were last predicted
        self._initiator = Initiator(
            parameters.motion, parameters.confirm, parameters.measurement_gate, parameters.max_speed
        )

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Confirmed tracks by ascending id."""
        rows = zip(self._ids.tolist(), self._means, self._covariances, strict=True)
        return tuple(Track(id, Gaussian(mean.copy(), cov.copy())) for id, mean, cov in rows)

    @property
    def match_gate(self) -> float:
        """Largest squared distance at which tracks of different ids are taken for the same person."""
        return self.parameters.match_gate

    def step(self, scan: Scan) -> None:
        """Predict to the scan's time, associate, update, initiate."""
        p = self.parameters
        if scan.uav != self.uav:
            raise ValueError(f"a scan of UAV {scan.uav} was given to the tracker of UAV {self.uav}")
        self.coast(scan.time)
        elapsed, self._waited = self._waited, 0
        z, R = np.ascontiguousarray(scan.measurements), np.ascontiguousarray(scan.covariances)
        likelihood = gated_likelihood(self._means, self._covariances, z, R, p.gate_probability)
        samples = visible_samples(
            self._camera, scan.pose, self._means[:, :2], self._covariances[:, :2, :2], self._forest
        )
        visible = samples.mean(axis=1)
        plain = p.detection_probability * p.gate_probability
        # Where a measurement was made the view is free: only the chance of a miss depends on the whole belief.
        # So somebody who steps out from behind a tree earlier than foreseen is taken up at once.
        detection = np.full((len(likelihood), len(z) + 1), plain)
        detection[:, 0] *= visible
        beta = association_probabilities(likelihood, detection, p.clutter_density)
        # A wide belief far off must not swallow newcomers: it explains only what it makes likelier than clutter.
        unexplained = ~np.any(p.detection_probability * likelihood > p.clutter_density, axis=0)
        predicted = self._means, self._covariances
        undetected = given_undetected(predicted, samples, p.detection_probability, p.absence_weight)
        self._means, self._covariances = mixture_update(predicted, undetected, z, R, beta)
        self._say = np.maximum(1.0 - beta[:, 0], _UNSEEN + _LOOKED * visible)
        self._evidence = self._evidence.observed(scan.time, beta, visible >= p.expected, p.seen)
        born, self._tentative = self._initiator.step(self._tentative, z[unexplained], R[unexplained], elapsed=elapsed)
        self._append(born)

    def coast(self, time: float) -> None:
        """Predict to the time of a scan for which this UAV has no frame: it neither sees nor misses anybody."""
        if not time > self._time:
            raise ValueError(f"scan at {time} s is not after the last one at {self._time} s")
        elapsed = round((time - self._time) / self.parameters.motion.dt) if self._scans else 0
        self._time = time
        self._scans += 1
        self._waited += elapsed
        for _ in range(elapsed):
            self._means, self._covariances = self.parameters.motion.predict_all(self._means, self._covariances)

    def message(self, degree: int) -> Message:
        """What it says in the first round, given how many neighbours hear it."""
        q, omega = information_form(self._means, self._covariances)
        shares = np.concatenate([np.ones((len(q), 1)), q, omega.reshape(-1, 16)], axis=1)
        shares *= self._say[:, None]
        return Message(self.uav, degree, self._ids, shares, self._evidence, self._deleted)

    def accept(self, message: Message) -> None:
        """Take over the fleet's tracks, count its scan and end what it refutes."""
        p = self.parameters
        means, covariances = message.beliefs()
        evidence = message.evidence.counted(self._time, p.delete[1])
        refuted = evidence.refuted(p.delete[0])
        double = doubles(means, covariances, evidence.shared >= p.double, p.match_gate)
        refuted |= np.trace(covariances[:, :2, :2], axis1=1, axis2=2) > p.max_variance
        keep = ~(refuted | double)
        ended = dict(message.deleted)
        ended.update((id, self._time) for id in message.ids[refuted].tolist())
        ended.update((id, math.inf) for id in message.ids[double].tolist())
        self._deleted = tuple(sorted(ended.items()))
        before = dict(zip(self._ids.tolist(), self._sightings, strict=True))
        self._ids, self._evidence = message.ids[keep], evidence[keep]
        self._means, self._covariances = means[keep], covariances[keep]
        self._say = np.full(len(self._ids), _UNSEEN)
        here = np.column_stack([self._means[:, :2], np.full(len(self._ids), self._time)])
        unseen = self._evidence.times[:, 0] < self._time
        self._sightings = sightings(self._ids.tolist(), here, before, unseen)
        self._recover()

    def _recover(self) -> None:
        """Give tracks born in this scan the ids of lost tracks that they continue.

        All UAVs do this after they have agreed on tracks and sightings, so they decide alike.
        """
        p = self.parameters
        born = np.flatnonzero(self._ids >= born_id(self._scans, 0, 0))
        lost = np.flatnonzero(self._time - self._sightings[:, 2] >= p.recovery_after)
        if len(born) == 0 or len(lost) == 0:
            return
        pairs = recoveries(
            (self._means[born], self._covariances[born]),
            (self._means[lost], self._covariances[lost]),
            self._sightings[lost],
            now=self._time,
            max_speed=p.max_speed,
        )
        ids = self._ids.copy()
        for b, k in pairs:
            ids[born[b]] = self._ids[lost[k]]
        left = np.setdiff1d(np.arange(len(ids)), [lost[k] for _, k in pairs])
        order = left[np.argsort(ids[left])]
        self._ids, self._evidence, self._sightings = ids[order], self._evidence[order], self._sightings[order]
        self._means, self._covariances, self._say = self._means[order], self._covariances[order], self._say[order]

    def _append(self, born: Sequence[Gaussian]) -> None:
        if not born:
            return
        ids = [born_id(self._scans, self.uav, k) for k in range(len(born))]
        self._ids = np.append(self._ids, ids)
        self._means = np.concatenate([self._means, [b.mean for b in born]])
        self._covariances = np.concatenate([self._covariances, [b.covariance for b in born]])
        self._say = np.append(self._say, np.ones(len(born)))
        here = [[*b.mean[:2], self._time] for b in born]
        self._sightings = np.concatenate([self._sightings, here])
        self._evidence = self._evidence + Evidence.at(self._time, len(born))
