"""Times of fleets' scans, beside the same trackers without a network; docs/results/benchmarks.md says how to run this.

In ordinary test runs each fleet takes a few scans, and its times are not judged.
"""

import math
import time

import numpy as np
import pytest
from helpers.scenes import CAMERA, MOTION, track

from tracking.fusion.consensus import step
from tracking.geometry.camera import Pose
from tracking.parameters import TrackerParameters
from tracking.track import Scan
from tracking.tracker import Tracker

APART, RANGE, ALTITUDE = 112.0, 150.0, 20.0  # m, between UAVs of a square grid, of the radio, and over ground
SEEN = ALTITUDE * math.tan(math.radians(30))  # m, half an edge of a view


class Fleet:
    """UAVs over a square in which people walk straight on; most of them are out of sight."""

    def __init__(self, uavs, people, scans):
        rng = np.random.default_rng(0)
        side = math.ceil(math.sqrt(uavs))
        self.uavs = APART * (np.array([divmod(k, side) for k in range(uavs)]) - (side - 1) / 2.0)
        near = self.uavs[rng.integers(uavs, size=people)] + rng.uniform(-2.0 * SEEN, 2.0 * SEEN, (people, 2))
        walks = rng.uniform(-1.5, 1.5, (people, 2))
        self.known = [track(k, *place, *walk) for k, (place, walk) in enumerate(zip(near, walks, strict=True))]
        gaps = np.linalg.norm(self.uavs[:, None] - self.uavs, axis=2)
        self.links = (gaps <= RANGE) & (gaps > 0.0)
        self.scans = []
        for k in range(scans):
            seen = [near[np.max(np.abs(near - uav), axis=1) < SEEN] for uav in self.uavs]
            noisy = [z + rng.normal(0.0, 0.2, z.shape) for z in seen]
            self.scans.append([self.scan(i, 0.2 * k, z) for i, z in enumerate(noisy)])
            near = near + 0.2 * walks

    def scan(self, i, time, z):
        return Scan(i, time, Pose.level(*self.uavs[i], ALTITUDE), z, np.tile(0.04 * np.eye(2), (len(z), 1, 1)))

    def run(self, links):
        """Seconds of each scan but the first, and the trackers afterwards."""
        parameters = TrackerParameters(MOTION)
        trackers = [Tracker(i, CAMERA, parameters, self.known) for i in range(len(self.uavs))]
        seconds = []
        for scans in self.scans:
            start = time.process_time()
            step(trackers, scans, links)
            for tracker in trackers:
                assert tracker.tracks
            seconds.append(time.process_time() - start)
        return seconds[1:], trackers


@pytest.mark.parametrize(("uavs", "people", "bound"), [(3, 4, 3.0), (30, 100, 5.0), (60, 200, 6.0)])
def test_a_scan_of_a_fleet_beside_its_trackers_alone(judged, uavs, people, bound):
    """What the network costs: rounds of consensus, and the association of tracks."""
    fleet = Fleet(uavs, people, 12 if judged else 2)
    alone, rounds = np.zeros_like(fleet.links), 5 if judged else 1
    runs = [(fleet.run(fleet.links)[0], fleet.run(alone)[0]) for _ in range(rounds)]
    linked, lone = 1e3 * np.min(runs, axis=0).mean(axis=1)
    print(
        f"\n{uavs} UAVs, {people} people: {linked:.2f} ms, without a network {lone:.2f} ms, {linked / lone:.2f} times"
    )
    assert not judged or linked < bound * lone
