"""One UAV's tracker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.association.jipda import log_odds
from tracking.filter.kalman import Gaussian, information_form
from tracking.filter.negative_information import Moment, look
from tracking.fusion.hcmci import farthest, split
from tracking.fusion.message import FIRST_BORN, INFORMATION, UAVS, Message, aliases_of, born_id, is_birth
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, visible_samples
from tracking.management.deletion import Evidence, doubles
from tracking.management.initiation import Initiator, Tentative
from tracking.management.jipda_initiation import IntegratedInitiator
from tracking.management.reacquisition import recoveries
from tracking.management.validation import check_track, well_formed
from tracking.measurement_update import corrected, foreseen
from tracking.numerics.compiled import Array
from tracking.numerics.elementary import power
from tracking.parameters import TrackerParameters

__all__ = ["Scan", "Track", "Tracker", "TrackerParameters"]

# Weights in the average of a UAV that looked where the person may be and saw nobody, and of one that did not look: the
# first counts only where nobody saw the person, the second only where nobody looked either.
_LOOKED, _UNSEEN = 1e-4, 1e-9
_NOTHING = np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros((0, 2)), np.zeros((0, 2), dtype=np.int64)
_IN_TOUCH = 1.0  # s for which UAVs take themselves for one company without word of its leader


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
    existence: float = 1.0  # probability that there is somebody; 1 where life is m_of_n


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
        for t in known:
            check_track(t.id, t.belief, t.existence)
        self.uav, self._camera, self._forest, self.parameters = uav, camera, forest, parameters
        self._time = -math.inf
        self._scans = self._steps = 0  # scans so far, and steps of motion since the first one
        self._began = 0.0  # s, the time of the first scan
        self._looked: Moment | None = None  # when and from where it last had a frame
        self._ids = np.array(ids, dtype=np.int64)
        self._means = np.array([t.belief.mean for t in known], dtype=float).reshape(-1, 4)
        self._covariances = np.array([t.belief.covariance for t in known], dtype=float).reshape(-1, 4, 4)
        self._existence = np.array([t.existence for t in known], dtype=float)
        self._say = np.full(len(ids), _UNSEEN)  # weight of its belief in the fleet's average
        self._evidence = Evidence.at(-math.inf, len(ids))
        self._sightings = np.column_stack([self._means[:, :2], np.zeros(len(ids))])
        self._deleted: tuple[tuple[int, float], ...] = ()
        self._company = (0, -math.inf)  # at the start all are one, in what they know
        self._predicted = _NOTHING  # beliefs before the scan not yet fused, what it measured, and in which gates
        self._tentative: list[Tentative] = []
        self._waited = 0  # steps of motion since tentative tracks were last predicted
        self._initiator = (
            IntegratedInitiator(parameters)
            if parameters.life == "existence"
            else Initiator(parameters.motion, parameters.confirm, parameters.measurement_gate, parameters.max_speed)
        )

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Confirmed tracks by ascending id."""
        rows = zip(self._ids.tolist(), self._means, self._covariances, self._existence.tolist(), strict=True)
        return tuple(Track(id, Gaussian(mean.copy(), cov.copy()), r) for id, mean, cov, r in rows)

    @property
    def match_gate(self) -> float:
        """Largest squared distance at which tracks of different ids are taken for the same person."""
        return self.parameters.match_gate

    @property
    def max_speed(self) -> float:
        """Of people, m/s."""
        return self.parameters.max_speed

    def step(self, scan: Scan) -> None:
        """Predict to the scan's time, associate, update, initiate."""
        p = self.parameters
        if scan.uav != self.uav:
            raise ValueError(f"a scan of UAV {scan.uav} was given to the tracker of UAV {self.uav}")
        z, R = well_formed(scan.time, scan.pose, scan.measurements, scan.covariances)
        self.coast(scan.time)
        elapsed, self._waited = self._waited, 0

        def visible_at(means: Array, covariances: Array) -> NDArray[np.bool_]:
            return visible_samples(self._camera, scan.pose, means[:, :2], covariances[:, :2, :2], self._forest)

        beliefs = self._means, self._covariances
        now, last = (scan.time, scan.pose), self._looked
        self._looked = now
        certainty = p.detection_probability
        shows = look(self._camera, self._forest, beliefs, now=now, last=last, detection_probability=certainty)
        before = foreseen(beliefs, self._existence, *shows, p)
        after = corrected(before, z, R, p)
        self._predicted = *beliefs, z, after.gates
        self._means, self._covariances, self._existence = after.means, after.covariances, after.existence
        self._say = np.maximum(1.0 - after.nobody, _UNSEEN + _LOOKED * before.visible)
        seen, expected = after.nobody <= 1.0 - p.seen, before.visible >= p.expected
        self._evidence = self._evidence.observed(scan.time, seen, after.own, expected)
        left = ~after.explained
        born, self._tentative = self._initiator.step(
            self._tentative, z[left], R[left], elapsed=elapsed, visible=visible_at
        )
        self._append(born)

    def coast(self, time: float) -> None:
        """Predict to the time of a scan for which this UAV has no frame: it neither sees nor misses anybody."""
        if not time > self._time:
            raise ValueError(f"scan at {time} s is not after the last one at {self._time} s")
        # Steps since the first scan are rounded, not those since the last: times between steps do not add up to drift.
        began = self._began if self._scans else time
        steps = round((time - began) / self.parameters.motion.dt)
        elapsed = steps - self._steps
        self._time, self._began, self._steps = time, began, steps
        self._scans += 1
        self._waited += elapsed
        for _ in range(elapsed):
            self._means, self._covariances = self.parameters.motion.predict_all(self._means, self._covariances)
        self._existence = self._existence * power(self.parameters.step_survival, elapsed)

    def message(self, degree: int) -> Message:
        """What it says in the first round, given how many neighbours hear it."""
        held, novel, weights = self._parts()
        columns = [np.ones((len(held), 1)), held]
        if self.parameters.life == "existence":
            columns.append(log_odds(self._existence)[:, None])
        shares = np.concatenate(columns, axis=1) * weights[:, None]
        lost = np.flatnonzero(self._lost(self._sightings))
        leader, spoke = self._company
        aliases = aliases_of(self._ids, lost, self._scans, leader)
        alone = leader >= self.uav or self._time - spoke > _IN_TOUCH
        company = (self.uav, self._time) if alone else self._company
        return Message(
            self.uav, degree, self._ids, shares, self._evidence, self._deleted, aliases, self._sightings, novel, company
        )

    def _parts(self) -> tuple[Array, Array, Array]:
        """What is averaged (T, 20), what adds up, as `Message.novel`, and the weights of the average (T,).

        Note: what it means to have seen nobody is averaged, not added up. Seeing a place empty twice says no more than
        seeing it empty once, and the UAVs that looked have the same to say.
        The weights of prior beliefs fall with their uncertainty, as in [Niehsen02]: where UAVs come together, those who
        lost sight of a person do not dilute what the others know.
        """
        p = self.parameters
        q, omega = information_form(self._means, self._covariances)
        held = np.concatenate([q, omega.reshape(-1, 16)], axis=1)
        if p.fusion == "kla":
            return held, np.zeros((len(held), 0)), self._say
        novel = np.zeros((len(held), INFORMATION + self.uav + 1))
        spread = np.trace(self._covariances[:, :2, :2], axis1=1, axis2=2)
        means, covariances, z, gates = self._predicted
        seen = np.flatnonzero(self._say[: len(means)] >= p.seen)
        if len(seen):
            reach = farthest(means, covariances, z, gates)[seen]
            means, covariances = means[seen], covariances[seen]
            spread[seen] = np.trace(covariances[:, :2, :2], axis1=1, axis2=2)
            held[seen], gained = split((means, covariances), (q[seen], omega[seen]), reach)
            novel[seen, :INFORMATION] = gained
            novel[seen, -1] = gained.any(axis=1)
        return held, novel, self._say / spread

    def accept(self, message: Message) -> None:
        """Take over the fleet's tracks, count its scan and end what it refutes."""
        p = self.parameters
        means, covariances = message.beliefs()
        evidence = message.evidence.counted(self._time, p.delete[1])
        existence = message.existence()
        refuted = existence < p.doubt if p.life == "existence" else evidence.refuted(p.delete[0])
        double = doubles(means, covariances, evidence.shared >= p.double, p.match_gate)
        double |= self._reborn(message, means, covariances)
        refuted |= np.trace(covariances[:, :2, :2], axis1=1, axis2=2) > p.max_variance
        keep = ~(refuted | double)
        # Forgotten when it cannot matter: a part of the fleet cut off for longer than that may bring a track back,
        # which then ends as it did before.
        ended = {id: until for id, until in message.deleted if self._time - until <= p.forget_after}
        ended.update((id, self._time) for id in message.ids[refuted].tolist())
        ended.update((id, self._time + p.forget_after) for id in message.ids[double].tolist())
        self._deleted = tuple(sorted(ended.items()))
        if message.met and self._company[1] > -math.inf:
            # Two tracks in one place, of the same person if each company has one, must show next that they are two.
            every = np.ones(len(means), dtype=np.bool_)
            beside = doubles(means[:, :2], covariances[:, :2, :2], every, p.measurement_gate)
            evidence = evidence.watched(beside, p.double)
        self._ids, self._evidence = message.ids[keep], evidence[keep]
        self._means, self._covariances, self._existence = means[keep], covariances[keep], existence[keep]
        self._say = np.full(len(self._ids), _UNSEEN)
        self._predicted, self._company = _NOTHING, message.company
        here = np.column_stack([self._means[:, :2], np.full(len(self._ids), self._time)])
        unseen = self._evidence.times[:, 0] < self._time
        self._sightings = np.where(unseen[:, None], message.sightings[keep], here)
        self._recover()

    def _reborn(self, message: Message, means: Array, covariances: Array) -> NDArray[np.bool_]:
        """Tracks born in this scan of people whose lost tracks another UAV took up again in the same scan (T,).

        And those renamed in this scan, as beliefs did not agree for some UAV, that are the same as others after all.
        """
        newborn = is_birth(message.ids, self._scans)
        renamed = (message.ids >= born_id(self._scans, 0, 0)) & ~newborn
        found = doubles(means, covariances, renamed, self.parameters.match_gate)
        back = np.flatnonzero(self._lost(message.sightings) & (message.evidence.times[:, 0] >= self._time))
        for i in np.flatnonzero(newborn).tolist() if len(back) else ():
            rows = [*back.tolist(), i]
            found[i] = doubles(means[rows], covariances[rows], np.array(rows) == i, self.parameters.match_gate)[-1]
        return found

    def _lost(self, sightings: Array) -> NDArray[np.bool_]:
        """Whose last sighting, a row of (T, 3), is long ago (T,)."""
        unseen = self._time - sightings[:, 2]
        return np.asarray((unseen > 0.0) & (unseen >= self.parameters.recovery_after))

    def _recover(self) -> None:
        """Give tracks born in this scan the ids of lost tracks that they continue.

        All UAVs do this after they have agreed on tracks and sightings, so they decide alike.
        """
        p = self.parameters
        born = np.flatnonzero(is_birth(self._ids, self._scans))
        lost = np.flatnonzero(self._lost(self._sightings))
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
        order = left[np.argsort(ids[left], kind="stable")]
        self._ids, self._evidence, self._sightings = ids[order], self._evidence[order], self._sightings[order]
        self._means, self._covariances, self._say = self._means[order], self._covariances[order], self._say[order]
        self._existence = self._existence[order]

    def _append(self, born: Sequence[Tentative]) -> None:
        if not born:
            return
        ids = [born_id(self._scans, self.uav, k) for k in range(len(born))]
        self._ids = np.append(self._ids, ids)
        self._means = np.concatenate([self._means, [b.belief.mean for b in born]])
        self._covariances = np.concatenate([self._covariances, [b.belief.covariance for b in born]])
        self._say = np.append(self._say, np.ones(len(born)))
        self._existence = np.append(self._existence, [b.existence for b in born])
        here = [[*b.belief.mean[:2], self._time] for b in born]
        self._sightings = np.concatenate([self._sightings, here])
        self._evidence = self._evidence + Evidence.at(self._time, len(born))
