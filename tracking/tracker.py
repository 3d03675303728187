"""Tracker of one UAV: prediction, data association, measurement update, and management of tracks."""

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tracking.account import Association, Birth, Deletion, DeletionReason, Reacquisition, ScanAccount
from tracking.association.jpda import gated_likelihood
from tracking.filter.motion import count_steps, predict_steps
from tracking.filter.negative_information import miss_likelihood, negative_information_update, temper
from tracking.fusion.exchange import NO_EVIDENCE, SURE, UNSEEN, Messenger, ScanEvidence
from tracking.fusion.message import (
    FIRST_NEW_ID,
    IDS_PER_SCAN,
    UAVS,
    Message,
    find_latest_sightings,
    is_new_id,
    new_id,
    read_existence,
)
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.lens import Lens
from tracking.geometry.visibility import NO_TREES, SAMPLES, Occluders, at_target_height, see_samples
from tracking.management.deletion import count_misses, find_duplicates, find_outcompeted, find_rivals
from tracking.management.initiation import Tentative, initiate_tracks
from tracking.management.input_check import check_scan, check_tracks
from tracking.management.reacquisition import find_lost_tracks, match_lost_tracks, turned_density
from tracking.measurement_update import Measured, ScanPrediction, predict_scan, update_scan
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import power
from tracking.numerics.matrices import apply
from tracking.parameters import EXPECTED, SEEN, ScanSettings, TrackerParameters
from tracking.registration.registration import make_registration
from tracking.track import (
    DETECTED_AT,
    EXPECTED_AT,
    FRAME_AT,
    FRAME_BEFORE,
    SIGHTED_AT,
    SURE_AT,
    THIS_FRAME,
    Beliefs,
    Scan,
    Track,
    TrackTable,
    make_table,
    make_tracks,
)

_VIEWED = 1e-4  # weight of a belief in view without a detection, which matters only if no UAV detected the person
_SHARED_WITHIN = 1.0  # s since the last detection of each of two tracks that share one person
_MOST_NEW = IDS_PER_SCAN // 2  # largest number of new tracks in a scan
_NEW_FOR = 1.0  # s for which a new track takes the id of an older one of the same person
_NOWHERE = Pose.level(0.0, 0.0, 0.0)


