"""Tracker of one UAV: prediction, data association, measurement update, and management of tracks."""

import math
from collections.abc import Mapping, Sequence, Sized
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from itertools import accumulate

import numpy as np

from tracking.account import Association, Birth, Deletion, DeletionReason, Reacquisition, ScanAccount
from tracking.association.jpda import gated_likelihood
from tracking.filter.motion import count_steps, predict_steps
from tracking.fleet_scan import NO_FRAME, SHARED_WITHIN, Columns, Found, Views, adopt_tracks, take_scans
from tracking.fusion.exchange import NO_EVIDENCE, UNSEEN, Messenger, ScanEvidence
from tracking.fusion.hcmci import HybridConsensus
from tracking.fusion.message import FIRST_NEW_ID, IDS_PER_SCAN, UAVS, Message, is_new_id, new_id
from tracking.fusion.mixing import join_novel
from tracking.geometry.camera import Camera
from tracking.geometry.lens import Lens
from tracking.geometry.visibility import Forest
from tracking.management.deletion import find_duplicates
from tracking.management.initiation import Tentative, initiate_tracks
from tracking.management.input_check import check_scan, check_tracks
from tracking.management.reacquisition import find_lost_tracks, match_lost_tracks
from tracking.measurement_update import ScanPrediction, ScanUpdate
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.exponential import power
from tracking.numerics.matrices import apply
from tracking.parameters import SEEN, AssociationSettings, LossRule, ScanSettings, TrackerParameters
from tracking.registration.registration import make_registration
from tracking.track import (
    DETECTED_AT,
    SIGHTED_AT,
    Beliefs,
    Scan,
    Track,
    TrackTable,
    join_tables,
    make_table,
    make_tracks,
)

_MOST_NEW = IDS_PER_SCAN // 2  # largest number of new tracks in a scan
_NEW_FOR = 1.0  # s for which a new track takes the id of an older one of the same person
_NO_NOISE = np.zeros((0, 2, 2))  # of a scan without measurements


