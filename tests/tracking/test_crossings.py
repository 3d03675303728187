"""Crossing people keep their tracks, and Stone Soup's JPDA does no better on the same scans.

`pytest -m slow -s tests/tracking/test_crossings.py -n 0` tries 1000 crossings and prints the figures of
docs/results/benchmarks.md.
"""

import itertools
import math
from functools import cache

import numpy as np
import pytest
from helpers.peers import StoneSoup
from helpers.scenes import H

from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.metrics.ospa import ospa
from tracking.parameters import TrackerParameters
from tracking.settings import DAY
from tracking.track import Scan, Track
from tracking.tracker import Tracker

MOTION = NearlyConstantVelocity(0.2, 0.5)
SCANS = 41  # 8 s; the people are closest at 4 s
CAMERA = Camera(math.radians(60), 128)
POSE = Pose.level(-10.0, 0.0, 60.0)  # 10 m beside the crossing, sees 34 m each way
NOISE = NoiseModel.range_bearing(0.1)
# Association alone, as Stone Soup does it: no track begins or ends, and people who are lost have not turned.
_ALONE = {"confirm": (62, 62), "delete": (62, 62), "management": "m_of_n", "reacquire_after": DAY}
HARD = TrackerParameters(MOTION, detection_probability=0.9, clutter_density=1e-4, **_ALONE)
# Tracks begin and end, with what the testbed's cameras give by default: hardly a miss, no false alarms.
WHOLE = TrackerParameters(MOTION, reacquire_after=DAY)
COUNTED = TrackerParameters(MOTION, management="m_of_n", reacquire_after=DAY)
# People without a detection in the last scan may have turned, too, which Stone Soup's JPDA does not weigh.
REACQUIRING = TrackerParameters(MOTION)
CASES = {
    "association alone": (HARD, 1e-4),
    "whole tracker": (WHOLE, 0),
    "whole tracker, m of n scans": (COUNTED, 0),
    "whole tracker with re-acquisition": (REACQUIRING, 0),
}
# Largest mean OSPA beyond Stone Soup's [m]. By existence, two people so near that they may give one measurement are
# not quite JPDA's.
MOST = {"whole tracker": 1e-4, "whole tracker with re-acquisition": 2e-3}


@cache
def track_deviation() -> float:
    """Standard deviation [m] per axis of the position of a lone person's track at the crossing, once stationary."""
    P, R = np.eye(4), NOISE.covariance(POSE.position[:2], np.zeros(2))
    for _ in range(500):
        P = MOTION.F @ P @ MOTION.F.T + MOTION.Q
        P = P - P @ H.T @ np.linalg.inv(H @ P @ H.T + R) @ H @ P
        P = 0.5 * (P + P.T)
    return math.sqrt(np.trace(P[:2, :2]) / 2)


