"""Stone Soup's JPDA as the tracker of each UAV; ids, messages and fusion are the testbed's."""

import datetime
from collections.abc import Sequence

import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDA
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track as Path
from stonesoup.updater.kalman import KalmanUpdater
from stonesoup.updater.probability import PDAUpdater

from understory import (
    Camera,
    Gaussian,
    Message,
    NearlyConstantVelocity,
    Scan,
    Track,
    TrackerParameters,
    TrackExchange,
    visible_samples,
)

EPOCH = datetime.datetime(2000, 1, 1)
SIGMA_A = 0.6  # m/s², standard deviation of the acceleration
DETECTED = 0.1  # probability that a detection is a person's from which on it starts no track


class SoupJPDA:
    """Joint probabilistic data association; tracks begin with three detections and end when they are too uncertain.

    People out of sight are predicted, by nearly constant velocity with `SIGMA_A`, whatever `tracking.motion` says.
    """

    def __init__(self, uav: int, camera: Camera, parameters: TrackerParameters, initial: Sequence[Track] = ()) -> None:
        self.camera, self.parameters = camera, parameters
        self.exchange = TrackExchange(uav, parameters, initial)
        self.time, self.tracks, self.detected = -np.inf, tuple(initial), {}
        motion = NearlyConstantVelocity(parameters.motion.dt, SIGMA_A)
        self.predictor = KalmanPredictor(
            LinearGaussianTimeInvariantTransitionModel(transition_matrix=motion.F, covariance_matrix=motion.Q)
        )
        self.updater, kalman = PDAUpdater(None, gm_method=True), KalmanUpdater(None)
        self.associator = JPDA(
            PDAHypothesiser(
                self.predictor,
                kalman,
                clutter_spatial_density=parameters.settings.clutter_density,
                prob_detect=parameters.settings.detection_probability,
                prob_gate=parameters.settings.gate_probability,
            )
        )
        nearest = GNNWith2DAssignment(DistanceHypothesiser(self.predictor, kalman, Mahalanobis(), missed_distance=3))
        self.initiator = MultiMeasurementInitiator(
            prior_state=GaussianState(np.zeros(4), np.diag([0.0, 0.0, 1.0, 1.0])),
            deleter=UpdateTimeStepsDeleter(2),
            data_associator=nearest,
            updater=kalman,
            min_points=3,
        )

    def step(self, scan: Scan) -> None:
        """Associate and update the tracks in view, predict the others, and begin tracks.

        The first scan changes nothing, as the initial tracks hold at its time.
        """
        before, last, seen = self.tracks, self.time, self.in_view(scan)
        self.coast(scan.time)
        if not np.isfinite(last):
            return
        at = EPOCH + datetime.timedelta(seconds=scan.time)
        rows = zip(scan.measurements, scan.covariances, strict=True)
        detections = [Detection(z, timestamp=at, measurement_model=LinearGaussian(4, (0, 1), R)) for z, R in rows]
        paths = {track.id: Path([state(track, last)]) for track, shown in zip(before, seen, strict=True) if shown}
        found = self.associator.associate([*paths.values()], detections, at) if paths else {}
        updated, left = {}, set(detections)
        for id, path in paths.items():
            updated[id] = track_of(id, self.updater.update(found[path]))
            chances = {h.measurement: float(h.probability) for h in found[path] if h}
            self.detected[id] = min(sum(chances.values()), 1.0)
            left -= {detection for detection, chance in chances.items() if chance >= DETECTED}
        begun = [path[-1] for path in self.initiator.initiate(left, at)]
        for first in sorted(begun, key=lambda first: first.state_vector.ravel().tolist()):
            id = self.exchange.new_id()
            updated[id], self.detected[id] = track_of(id, first), 1.0
        kept = [track for track in self.tracks if track.id not in updated]
        self.tracks = tuple(sorted([*kept, *updated.values()], key=lambda track: track.id))

    def coast(self, time: float) -> None:
        """Predict all tracks to a time; tracks that are too uncertain end."""
        if not time > self.time:
            raise ValueError(f"{time} s is not after {self.time} s")
        at = EPOCH + datetime.timedelta(seconds=time)
        if np.isfinite(self.time):
            self.tracks = tuple(track_of(t.id, self.predictor.predict(state(t, self.time), at)) for t in self.tracks)
        most = self.parameters.settings.max_variance
        self.tracks = tuple(t for t in self.tracks if np.trace(t.belief.covariance[:2, :2]) <= most)
        self.time, self.detected = time, {}

    def message(self, degree: int) -> Message:
        """The tracks as they are sent to neighbours."""
        return self.exchange.message(degree, self.time, self.tracks, self.detected)

    def accept(self, message: Message) -> None:
        """Replace the tracks with the fleet's."""
        self.tracks = self.exchange.accept(message)

    def in_view(self, scan: Scan) -> list[bool]:
        """Flags of tracks that are by more than half in the image and behind no tree."""
        if not self.tracks:
            return []
        means = np.array([track.belief.mean[:2] for track in self.tracks])
        spreads = np.array([track.belief.covariance[:2, :2] for track in self.tracks])
        views = visible_samples(scan.forest, means, spreads, self.camera.lens(scan.pose))
        return (views.mean(axis=(1, 2)) > 0.5).tolist()


def state(track: Track, time: float) -> GaussianState:
    """A track in Stone Soup's terms."""
    at = EPOCH + datetime.timedelta(seconds=time)
    return GaussianState(track.belief.mean, track.belief.covariance, timestamp=at)


def track_of(id: int, state: GaussianState) -> Track:
    """A state of Stone Soup's as a track, its covariance symmetric to the last bit."""
    covariance = np.array(state.covar, dtype=float)
    return Track(id, Gaussian(np.array(state.state_vector, dtype=float).ravel(), (covariance + covariance.T) / 2))