class Tracker:
    """Tracker of people from one UAV's scans. Each scan ends with `consensus.fuse`, alone or with other UAVs.

    Tracks are Bernoulli components: an id, a probability of existence, and a belief; people without a track are a
    Poisson process of constant density. Association probabilities are JPDA's. Source: [Williams15]; [Musicki04].
    `initial` tracks are of the time of the first scan, and have ids below one million.

    Note: [Li22] uses JPDA with initiation and deletion by m of n scans, as `management` = "m_of_n" does. This tracker
    adds `negative_information`, re-acquisition (`reacquire_after`) and, like the paper's code, deletion at very
    large covariance (`max_variance`). With "existence" it merges tracks of one person; with "m_of_n" only one of them
    gets detections, so that the others end. Detection always depends on the view.
    """

    def __init__(
        self, uav: int, camera: Camera, forest: Forest, parameters: TrackerParameters, initial: Sequence[Track] = ()
    ) -> None:
        """Start before the first scan.

        Args:
            uav: Number of the UAV.
            camera: Its camera.
            forest: The known map of trees.
            parameters: Settings of trackers, motion model and fusion rule.
            initial: Tracks of people who are known at the start.
        """
        if not 0 <= uav < UAVS:
            raise ValueError(f"uav must be in [0, {UAVS}), is {uav}")
        known = check_tracks(initial)
        if known and known[-1].id >= FIRST_NEW_ID:
            raise ValueError(f"ids of initial tracks must be below {FIRST_NEW_ID}, are up to {known[-1].id}")
        self.uav = uav
        self.parameters = parameters
        self.max_speed = parameters.settings.max_speed
        self._camera = camera
        self._forest = forest
        self.motion = parameters.motion  # as learned from the speeds of people that the fleet detected
        self.account = ScanAccount()  # of the last scan
        self._messenger = Messenger(uav, parameters)
        pose_errors = parameters.settings.pose_errors
        self._registration = make_registration(parameters.navigation, pose_errors, known=bool(known))
        self._first = 0.0  # time of the first scan [s]
        self._steps = 0.0  # of motion since then
        self._optics = camera.optics.numbers
        self._last_frame = NO_FRAME
        self._frames = self._last_frame, self._last_frame  # of this scan and before
        self._table = make_table(known, UNSEEN, -math.inf)
        self._tracks: tuple[Track, ...] | None = None  # of the table, once somebody has asked for them
        self._told: tuple[Indices, Array, Array] | None = None  # about a scan not yet fused
        self._tentative: list[Tentative] = []
        self._waited = 0.0  # steps of motion since tentative tracks were last predicted

    def copy(self) -> "Tracker":
        """As `Member.copy`; scans replace whatever they change, except for sightings in the first one."""
        made = copy(self)
        made._messenger, made._registration = copy(self._messenger), copy(self._registration)
        made._table = replace(self._table, sightings=self._table.sightings.copy())
        return made

    @cached_property
    def _shared(self) -> tuple[Forest, ScanSettings, AssociationSettings, LossRule, bool]:
        """What trackers that work together have in common."""
        p, adds_up = self.parameters, type(self._messenger.rule) is HybridConsensus
        return self._forest, p.scan, p.association, p.loss, adds_up

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Confirmed tracks by ascending id."""
        if self._tracks is None:
            table = self._table
            covariances = table.covariances
            if self._registration:
                covariances = covariances + self._registration.find_added(table.ids.tolist(), table.means)
            self._tracks = make_tracks(table.ids, table.means, covariances, table.existence, table.sightings)
        return self._tracks

    def step(self, scan: Scan) -> None:
        """Predict to the scan's time, associate, update, initiate."""
        if scan.uav != self.uav:
            raise ValueError(f"a scan of UAV {scan.uav} was given to the tracker of UAV {self.uav}")
        self.step_together([self], scan.time, {scan.uav: scan})

    def coast(self, time: float) -> None:
        """Predict to the time of a scan in which this UAV took no frame, which counts as neither hit nor miss."""
        self.step_together([self], time, {})

    @staticmethod
    def step_together(trackers: Sequence["Tracker"], time: float, scans: Mapping[int, Scan]) -> None:
        """Let trackers `step` with their scans at `time` s, by UAV, and the others `coast`."""
        one = trackers[0]
        if any(tracker._shared != one._shared for tracker in trackers):
            for tracker in trackers:
                Tracker.step_together([tracker], time, scans)
            return
        since = np.array([tracker._messenger.time for tracker in trackers])
        taken = [tracker._begin(time, scans.get(tracker.uav)) for tracker in trackers]
        table = join_tables([tracker._table for tracker in trackers])
        starts = _find_starts([tracker._table.ids for tracker in trackers])
        places = [scan.measurements if scan else NO_EVIDENCE.measurements for scan in taken]
        noise = [scan.covariances if scan else _NO_NOISE for scan in taken]
        found = Found(_find_starts(places), np.concatenate(places), np.concatenate(noise), since)
        optics, frames = (np.array([getattr(t, name) for t in trackers]) for name in ("_optics", "_frames"))
        forest, scan_settings, association, loss, adds_up = one._shared
        before, after, pairs, told = take_scans(
            starts,
            Columns(
                table.ids,
                table.means,
                table.covariances,
                table.existence,
                table.weights,
                table.times,
                table.views,
                table.sightings,
            ),
            Views(optics, frames, forest.occluders, forest.leaves),
            found,
            np.array([(tracker.uav, tracker._messenger.partition.leader) for tracker in trackers]),
            (time, SEEN),
            (scan_settings, association, loss),
        )
        table.means, table.covariances, table.existence = after[:3]
        for n, (tracker, scan) in enumerate(zip(trackers, taken, strict=True)):
            rows = slice(int(starts[n]), int(starts[n + 1]))
            tracker._table = table[rows]
            tracker._told = (told.keys[rows], told.shares[rows], told.novel[rows]) if adds_up else None
            if scan:
                of_this = partial(_select_association, tracker._table.ids, before, after, found, pairs, rows, n)
                tracker.account.find_association = of_this
                tracker._finish(scan, after.explained[found.starts[n] : found.starts[n + 1]])

    def _begin(self, time: float, scan: Scan | None) -> Scan | None:
        """Begin a scan: predict tracks to its time; returns the scan with the errors of the pose that are known."""
        if scan:
            z, R = check_scan(scan)
            if z is not scan.measurements or R is not scan.covariances:
                scan = replace(scan, measurements=z, covariances=R)
        self._predict(time)
        if scan is None:
            self._frames = NO_FRAME, self._last_frame
            return None
        if self._registration:
            scan = self._registration.correct(scan, self._explain)
        frame = time, *scan.pose.position.tolist(), *scan.pose.quaternion.tolist()
        self._frames, self._last_frame = (frame, self._last_frame), frame
        return scan

    def _finish(self, scan: Scan, explained: Flags) -> None:
        """Initiate tracks after the update by a scan; explained (N,): flags of measurements that tracks explain."""
        if self._registration:
            a = self.account.association
            assert a
            beliefs = Beliefs(a.before.means, a.before.covariances)
            self._registration.note(a.ids, beliefs, scan, a.after.gates, a.after.weights)
        if self._tentative or not explained.all():
            lens = self._camera.lens(scan.pose)
            self._initiate(lens, scan.measurements[~explained], scan.covariances[~explained])
        self._waited = 0.0

    def _initiate(self, lens: Lens, z: Array, R: Array) -> None:
        """Begin tracks of new people, from the measurements z (N, 2) m, R (N, 2, 2) m² that tracks do not explain."""
        time, elapsed, p = self._messenger.time, self._waited, self.parameters
        new, self._tentative = initiate_tracks(
            self._tentative, z, R, time=time, elapsed=elapsed, forest=self._forest, lens=lens, p=p
        )
        # Tracks for which there are no ids begin in the next scan.
        new, self._tentative = new[:_MOST_NEW], new[_MOST_NEW:] + self._tentative
        if new:
            ids = [new_id(self._messenger.scans, self.uav, k) for k in range(len(new))]
            self.account.births = [Birth(id, t.origins) for id, t in zip(ids, new, strict=True)]
            begun = [Track(id, t.belief, t.existence) for id, t in zip(ids, new, strict=True)]
            self._table, self._told = join_tables([self._table, make_table(begun, 1.0, time)]), None

    def _explain(self, z: Array, R: Array) -> Array:
        """Densities (N,) 1/m² of measurements z (N, 2) m, R (N, 2, 2) m² by the tracks, new people and clutter."""
        table, settings = self._table, self.parameters.settings
        likelihood = gated_likelihood(table.means, table.covariances, z, R, settings.gate_probability)
        others = settings.clutter_density + settings.birth_density
        return others + settings.detection_probability * apply(likelihood.T, table.existence)

    def _predict(self, time: float) -> None:
        """Predict tracks to a scan's time."""
        self._messenger.begin(time)
        self.account = ScanAccount()
        self._tracks = None
        if self._messenger.scans == 1:  # initial tracks are of this time
            self._first = time
            self._table.sightings[:, SIGHTED_AT] = time
        # Steps are counted since the first scan, not since the last one, so that no rounding adds up.
        steps = count_steps(self.motion, time - self._first)
        elapsed, self._steps = steps - self._steps, steps
        self._waited += elapsed
        table = self._table
        table.means, table.covariances = predict_steps(self.motion, table.means, table.covariances, elapsed)
        table.existence = table.existence * power(self.parameters.step_survival, elapsed)

    def message(self, degree: int) -> Message:
        """Message for the first round, to `degree` neighbours."""
        if self._told is None:
            a, evidence = self.account.association, NO_EVIDENCE
            if a:
                evidence = ScanEvidence(Beliefs(a.before.means, a.before.covariances), a.measurements, a.after.gates)
            self._told = self._messenger.tell(self._table, evidence)
        return self._messenger.message(degree, self._table, self._told)

    def accept(self, message: Message) -> None:
        """Take over the fleet's tracks; then merge, delete and re-acquire tracks, as all UAVs do alike."""
        self.accept_together([self], [message])

    @staticmethod
    def accept_together(trackers: Sequence["Tracker"], messages: Sequence[Message]) -> None:
        """Let trackers `accept` a message each."""
        one = trackers[0]
        if any(tracker._shared != one._shared for tracker in trackers):
            for tracker, message in zip(trackers, messages, strict=True):
                Tracker.accept_together([tracker], [message])
            return
        starts = _find_starts([message.ids for message in messages])
        columns = ("ids", "shares", "times", "views", "misses", "sightings")
        ids, shares, times, views, misses, sightings = (
            np.concatenate([getattr(m, name) for m in messages]) for name in columns
        )
        told = shares, join_novel(messages), times, views, misses, sightings
        found = adopt_tracks(starts, told, one._messenger.time, one._shared[1])
        means, covariances, existence, misses, sightings, unlikely, wide, counts = found
        weights = np.full(len(ids), UNSEEN)
        table = TrackTable(ids, means, covariances, existence, weights, times, views, misses, sightings)
        for n, (tracker, message, of) in enumerate(zip(trackers, messages, counts.tolist(), strict=True)):
            rows = slice(starts[n], starts[n + 1])
            if tracker._registration:
                tracker._registration.learn(message.ids, message.beliefs.covariances, 1 + message.degree)
            tracker._messenger.accept(message)
            tracker._told, tracker._tracks = None, None
            tracker._manage(table[rows], unlikely[rows], wide[rows], of)

    def _manage(self, table: TrackTable, unlikely: Flags, wide: Flags, counts: tuple[int, int, int]) -> None:
        """Merge, delete and re-acquire tracks, and learn their motion; arguments as in `Adopted`."""
        ends, rivals, detected = counts
        merged = self._merge_duplicates(table, ~(unlikely | wide)) if rivals > 1 else {}
        if merged or ends:
            table = self._delete(table, unlikely, wide, merged)
        self._table = table = self._reacquire(table)
        if detected and hasattr(self.motion, "learn"):
            seen = table.sightings[:, SIGHTED_AT] >= self._messenger.time
            self.motion = self.motion.learn(table.means[seen, 2:])

    def _merge_duplicates(self, table: TrackTable, among: Flags) -> dict[int, int]:
        """Merge tracks that share one person; returns the row of the track that goes on, by that of the other.

        among (T,): flags of the tracks that may be merged. The one that goes on gets the existence of both, and if it
        is new, the older id.
        """
        p, scans = self.parameters, self._messenger.scans
        # Tracks of hidden people may be close to each other without competing for a measurement.
        recent = table.times[:, DETECTED_AT] > self._messenger.time - SHARED_WITHIN
        beliefs = table.means, table.covariances
        merged: dict[int, int] = {}
        for kept, other in find_duplicates(beliefs, table.existence, among & recent, p.match_gate):
            table.existence[kept] = min(table.existence[kept] + table.existence[other], 1.0)
            merged[other] = kept
            if table.ids[kept] >= new_id(max(scans - round(_NEW_FOR / p.motion.dt), 1), 0, 0):
                table.ids[[kept, other]] = np.sort(table.ids[[kept, other]])
        return merged

    def _delete(self, table: TrackTable, unlikely: Flags, wide: Flags, merged: Mapping[int, int]) -> TrackTable:
        """The table without its unlikely, wide and merged tracks, which the account and the next message name."""
        gone = unlikely | wide
        gone[list(merged)] = True
        self._messenger.delete(table.ids[gone].tolist())
        variances = _find_variances(table)
        for t in np.flatnonzero(gone).tolist():
            into = int(table.ids[merged[t]]) if t in merged else None
            reason: DeletionReason = "merged" if t in merged else "unlikely" if unlikely[t] else "variance"
            self.account.deletions.append(
                Deletion(int(table.ids[t]), reason, float(table.existence[t]), float(variances[t]), into)
            )
        order = np.argsort(table.ids, kind="stable")
        return table[order[~gone[order]]]

    def _reacquire(self, table: TrackTable) -> TrackTable:
        """Give new tracks of this scan the ids of lost tracks that they continue.

        All UAVs do this after they agree on tracks and sightings, so that they decide alike.
        """
        p = self.parameters
        if not len(table.ids) or table.ids[-1] < new_id(self._messenger.scans, 0, 0):
            return table
        new = np.flatnonzero(is_new_id(table.ids, self._messenger.scans))
        lost = find_lost_tracks(table.sightings, self._messenger.time, p)
        of_new, of_lost = ((table.means[rows], table.covariances[rows]) for rows in (new, lost))
        pairs = match_lost_tracks(
            of_new, of_lost, table.sightings[lost], now=self._messenger.time, max_speed=p.settings.max_speed
        )
        for n, k in pairs:
            self.account.reacquisitions.append(Reacquisition(int(table.ids[lost[k]]), int(table.ids[new[n]])))
            table.ids[new[n]] = table.ids[lost[k]]
        left = np.setdiff1d(np.arange(len(table.ids)), [lost[k] for _, k in pairs])
        return table[left[np.argsort(table.ids[left], kind="stable")]]


