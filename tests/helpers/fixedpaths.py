"""People moving as trackers assume, UAVs on fixed paths that scan them, and errors of beliefs."""

import math
from dataclasses import dataclass, field

import numpy as np

from helpers.scenes import CAMERA, MOTION, OPEN
from sim.scenario.environment import Area, People
from sim.world.trajectories import SAMPLES_PER_SECOND
from sim.world.walkers import walk
from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.fusion.consensus import step
from tracking.fusion.late_scans import FleetState, ScanLog
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.distances import squared_distance
from tracking.parameters import TrackerParameters
from tracking.track import Scan, Track
from tracking.tracker import Tracker

SCANS = 101  # 20 s
START = 0.25 * np.eye(4)  # covariance of the tracks that are known at the start
NOISES = [NoiseModel.range_bearing(alpha) for alpha in (0.1, 0.15, 0.12)]
LOW, HIGH = (17.3, 21.7, 19.1), (100.0, 110.0, 120.0)  # m; fields of view of 20, 25, 22 m, and of 115 m and more
# A step's acceleration and what it does to a state; MOTION.Q = KICK @ KICK.T.
KICK = MOTION.sigma_a * np.kron([[MOTION.dt**2 / 2], [MOTION.dt]], np.eye(2))
PLACES = ((-15, -14), (-14, 3), (-12, 16), (-1, -8), (2, 8), (11, -15), (13, 1), (14, 17))
TREES = Forest(tuple(Tree(float(x), float(y)) for x, y in PLACES))  # canopies of 5 m


@dataclass(frozen=True, eq=False)
class Case:
    """Settings of a mission. UAV i has the noise of the default fleet's UAV i modulo 3."""

    altitudes: tuple[float, ...] = LOW  # m
    adjacency: np.ndarray = field(default_factory=lambda: ~np.eye(3, dtype=bool))
    rounds: int = 5
    people: int = 4
    way: str = "ncv"  # of people: "ncv" from starts spread over some 20 m, "meet" (the same, two), or "walkers"
    forest: Forest = OPEN
    detection: float = 0.99
    alarms: float = 1e-6  # per m²
    motion: NearlyConstantVelocity = MOTION  # that trackers assume
    late: int = 0  # scans after which UAVs receive those of others; in place of consensus if above 0


class Mission:
    """One of many; whatever the fusion, it has the same people and scans.

    A measurement has the covariance of the place it is drawn about, and its scan has it, too. In the testbed, where
    that place is not known, a scan has the one of the place measured.
    """

    def __init__(self, case: Case, seed: int) -> None:
        self.case = case
        people, flight, self._sensing = np.random.default_rng([9, seed]).spawn(3)
        self.known, self.truth = _walked(case, people) if case.way == "walkers" else _moved(case, people)
        count = len(case.altitudes)
        self._phases, self._centres = flight.uniform(0, 2 * math.pi, count), flight.normal(0, 4, (count, 2))
        self.scans = [[self._scan(uav, k) for uav in range(count)] for k in range(SCANS)]

    def _pose(self, uav: int, k: int) -> Pose:
        """On a circle of 12 m at 4 m/s, to the left or to the right."""
        angle = self._phases[uav] + (-1) ** uav * k * MOTION.dt * 4.0 / 12.0
        x, y = self._centres[uav] + 12.0 * np.array([math.cos(angle), math.sin(angle)])
        return Pose.level(x, y, self.case.altitudes[uav])

    def _scan(self, uav: int, k: int) -> Scan:
        c, rng, pose = self.case, self._sensing, self._pose(uav, k)
        points = np.column_stack([self.truth[k, :, :2], np.full(c.people, TARGET_HEIGHT)])
        seen = CAMERA.sees(pose, points) & c.forest.visible(pose.position, points)[0]
        seen &= rng.random(c.people) < c.detection
        half = (pose.position[2] - TARGET_HEIGHT) * math.tan(CAMERA.fov / 2)
        alarms = pose.position[:2] + rng.uniform(-half, half, (rng.poisson(c.alarms * (2 * half) ** 2), 2))
        places = np.vstack([self.truth[k, seen, :2], alarms])
        R = np.array([NOISES[uav % 3].covariance(pose.position[:2], x) for x in places]).reshape(-1, 2, 2)
        noise = np.linalg.cholesky(R) @ rng.normal(size=(len(R), 2, 1))
        return Scan(uav, k * MOTION.dt, pose, places + noise[..., 0], R, c.forest)


