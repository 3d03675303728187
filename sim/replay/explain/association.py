"""Data association of one UAV at one scan, computed again from the recording in the same way as by its tracker."""

from dataclasses import dataclass

import numpy as np

from sim.mission.tracker_setup import initial_tracks, tracker_parameters
from sim.recording.recording import Recording
from sim.replay.recorded_fleet import known_forest, motion_at
from sim.sensing.cameras import view_of
from tracking.filter.negative_information import miss_likelihood
from tracking.geometry.visibility import visible_samples
from tracking.management.reacquisition import turned_density
from tracking.measurement_update import ScanPrediction, associate, scan_prediction
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.distances import squared_distance
from tracking.track import beliefs_of


@dataclass(frozen=True, eq=False)
class Association:
    """T tracks, predicted to the time of a scan, and its N measurements."""

    ids: Indices  # (T,)
    numbers: Indices  # (T,), displayed numbers of the tracks; -1 for one that ended before it was recorded
    before: ScanPrediction  # beliefs, existence and probability of plain view before the scan
    measurements: Array  # (N, 2) m
    covariances: Array  # (N, 2, 2) m²
    distances: Array  # (T, N), squared Mahalanobis distances of measurements, by the innovation covariance
    gated: Flags  # (T, N)
    beta: Array  # (T, N + 1), probability that no measurement is the person's, then that of each measurement
    existence: Array  # (T,), after the scan but before fusion

    @staticmethod
    def of(recording: Recording, k: int, uav: int) -> "Association | None":
        """The association of one UAV at scan k; None if its camera took no frame or the UAV had broken down.

        Beliefs are those after fusion at scan k - 1, predicted by the tracker's motion model; at the first scan they
        are the initial tracks. If the mission has a single scan, people are assumed to stand still.

        Note: for more than 10 000 pairs the tracker uses independent gating clusters, which round differently.
        Recordings of earlier versions are interpreted by the rules of this one.
        """
        scenario, works = recording.setting, recording.working[:, uav]
        taken = [j for j in range(k + 1) if works[j] and scenario.has_frame(uav, j)]
        if k not in taken:
            return None
        p = tracker_parameters(scenario)
        here, there = recording.people[[0, min(1, len(recording.people) - 1)]]
        tracks = recording.tracks_at(k - 1, uav) if k else initial_tracks(scenario, here, there)
        means, covariances = beliefs_of(tracks)
        existence = np.array([t.existence for t in tracks], dtype=float)
        if k:
            means, covariances = motion_at(recording, k - 1, uav).predict_all(means, covariances)
            existence = existence * p.step_survival
        scan = recording.scan_at(k, uav)
        camera = view_of(scenario.uavs[uav], scenario)
        last = recording.scan_at(taken[-2], uav) if len(taken) > 1 else None
        lenses = camera.lens(scan.pose), camera.lens(last.pose) if last else None
        views = visible_samples(known_forest(recording), (means, covariances), *lenses)
        elapsed = np.full(len(means), scan.time - last.time if last else np.inf)
        missed = miss_likelihood(means, covariances, views, elapsed, p.detection_probability)
        before = scan_prediction((means, covariances), existence, views[:, 0], missed, p)
        z, R = (np.ascontiguousarray(table) for table in (scan.measurements, scan.covariances))
        sightings = np.array([t.sighting for t in tracks]).reshape(-1, 3)
        turned = turned_density(sightings, existence, z, R, (float(recording.times[max(k - 1, 0)]), scan.time), p.loss)
        likelihood, beta, _, after = associate(before, z, R, turned, p.association)
        ids = np.array([t.id for t in tracks], dtype=np.int64)
        off, spread = z[None] - before.means[:, None, :2], before.covariances[:, None, :2, :2] + R[None]
        distances = squared_distance(off, spread)
        return Association(ids, recording.numbers_of(ids), before, z, R, distances, likelihood > 0.0, beta, after)