def _find_variances(table: TrackTable) -> Array:
    """Traces (T,) m² of the covariances of positions."""
    return np.asarray(table.covariances[:, 0, 0] + table.covariances[:, 1, 1])


def _find_starts(parts: Sequence[Sized]) -> Indices:
    """Where each of N parts starts in all, and where the last ends (N + 1,)."""
    return np.array([*accumulate(map(len, parts), initial=0)])


def _select_association(
    ids: Indices, before: ScanPrediction, after: ScanUpdate, found: Found, pairs: Indices, rows: slice, n: int
) -> Association:
    """The association of UAV n, whose tracks are in `rows`, from those of several."""
    places, gates = slice(*found.starts[n : n + 2]), slice(*pairs[n : n + 2])
    undetected = Beliefs(*[column[rows] for column in before.undetected])
    prior = before.means[rows], before.covariances[rows], undetected, before.existence[rows]
    return Association(
        ids,
        ScanPrediction(*prior, before.visible[rows], before.detectable[rows]),
        found.places[places],
        found.covariances[places],
        ScanUpdate(
            after.means[rows],
            after.covariances[rows],
            after.existence[rows],
            after.missed[rows],
            after.gates[gates] - [rows.start, found.starts[n]],
            after.weights[gates],
            after.explained[places],
        ),
    )