class _Frames(NamedTuple):
    """The frame of a scan and the one before, for compiled code; of a frame that is not there the lens is any one."""

    lens: Lens
    before: Lens
    there: bool
    was_there: bool
    framed: float  # s, time of the frame before


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

    def __init__(self, uav: int, camera: Camera, parameters: TrackerParameters, initial: Sequence[Track] = ()) -> None:
        """Start before the first scan.

        Args:
            uav: Number of the UAV.
            camera: Its camera.
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
        self._forest = NO_TREES  # as believed at the last scan
        self.motion = parameters.motion  # as learned from the speeds of people that the fleet detected
        self.account = ScanAccount()  # of the last scan
        self._messenger = Messenger(uav, parameters)
        pose_errors = parameters.settings.pose_errors
        self._registration = make_registration(parameters.navigation, pose_errors, known=bool(known))
        self._first = 0.0  # time of the first scan [s]
        self._steps = 0.0  # of motion since then
        self._last_frame: Lens | None = None  # the camera at its pose in the last frame
        self._last_framed = -math.inf  # time of that frame [s]
        self._table = make_table(known, UNSEEN, -math.inf)
        self._tracks: tuple[Track, ...] | None = None  # of the table, once somebody has asked for them
        self._evidence = NO_EVIDENCE  # of a scan not yet fused
        self._tentative: list[Tentative] = []
        self._waited = 0.0  # steps of motion since tentative tracks were last predicted

    def copy(self) -> "Tracker":
        """As `Member.copy`; scans replace whatever they change, except for sightings in the first one."""
        made = copy(self)
        made._messenger, made._registration = copy(self._messenger), copy(self._registration)
        made._table = replace(self._table, sightings=self._table.sightings.copy())
        return made

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
        p = self.parameters
        if scan.uav != self.uav:
            raise ValueError(f"a scan of UAV {scan.uav} was given to the tracker of UAV {self.uav}")
        z, R = check_scan(scan)
        between = self._messenger.time, scan.time
        self._forest = scan.forest
        self._predict(scan.time)
        if self._registration:
            scan = self._registration.correct(scan, self._explain)
            z, R = scan.measurements, scan.covariances
        lens = self._camera.lens(scan.pose)
        frames = self._look(scan.time, lens)
        table = self._table
        beliefs = Beliefs(table.means, table.covariances)
        table.times, table.views, *told = _view_tracks(
            beliefs, table.existence, table.times, frames, self._forest.occluders, scan.time, p.scan
        )
        before = ScanPrediction(*beliefs, Beliefs(*told[:2]), table.existence, *told[2:])
        turned = turned_density(table.sightings, table.existence, z, R, between, p.loss)
        shares = self._forest.detectabilities_through_leaves(lens, at_target_height(z))
        after = update_scan(before, Measured(z, R, shares, turned), p)
        self.account.association = Association(table.ids, before, z, R, after)
        self._evidence = ScanEvidence(beliefs, z, after.gates)
        if self._registration:
            self._registration.note(table.ids, beliefs, scan, after.gates, after.weights)
        columns = table.times, table.views
        table.weights = _note_detections(
            after.missed, after.gates, before.visible, columns, (scan.time, SEEN), p.scan.by_existence
        )
        table.means, table.covariances, table.existence = after[:3]
        if self._tentative or not after.explained.all():
            self._initiate(lens, z[~after.explained], R[~after.explained])
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
            self._table += make_table(begun, 1.0, time)

    def coast(self, time: float) -> None:
        """Predict to the time of a scan in which this UAV took no frame, which counts as neither hit nor miss."""
        self._predict(time)
        frames, table = self._look(time, None), self._table
        beliefs = Beliefs(table.means, table.covariances)
        table.times, table.views, *_ = _view_tracks(
            beliefs, table.existence, table.times, frames, self._forest.occluders, time, self.parameters.scan
        )

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

    def _look(self, time: float, frame: Lens | None) -> _Frames:
        """The frame of a scan at `time` s, if there is one, and the one before."""
        before = self._last_frame or frame or self._camera.lens(_NOWHERE)
        frames = _Frames(frame or before, before, frame is not None, self._last_frame is not None, self._last_framed)
        if frame:
            self._last_frame = frame
            self._last_framed = time
        return frames

    def message(self, degree: int) -> Message:
        """Message for the first round, to `degree` neighbours."""
        return self._messenger.message(degree, self._table, self._evidence)

    def accept(self, message: Message) -> None:
        """Take over the fleet's tracks; then merge, delete and re-acquire tracks, as all UAVs do alike."""
        if self._registration:
            self._registration.learn(message.ids, message.beliefs.covariances, 1 + message.degree)
        table, unlikely, wide, rivals = self._adopt(message)
        merged = self._merge_duplicates(table, ~(unlikely | wide)) if rivals > 1 else {}
        self._table = self._reacquire(self._delete(table, unlikely, wide, merged))
        self._tracks = None
        detected = self._table.sightings[:, SIGHTED_AT] >= self._messenger.time
        if detected.any() and hasattr(self.motion, "learn"):
            self.motion = self.motion.learn(self._table.means[detected, 2:])

    def _adopt(self, message: Message) -> tuple[TrackTable, Flags, Flags, int]:
        """The fleet's tracks with the negative information of all frames and the scan's misses; then as `_adopt`."""
        self._messenger.accept(message)
        self._evidence = NO_EVIDENCE
        columns = message.shares, message.times, message.views, message.misses, message.sightings
        means, covariances, existence, misses, sightings, unlikely, wide, rivals = _adopt(
            message.beliefs, columns, self._messenger.time, self.parameters.scan
        )
        ids, weights = message.ids.copy(), np.full(len(means), UNSEEN)
        table = TrackTable(ids, means, covariances, existence, weights, message.times, message.views, misses, sightings)
        return table, unlikely, wide, rivals

    def _merge_duplicates(self, table: TrackTable, among: Flags) -> dict[int, int]:
        """Merge tracks that share one person; returns the row of the track that goes on, by that of the other.

        among (T,): flags of the tracks that may be merged. The one that goes on gets the existence of both, and if it
        is new, the older id.
        """
        p, scans = self.parameters, self._messenger.scans
        # Tracks of hidden people may be close to each other without competing for a measurement.
        recent = table.times[:, DETECTED_AT] > self._messenger.time - _SHARED_WITHIN
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
        if not merged and not gone.any():
            return table
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


