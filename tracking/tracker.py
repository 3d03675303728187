"""Tracker of one UAV: prediction, data association, measurement update, and management of tracks."""

import math
from collections.abc import Sequence

import numpy as np

from tracking.filter.negative_information import miss_likelihood, negative_information_update
from tracking.fusion.checked_tracker import checked_tracks
from tracking.fusion.exchange import NOTHING, SURE, UNSEEN, Link
from tracking.fusion.labels import FIRST_LABEL, LABELS_PER_SCAN, UAVS, is_new_label, new_label
from tracking.fusion.message import Message
from tracking.geometry.camera import Camera
from tracking.geometry.lens import Lens
from tracking.geometry.visibility import SAMPLES, Forest, visible_samples
from tracking.management.deletion import counted_misses, shared_people, without_measurement
from tracking.management.initiation import Tentative, initiated
from tracking.management.reacquisition import lost_tracks, reacquisitions, turned_density
from tracking.management.validation import checked_scan
from tracking.measurement_update import scan_prediction, scan_update
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.exponential import power, power_each
from tracking.parameters import EXPECTED, SEEN, TrackerParameters
from tracking.plugins.plugin_error import Unusable
from tracking.track import Scan, Track, TrackTable, tracks_of

__all__ = ["Scan", "Track", "Tracker", "TrackerParameters"]

_VIEWED = 1e-4  # weight of a belief in view without a detection, which matters only if no UAV detected the person
_SHARED_WITHIN = 1.0  # s since the last detection of each of two tracks that share one person
_MOST_NEW = LABELS_PER_SCAN // 2  # largest number of new tracks in a scan
_NEW_FOR = 1.0  # s for which a new track takes the id of an older one of the same person
_BITS = np.arange(len(SAMPLES))  # bit of each sample of a belief in a number that says which are in view


