"""A tracker of your own takes the measurement nearest to each track; prints the checks that it passes and a mission."""

import numpy as np

from understory import Gaussian, Track, TrackExchange, beliefs_of, check_tracker, run


class Nearest:
    def __init__(self, uav, camera, parameters, initial):
        self.motion, self.exchange = parameters.motion, TrackExchange(uav, parameters, initial)
        self.tracks, self.time, self.detected = list(initial), None, {}

    def coast(self, time):
        if self.time is not None:  # the initial tracks hold at the first scan
            predicted = zip(self.tracks, *self.motion.predict_all(*beliefs_of(self.tracks)))
            self.tracks = [Track(track.id, Gaussian(mean, P)) for track, mean, P in predicted]
        self.time, self.detected = time, {}

    def step(self, scan):
        self.coast(scan.time)
        for i, track in enumerate(self.tracks):
            mean, P = track.belief.mean, track.belief.covariance
            gaps, S = scan.measurements - mean[:2], P[:2, :2] + scan.covariances
            distances = [gap @ np.linalg.solve(spread, gap) for gap, spread in zip(gaps, S)]
            if min(distances, default=np.inf) < 13.8:  # 99.9 % of a person's measurements are in this gate
                j = int(np.argmin(distances))
                K = P[:, :2] @ np.linalg.inv(S[j])
                self.tracks[i] = Track(track.id, Gaussian(mean + K @ gaps[j], P - K @ S[j] @ K.T))
                self.detected[track.id] = 1.0  # the probability that this UAV saw the person

    def message(self, degree):
        return self.exchange.message(degree, self.time, self.tracks, self.detected)

    def accept(self, message):
        self.tracks = self.exchange.accept(message)


if __name__ == "__main__":
    print(*check_tracker("own_tracker:Nearest"), sep="\n")
    print(run(seed=3, settings={"duration": 6, "sensing.mode": "ideal", "tracking.tracker": "own_tracker:Nearest"}))
