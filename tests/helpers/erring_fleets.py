"""Fleets that see the same people from poses that err, without a forest, images or planners."""

from typing import NamedTuple

import numpy as np

from helpers.scenes import CAMERA, MOTION
from sim.sensing.navigation import NavigationErrors
from tracking.filter.kalman import Gaussian
from tracking.fusion.consensus import step
from tracking.geometry.camera import Pose
from tracking.parameters import TrackerParameters
from tracking.registration.pose_errors import move_to_believed
from tracking.track import Scan, Track
from tracking.tracker import Tracker

DT, NOISE = 0.2, 0.3  # s between scans; m, of a detection


def hover(time):
    return np.zeros(2)


def turn_back(time, speed=3.0, period=6.0):
    """A place on a line, flown to and fro from rest, at most `speed` m/s fast."""
    rate = 2 * np.pi / period
    return np.array([speed / rate * (1.0 - np.cos(rate * time)), 0.0])


def reverse_at_once(time, speed=3.0, period=6.0):
    """The same with turns at an instant between scans, as kinematic UAVs make them, after half a second at rest."""
    way = (max(time - 0.5, 0.0) + period / 4) % period
    return np.array([speed * (period / 4 - abs(way - period / 2)), 0.0])


class ErringFleet(NamedTuple):
    """Trackers before the first scan, their scans, and the errors they do not know."""

    trackers: list
    scans: list  # of each scan one of each UAV
    people: np.ndarray  # (K, M, 4)
    offsets: np.ndarray  # (K, UAVs, 2) m, drifts and jumps of the believed positions
    clocks: np.ndarray  # (UAVs,) s


def make_fleet(seed, figures, *, uavs=2, scans=51, people=2, path=hover, jumps=(), clocks=None):
    """People walk by NCV near the middle, and UAVs fly a path side by side above them.

    clocks: offsets of the UAVs' clocks [s], by default drawn. jumps: triples of a scan, a UAV and metres to the
    north-east by which its believed positions err in addition from then on.
    """
    rng = np.random.default_rng(seed)
    errors = [NavigationErrors(figures, np.random.default_rng([seed, i])) for i in range(uavs)]
    for e, clock in zip(errors, [] if clocks is None else clocks, strict=False):
        e.clock = clock
    state = [np.array([x, y, *rng.normal(0.0, 0.5, 2)]) for x, y in rng.uniform(-4, 4, (people, 2))]
    initial = [Track(i, Gaussian(s + rng.normal(0.0, 0.5, 4), 0.25 * np.eye(4))) for i, s in enumerate(state)]
    parameters = TrackerParameters(MOTION, navigation=figures)
    made, walked, offsets, jumped = [], [], [], np.zeros((uavs, 2))
    for k in range(scans):
        if k:
            for e in errors:
                e.advance(DT)
            state = [rng.multivariate_normal(MOTION.F @ s, MOTION.Q) for s in state]
        for _, uav, metres in (j for j in jumps if j[0] == k):
            jumped[uav] += metres / np.sqrt(2.0)
        now, time = [], DT * k
        for i, e in enumerate(errors):
            true, stamped = (
                Pose.level(x + 6.0 * i - 3.0 * (uavs - 1), y, 40.0) for x, y in (path(time), path(time + e.clock))
            )
            believed = e.mislead(stamped)
            believed = Pose(believed.position + np.append(jumped[i], 0.0), believed.quaternion)
            z = np.array([s[:2] + NOISE * rng.standard_normal(2) for s in state])
            z = move_to_believed(z, true, believed)
            now.append(Scan(i, time, believed, z, np.tile(NOISE**2 * np.eye(2), (len(z), 1, 1))))
        made.append(now)
        walked.append(state)
        offsets.append([e._drift[:2] + j for e, j in zip(errors, jumped, strict=True)])
    fleet = [Tracker(i, CAMERA, parameters, initial) for i in range(uavs)]
    return ErringFleet(fleet, made, np.array(walked), np.array(offsets), np.array([e.clock for e in errors]))


def run_fleet(fleet, see=lambda k, fleet: None):
    """Track all scans; `see` is called after each."""
    for k, now in enumerate(fleet.scans):
        step(fleet.trackers, now)
        see(k, fleet)
    return fleet


def find_nees(error, covariance):
    """NEES per dimension."""
    return float(error @ np.linalg.solve(covariance, error)) / len(error)
