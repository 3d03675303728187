"""Stone Soup's JPDA filter on our models and scans.

Conventions, which are the same on both sides: the gate is the ellipse that holds a measurement of its person with
probability P_G; a track misses with 1 - P_D P_G; a measurement in the gate weighs P_D N(z; Hx, S) / clutter density.
Here the last reads P_D P_G times the density given that it is in the gate, N / P_G, over the clutter density.
"""

import datetime

import numpy as np
from stonesoup.dataassociator.probability import JPDA
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.updater.kalman import KalmanUpdater
from stonesoup.updater.probability import PDAUpdater

from tracking.filter.kalman import Gaussian

EPOCH = datetime.datetime(2000, 1, 1)


class StoneSoup:
    """JPDA of tracks known at `time` s, from the next scan on; scans are one step of the motion model apart.

    By default it updates as the mixture that it is, with each detection's own R; the innovation form, for speed, takes
    one R for all. Neither starts nor ends tracks.
    """

    def __init__(self, parameters, tracks, time=0.0, R=None, associator=JPDA):
        motion = parameters.motion
        self.predictor = KalmanPredictor(
            LinearGaussianTimeInvariantTransitionModel(transition_matrix=motion.F, covariance_matrix=motion.Q)
        )
        self.updater = PDAUpdater(None if R is None else self.sensor(R), gm_method=R is None)
        hypothesiser = PDAHypothesiser(
            self.predictor,
            KalmanUpdater(None),
            clutter_spatial_density=parameters.settings.clutter_density,
            prob_detect=parameters.settings.detection_probability,
            prob_gate=parameters.settings.gate_probability,
        )
        self.associator = associator(hypothesiser)
        states = [GaussianState(t.belief.mean, t.belief.covariance, timestamp=self.at(time)) for t in tracks]
        self.tracks = [Track([state]) for state in states]

    @staticmethod
    def at(time):
        return EPOCH + datetime.timedelta(seconds=time)

    @staticmethod
    def sensor(R):
        return LinearGaussian(4, (0, 1), R)

    def detections(self, scan):
        """A scan in Stone Soup's terms: what `step` takes."""
        time, rows = self.at(scan.time), zip(scan.measurements, scan.covariances, strict=True)
        return [Detection(z, timestamp=time, measurement_model=self.sensor(R)) for z, R in rows], time

    def step(self, detections, time):
        hypotheses = self.associator.associate(self.tracks, detections, time)
        for track in self.tracks:
            track.append(self.updater.update(hypotheses[track]))

    @property
    def beliefs(self):
        return [Gaussian(np.array(t.state_vector, float).ravel(), np.array(t.covar, float)) for t in self.tracks]