@compiled
def _view_tracks(
    beliefs: Beliefs,
    existence: Array,
    times: Array,
    frames: _Frames,
    occluders: Occluders,
    now: float,
    settings: ScanSettings,
) -> tuple[Array, Indices, Array, Array, Array, Array]:
    """What the frames of a scan at `now` s show of T tracks: the columns `times` and `views`.

    existence (T,): probabilities; times (T, 4), as in the table. Returns also the means and covariances of `undetected`
    beliefs, `visible` and `detectable` of a `ScanPrediction`.
    """
    means, covariances = beliefs
    views, bits = np.zeros((len(means), 2, len(SAMPLES)), np.bool_), np.zeros((len(means), 2), np.int64)
    seen = before = np.zeros((len(means), len(SAMPLES)), np.bool_)
    if frames.there:
        seen = see_samples(means, covariances, frames.lens, occluders)
    if frames.was_there:
        before = see_samples(means, covariances, frames.before, occluders)
    times, since = times.copy(), np.empty(len(means))  # a message may hold the former ones
    for t in range(len(means)):
        for k in range(len(SAMPLES)):
            views[t, THIS_FRAME, k], views[t, FRAME_BEFORE, k] = seen[t, k], before[t, k]
            bits[t, THIS_FRAME] |= np.int64(seen[t, k]) << k
            bits[t, FRAME_BEFORE] |= np.int64(before[t, k]) << k
        times[t, FRAME_AT] = frames.framed if bits[t, FRAME_BEFORE] > 0 else -np.inf
        since[t] = now - times[t, FRAME_AT]
    missed = miss_likelihood(means, covariances, views, since, settings.detection_probability)
    told = predict_scan(beliefs, existence, seen, missed, settings)
    moved, spread = told.undetected
    return times, bits, moved, spread, told.visible, told.detectable


@compiled
def _note_detections(
    missed: Array,
    gates: Indices,
    visible: Array,
    columns: tuple[Array, Indices],
    levels: tuple[float, float],
    by_existence: bool,
) -> Array:
    """Note in the columns `times` and `views` what a scan detected of T tracks; returns their weights (T,).

    missed (T,) and gates (G, 2) as in a `ScanUpdate`; visible (T,) as in a `ScanPrediction`; levels: time of the
    scan [s], and probability from which on a person counts as detected.
    """
    now, least = levels
    detected, weights, (times, views) = 1.0 - missed, np.empty(len(missed)), columns
    without = np.zeros(len(missed), np.bool_) if by_existence else find_outcompeted(gates, detected)
    for t in range(len(missed)):
        if detected[t] >= least and not without[t]:
            times[t, DETECTED_AT] = now
        if visible[t] >= EXPECTED:
            times[t, EXPECTED_AT] = now
        if detected[t] >= SURE:
            times[t, SURE_AT] = now
        weights[t] = max(detected[t], UNSEEN + _VIEWED * visible[t])
    for g in range(len(gates)):
        views[gates[g, 0], THIS_FRAME] = 0  # the association has already used this frame
    return weights


@compiled
def _adopt(
    beliefs: Beliefs, columns: tuple[Array, Array, Indices, Indices, Array], now: float, settings: ScanSettings
) -> tuple[Array, Array, Array, Indices, Array, Flags, Flags, int]:
    """Means, covariances, existence, misses and sightings of the fleet's tracks after a scan at `now` s.

    The beliefs have the negative information of all frames. Returns also flags (T,) of tracks that probably are of
    nobody, by their existence or, with m of n, by their misses; flags (T,) of too wide ones; and how many of the others
    may share a person with another one.
    columns: `shares`, `times`, `views`, `misses` and `sightings` of a message.
    """
    means, covariances = beliefs
    shares, times, views, misses, sightings = columns
    latest = find_latest_sightings(sightings, times, means, now)
    shown, since = np.zeros((len(means), 2, len(SAMPLES)), np.bool_), np.empty(len(means))
    undetected = False
    for t in range(len(means)):
        since[t] = now - times[t, FRAME_AT]
        if not times[t, DETECTED_AT] >= now:
            undetected = True
            for k in range(len(SAMPLES)):
                shown[t, THIS_FRAME, k] = views[t, THIS_FRAME] >> k & 1 != 0
                shown[t, FRAME_BEFORE, k] = views[t, FRAME_BEFORE] >> k & 1 != 0
    if undetected:
        missed = miss_likelihood(means, covariances, shown, since, settings.detection_probability)
        tempered = temper(missed, settings.negative_information)
        means, covariances = negative_information_update(means, covariances, tempered)
    counted = count_misses(misses, times, now, settings.delete[1])
    existence = read_existence(shares) if settings.by_existence else np.ones(len(means))
    unlikely, wide = np.empty(len(means), np.bool_), np.empty(len(means), np.bool_)
    recent = np.empty(len(means), np.bool_)
    for t in range(len(means)):
        misses_counted = 0
        for k in range(settings.delete[1]):
            misses_counted += counted[t] >> k & 1
        missing = misses_counted >= settings.delete[0]
        unlikely[t] = existence[t] < settings.deletion_threshold if settings.by_existence else missing
        wide[t] = covariances[t, 0, 0] + covariances[t, 1, 1] > settings.max_variance
        recent[t] = times[t, DETECTED_AT] > now - _SHARED_WITHIN and not (unlikely[t] or wide[t])
    return means, covariances, existence, counted, latest, unlikely, wide, len(find_rivals(existence, recent))