def _moved(case: Case, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Means of the tracks known at the start (M, 4), and states (K, M, 4) drawn from the tracker's own model."""
    if case.way == "meet":
        heading, angle = rng.uniform(0, 2 * math.pi), math.radians(rng.uniform(20, 90))
        v = rng.uniform(1, 2, 2)[:, None] * [[math.cos(a), math.sin(a)] for a in (heading, heading + angle)]
        x = rng.normal(0, 0.3, (2, 2)) - rng.uniform(4, 8) * v
    else:
        x, v = rng.normal(0, 10, (case.people, 2)), rng.normal(0, 0.7, (case.people, 2))
    known = np.column_stack([x, v])
    states = [known + rng.normal(size=known.shape) @ np.linalg.cholesky(START).T]
    for _ in range(SCANS - 1):
        states.append(states[-1] @ MOTION.F.T + rng.normal(size=(case.people, 2)) @ KICK.T)
    return known, np.array(states)


def _walked(case: Case, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The same of the testbed's walkers in 60 x 60 m; velocities are differences."""
    every = round(MOTION.dt * SAMPLES_PER_SECOND)
    walkers = walk(People(count=case.people, paths=()), Area(60, 60), case.forest, duration=SCANS * MOTION.dt, rng=rng)
    velocities = np.diff(walkers.positions, axis=0) * SAMPLES_PER_SECOND
    truth = np.concatenate([walkers.positions[:-1], velocities], axis=2)[::every][:SCANS]
    return truth[0] + rng.normal(size=truth[0].shape) @ np.linalg.cholesky(START).T, truth


def errors(mission: Mission, fusion: str) -> tuple[np.ndarray, np.ndarray]:
    """NEES of position and of state (K, UAVs, M, 2) of the track with each person's id; NaN where it has ended.

    And where that track is elsewhere (K, UAVs, M): nearer to another person, by the NEES of state as that person's.
    """
    c = mission.case
    parameters = TrackerParameters(c.motion, detection_probability=c.detection, clutter_density=c.alarms, fusion=fusion)
    initial = [Track(i, Gaussian(mean, START)) for i, mean in enumerate(mission.known)]
    fleet = [Tracker(u, CAMERA, parameters, initial) for u in range(len(c.altitudes))]
    logs = [ScanLog(u, FleetState(fleet), 2 * c.late) for u in range(len(fleet)) if c.late]
    out = np.full((SCANS, len(fleet), c.people, 2), np.nan)
    elsewhere = np.zeros(out.shape[:3], dtype=bool)
    for k, scans in enumerate(mission.scans):
        if not logs:
            step(fleet, scans, c.adjacency, rounds=c.rounds)
        for u, log in enumerate(logs):
            for other in mission.scans[k - c.late] if k >= c.late else ():
                log.add(k - c.late, other)
            log.step(k * MOTION.dt, scans[u])
        for u, tracker in enumerate([log.tracker for log in logs] or fleet):
            held = [track for track in tracker.tracks if track.id < c.people]
            if held:
                ids = [track.id for track in held]
                means = np.array([track.belief.mean for track in held])
                P = np.array([track.belief.covariance for track in held])
                e = means - mission.truth[k, ids]
                out[k, u, ids] = np.column_stack([squared_distance(e[:, :2], P[:, :2, :2]), squared_distance(e, P)])
                as_others = [squared_distance(means - person, P) for person in mission.truth[k]]
                elsewhere[k, u, ids] = np.min(as_others, axis=0) < out[k, u, ids, 1]
    return out, elsewhere