class Crossing:
    """One of many: angle 5 to 90 degrees, speeds 1 to 3 m/s, closest distance up to six deviations of a track."""

    def __init__(self, seed: int, parameters: TrackerParameters, alarms: float) -> None:
        self.parameters, self.alarms = parameters, alarms
        rng = np.random.default_rng([4, seed])
        heading, angle = rng.uniform(0, 2 * math.pi), math.radians(rng.uniform(5, 90))
        speeds = rng.uniform(1, 3, 2)
        directions = np.array([[math.cos(a), math.sin(a)] for a in (heading, heading + angle)])
        self.velocities = speeds[:, None] * directions
        apart = self.velocities[1] - self.velocities[0]
        self.closest = rng.uniform(0, 6) * track_deviation()
        offset = self.closest * np.array([-apart[1], apart[0]]) / np.linalg.norm(apart)
        self.meeting = rng.uniform(-1, 1, 2) + np.array([-offset, offset]) / 2
        self.known = [
            Track(k, Gaussian(np.concatenate([x, v]) + rng.normal(0, 0.3, 4), 0.09 * np.eye(4)))
            for k, (x, v) in enumerate(zip(self.people(0), self.velocities, strict=True))
        ]
        self.scans = [self._scan(k, rng) for k in range(1, SCANS)]

    def people(self, k: int) -> np.ndarray:
        """Positions at scan k (2, 2) m."""
        return self.meeting + (k - SCANS // 2) * MOTION.dt * self.velocities

    def _scan(self, k: int, rng: np.random.Generator) -> Scan:
        half = (POSE.position[2] - TARGET_HEIGHT) * math.tan(CAMERA.fov / 2)
        alarms = POSE.position[:2] + rng.uniform(-half, half, (rng.poisson(self.alarms * (2 * half) ** 2), 2))
        z = np.vstack([self.people(k)[rng.random(2) < self.parameters.settings.detection_probability], alarms])
        R = np.array([NOISE.covariance(POSE.position[:2], x) for x in z]).reshape(-1, 2, 2)
        noise = np.linalg.cholesky(R) @ rng.normal(size=(len(z), 2, 1))
        return Scan(0, k * MOTION.dt, POSE, z + noise[..., 0], R)


def ours(crossing: Crossing) -> list[list[Track]]:
    """Tracks after each scan."""
    subject = Tracker(0, CAMERA, crossing.parameters, crossing.known)
    subject.coast(0.0)
    out = []
    for scan in crossing.scans:
        subject.step(scan)
        fuse([subject], np.zeros((1, 1), bool), 0)
        out.append(list(subject.tracks))
    return out


@cache
def theirs(seed: int, parameters: TrackerParameters, alarms: float) -> list[list[Track]]:
    """The same of Stone Soup."""
    crossing = Crossing(seed, parameters, alarms)
    peer = StoneSoup(crossing.parameters, crossing.known)
    out = []
    for scan in crossing.scans:
        peer.step(*peer.detections(scan))
        out.append([Track(k, belief) for k, belief in enumerate(peer.beliefs)])
    return out


def kept(crossing: Crossing, tracks: list[Track]) -> bool:
    """True if both tracks last to the end and are nearer, in sum, to their own persons than to each other's."""
    held = {t.id: t.belief.mean[:2] for t in tracks}
    if not {0, 1} <= held.keys():
        return False
    people = crossing.people(SCANS - 1)
    own, swapped = (
        sum(np.sum((held[i] - people[j]) ** 2) for i, j in enumerate(order)) for order in itertools.permutations((0, 1))
    )
    return bool(own < swapped)


def mean_ospa(crossing: Crossing, history: list[list[Track]]) -> float:
    """Mean distance [m] over the scans, cut off at 50 m."""
    places = [np.array([t.belief.mean[:2] for t in tracks]) for tracks in history]
    return float(np.mean([ospa(x, crossing.people(k)).distance for k, x in enumerate(places, 1)]))


def compare(case: str, count: int) -> None:
    parameters, alarms = CASES[case]
    crossings = [Crossing(seed, parameters, alarms) for seed in range(count)]
    # Stone Soup's part is the same in all cases of a whole tracker, which have the same scans.
    histories = [(ours(c), theirs(seed, HARD if alarms else WHOLE, alarms)) for seed, c in enumerate(crossings)]
    identities = np.array([[kept(c, h[-1]) for h in pair] for c, pair in zip(crossings, histories, strict=True)])
    distances = np.array([[mean_ospa(c, h) for h in pair] for c, pair in zip(crossings, histories, strict=True)])
    # Two standard deviations of the position, per axis, of a lone person's track: what two tracks can tell apart.
    apart = np.array([c.closest > 2 * track_deviation() for c in crossings])
    print(f"\n{case}: {count} crossings, {apart.sum()} of them more than {2 * track_deviation():.2f} m apart")
    print("identity kept, ours and theirs: apart {} %, nearer {} %".format(*shares(identities, apart)))
    print("mean OSPA [m], ours and theirs: {:.6f} {:.6f}".format(*distances.mean(axis=0)))
    assert identities[apart, 0].mean() >= 0.97 and identities[:, 0].sum() >= identities[:, 1].sum()
    excess = distances[:, 0] - distances[:, 1]
    assert excess.mean() <= 1e-6
    assert excess.max() <= MOST.get(case, 1e-6)


def shares(identities: np.ndarray, apart: np.ndarray) -> list[np.ndarray]:
    return [np.round(100 * identities[rows].mean(axis=0), 1) for rows in (apart, ~apart)]


@pytest.mark.parametrize("case", CASES)
def test_some_crossing_people_keep_their_tracks_and_stone_soup_does_no_better(case):
    compare(case, 6)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_thousand_crossing_people_keep_their_tracks_and_stone_soup_does_no_better(case):
    compare(case, 1000)


def test_twenty_crossings_with_false_alarms_keep_identity():
    crossings = [Crossing(seed, *CASES["association alone"]) for seed in range(20)]
    apart = [c for c in crossings if c.closest > 2 * track_deviation()]
    assert np.mean([kept(c, ours(c)[-1]) for c in apart]) >= 0.97 and len(apart) > 10