class Tracker:
    """Tracker of people from one UAV's scans. Each scan ends with `consensus.fuse`, alone or with other UAVs.

    Tracks are Bernoulli components: a label, a probability of existence, and a belief; people without a track are a
    Poisson process of constant density. Association probabilities are JPDA's. Source: [Williams15]; [Musicki04].
    `initial` tracks are of the time of the first scan, and have ids below one million.

    Note: [Li22] uses JPDA with initiation and deletion by m of n scans, as `management` = "m_of_n" does. This tracker
    adds `negative_information`, re-acquisition (`reacquire_after`), and, as the paper's code, deletion at very
    large covariance (`max_variance`). It always merges tracks of one person, and detection always depends on the view.
    """

    def __init__(
        self, uav: int, camera: Camera, forest: Forest, parameters: TrackerParameters, initial: Sequence[Track] = ()
    ) -> None:
        if not 0 <= uav < UAVS:
            raise ValueError(f"uav must be in [0, {UAVS}), is {uav}")
        for track in initial:
            try:
                checked_tracks([track])
            except Unusable as error:
                raise ValueError(f"initial track {track.id}: {error}") from error
        known = checked_tracks(initial)
        if known and known[-1].id >= FIRST_LABEL:
            raise ValueError(f"ids of initial tracks must be below {FIRST_LABEL}, are up to {known[-1].id}")
        self.uav, self._camera, self._forest, self.parameters = uav, camera, forest, parameters
        self.max_speed = parameters.max_speed
        self.motion = parameters.motion  # as learned from the speeds of people that the fleet detected
        self._link = Link(uav, parameters)
        self._first, self._steps = 0.0, 0  # time of the first scan [s], and steps of motion since then
        self._last_frame: tuple[float, Lens | None] = -math.inf, None  # its time [s], and its camera at its pose
        self._table = TrackTable.of(known, UNSEEN, -math.inf)
        self._predicted = NOTHING  # prior beliefs, measurements and gates of a scan not yet fused
        self._tentative: list[Tentative] = []
        self._waited = 0  # steps of motion since tentative tracks were last predicted

    @property
    def tracks(self) -> tuple[Track, ...]:
        """Confirmed tracks by ascending id."""
        table = self._table
        return tracks_of(table.ids, table.means, table.covariances, table.existence, table.sightings)

    def step(self, scan: Scan) -> None:
        """Predict to the scan's time, associate, update, initiate."""
        p = self.parameters
        if scan.uav != self.uav:
            raise ValueError(f"a scan of UAV {scan.uav} was given to the tracker of UAV {self.uav}")
        z, R = checked_scan(scan)
        between, lens = (self._link.time, scan.time), self._camera.lens(scan.pose)
        views = self._predict(scan.time, lens)
        table = self._table
        beliefs = table.means, table.covariances
        likelihood = miss_likelihood(*beliefs, views, scan.time - table.times[:, 3], p.detection_probability)
        before = scan_prediction(beliefs, table.existence, views[:, 0], likelihood, p)
        turned = turned_density(table.sightings, table.existence, z, R, between, p.loss)
        after = scan_update(before, z, R, turned, p)
        self._predicted = beliefs, z, after.gates
        detected = 1.0 - after.missed
        hits = detected >= SEEN
        if p.management == "m_of_n":
            hits &= ~without_measurement(after.gates, detected)
        now, visible = scan.time, before.visible
        table.times[hits, 0] = table.times[visible >= EXPECTED, 1] = table.times[detected >= SURE, 2] = now
        table.views[after.gates[:, 0], 0] = 0  # the association has already used this frame
        table.weights = np.maximum(detected, UNSEEN + _VIEWED * visible)
        table.means, table.covariances, table.existence = after[:3]
        self._initiate(lens, z[~after.explained], R[~after.explained])

    def _initiate(self, lens: Lens, z: Array, R: Array) -> None:
        """Begin tracks of new people, from the measurements z (N, 2) m, R (N, 2, 2) m² that tracks do not explain."""
        elapsed, self._waited = self._waited, 0
        view = self._forest, lens
        new, self._tentative = initiated(self._tentative, z, R, elapsed=elapsed, view=view, p=self.parameters)
        # Tracks for which there are no labels begin in the next scan.
        new, self._tentative = new[:_MOST_NEW], new[_MOST_NEW:] + self._tentative
        if new:
            begun = [Track(new_label(self._link.scans, self.uav, k), t.belief, t.existence) for k, t in enumerate(new)]
            self._table += TrackTable.of(begun, 1.0, self._link.time)

    def coast(self, time: float) -> None:
        """Predict to the time of a scan in which this UAV took no frame, which counts as neither hit nor miss."""
        self._predict(time, None)

    def _predict(self, time: float, frame: Lens | None) -> Flags:
        """Predict to a scan's time; returns `visible_samples` of its frame, if there is one, and of the one before."""
        self._link.begin(time)
        if self._link.scans == 1:  # initial tracks are of this time
            self._first = time
            self._table.sightings[:, 2] = time
        # The number of steps since the first scan is rounded, not since the last one, so that no drift adds up.
        elapsed = round((time - self._first) / self.parameters.motion.dt) - self._steps
        self._steps += elapsed
        self._waited += elapsed
        table, (last, before) = self._table, self._last_frame
        for _ in range(elapsed):
            table.means, table.covariances = self.motion.predict_all(table.means, table.covariances)
        table.existence = table.existence * power(self.parameters.step_survival, elapsed)
        views = visible_samples(self._forest, (table.means, table.covariances), frame, before)
        table.views = (views << _BITS).sum(axis=2)
        table.times = table.times.copy()  # a message may hold the former ones
        table.times[:, 3] = np.where(views[:, 1].any(axis=1), last, -math.inf)
        self._last_frame = (time, frame) if frame else self._last_frame
        return views

    def message(self, degree: int) -> Message:
        """Message for the first round, to `degree` neighbours."""
        return self._link.message(degree, self._table, self._predicted)

    def accept(self, message: Message) -> None:
        """Take over the fleet's tracks, count its scan, and delete tracks."""
        p, now, scans = self.parameters, self._link.time, self._link.scans
        means, covariances = self._undetected(message)
        existence = message.existence() if p.management == "existence" else np.ones(len(means))
        misses = counted_misses(message.misses, message.times, now, p.delete[1])
        gone = (
            existence < p.deletion_threshold if p.management == "existence" else np.bitwise_count(misses) >= p.delete[0]
        )
        gone |= covariances[:, 0, 0] + covariances[:, 1, 1] > p.max_variance
        # Tracks of hidden people may be close to each other without competing for a measurement.
        recent = message.times[:, 0] > now - _SHARED_WITHIN
        ids = message.ids.copy()
        for kept, other in shared_people((means, covariances), existence, ~gone & recent, p.match_gate):
            existence[kept], gone[other] = min(existence[kept] + existence[other], 1.0), True
            if ids[kept] >= new_label(max(scans - round(_NEW_FOR / p.motion.dt), 1), 0, 0):
                ids[[kept, other]] = np.sort(ids[[kept, other]])
        self._link.accept(message)
        self._predicted = NOTHING
        rest = existence, np.full(len(means), UNSEEN), message.times, message.views, misses, message.sighted()
        table = TrackTable(ids, means, covariances, *rest)
        if gone.any():
            self._link.delete(ids[gone].tolist())
            order = np.argsort(ids, kind="stable")
            table = table[order[~gone[order]]]
        self._table = self._with_reacquired(table)
        detected = self._table.sightings[:, 2] >= now
        if detected.any():
            self.motion = self.motion.observed(self._table.means[detected, 2:])

    def _undetected(self, message: Message) -> tuple[Array, Array]:
        """Means (T, 4) and covariances (T, 4, 4) of the fleet's tracks, with the negative information of all frames."""
        now, p = self._link.time, self.parameters
        detected = message.times[:, 0] >= now
        if detected.all():
            return message.beliefs
        views = (message.views[..., None] >> _BITS) & 1 > 0
        views[detected] = False
        missed = miss_likelihood(*message.beliefs, views, now - message.times[:, 3], p.detection_probability)
        return negative_information_update(message.beliefs, power_each(missed, p.negative_information))

    def _with_reacquired(self, table: TrackTable) -> TrackTable:
        """Give new tracks of this scan the ids of lost tracks that they continue.

        All UAVs do this after they agree on tracks and sightings, so that they decide alike.
        """
        p = self.parameters
        new = np.flatnonzero(is_new_label(table.ids, self._link.scans))
        if len(new) == 0:
            return table
        lost = lost_tracks(table.sightings, self._link.time, p)
        of_new, of_lost = ((table.means[rows], table.covariances[rows]) for rows in (new, lost))
        pairs = reacquisitions(of_new, of_lost, table.sightings[lost], now=self._link.time, max_speed=p.max_speed)
        for n, k in pairs:
            table.ids[new[n]] = table.ids[lost[k]]
        left = np.setdiff1d(np.arange(len(table.ids)), [lost[k] for _, k in pairs])
        return table[left[np.argsort(table.ids[left], kind="stable")]]
