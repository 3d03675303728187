"""Our tracker beside Stone Soup's JPDA on Stone Soup's own simulator: the tables of docs/results/peers.md.

`python docs/peers.py compare` prints both trackers' scores, and `tune` chooses the settings of Stone Soup's tracker, on
seeds of its own, which `compare` does not use.
"""

from __future__ import annotations

import itertools
import math
from argparse import ArgumentParser
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from stonesoup.base import Property
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDAwithEHM2
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.base import Hypothesiser
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.simulator.simple import MultiTargetGroundTruthSimulator, SimpleDetectionSimulator
from stonesoup.tracker.simple import MultiTargetMixtureTracker
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.updater.kalman import KalmanUpdater

from sim.scenario.quantities import parse_integers
from sim.study.analysis.intervals import estimate_means
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.fusion.consensus import step
from tracking.geometry.camera import ALL_ROUND, Camera, Pose
from tracking.metrics.clearmot import count_switches, find_correspondence
from tracking.metrics.ospa import gospa
from tracking.numerics.arrays import Array
from tracking.parameters import TrackerParameters
from tracking.track import Scan
from tracking.tracker import Tracker

EPOCH = datetime(2000, 1, 1)
SCANS, DT, SIDE = 80, 0.5, 120.0  # number, s, and edge of the area [m]
PEOPLE, BIRTHS, DEATH = 5, 0.1, 0.01  # people at the start; births and probability of a death per scan
SPREAD, SPEED = 25.0, 1.0  # standard deviations along each axis of a birth's place [m] and velocity [m/s]
R = 0.5**2 * np.eye(2)  # m², of a measurement
MOTION = NearlyConstantVelocity(DT, 0.3)
NEAR = 15.0  # m along each axis, beyond any gate
CUT_OFF = 10.0  # m, of GOSPA and of the correspondence of tracks and people


class Cell(NamedTuple):
    """A line of the table."""

    detection: float  # probability
    alarms: int  # expected number of false alarms per scan

    @property
    def clutter(self) -> float:
        """False alarms per m²."""
        return self.alarms / SIDE**2


class Scene(NamedTuple):
    """What the simulators give."""

    times: list[datetime]
    detections: list[set[Any]]  # Stone Soup's
    people: list[dict[str, Array]]  # positions (2,) m by id, of each scan


class Tuning(NamedTuple):
    """Settings of Stone Soup's tracker."""

    points: int = 3  # measurements that start a track
    steps: int = 3  # scans without a measurement that end it
    gate: float = 0.999  # probability that a person's measurement is in the gate
    tentative: int = 2  # scans without a measurement that end a track not yet started


TRIED = {"points": (3, 4, 5), "steps": (2, 3, 5, 8), "tentative": (1, 2, 3), "gate": (0.99, 0.999, 0.9999)}
SEEDS = {"compare": "0-19", "tune": "1000-1005"}
TUNED = {  # by `tune`
    Cell(0.9, 10): Tuning(points=3, steps=3, gate=0.999),
    Cell(0.9, 30): Tuning(points=4, steps=3, gate=0.999),
    Cell(0.7, 10): Tuning(points=3, steps=5, gate=0.999),
    Cell(0.7, 30): Tuning(points=4, steps=5, gate=0.99),
}


def simulate(cell: Cell, seed: int, scans: int = SCANS) -> Scene:
    """A scene of Stone Soup's simulators, the same for the same seed."""
    motion, sensor, births, detector = np.random.SeedSequence(seed).generate_state(4).tolist()
    covariance = np.diag(np.square([SPREAD, SPREAD, SPEED, SPEED]))
    truth = MultiTargetGroundTruthSimulator(
        transition_model=LinearGaussianTimeInvariantTransitionModel(
            transition_matrix=MOTION.F, covariance_matrix=MOTION.Q, seed=motion
        ),
        initial_state=GaussianState(np.zeros(4), covariance, timestamp=EPOCH),
        timestep=timedelta(seconds=DT),
        number_steps=scans,
        birth_rate=BIRTHS,
        death_probability=DEATH,
        initial_number_targets=PEOPLE,
        seed=births,
    )
    scene = Scene([], [], [])
    simulator = SimpleDetectionSimulator(
        truth,
        LinearGaussian(4, (0, 1), R, seed=sensor),
        SIDE / 2 * np.array([[-1, 1], [-1, 1]]),
        detection_probability=cell.detection,
        clutter_rate=cell.alarms,
        seed=detector,
    )
    for time, detections in simulator:
        scene.times.append(time)
        scene.detections.append(detections)
        there = [path for path in truth.groundtruth_paths if path.timestamp == time]
        scene.people.append({path.id: np.array(path.state_vector, float).ravel()[:2] for path in there})
    return scene


def parameters(cell: Cell, **thresholds: float) -> TrackerParameters:
    """The simulators' models for our tracker; other thresholds are the defaults."""
    density = BIRTHS / (4 * math.pi * SPREAD**2)  # the mean over the places of births
    models = {
        "detection_probability": cell.detection,
        "clutter_density": cell.clutter,
        "birth_density": density,
        "survival": (1 - DEATH) ** (1 / DT),
        "max_speed": 2 * SPEED,
    }
    return TrackerParameters(MOTION, **(models | thresholds))


def ours(scene: Scene, settings: TrackerParameters) -> list[dict[Any, Array]]:
    """Positions of the reported tracks of a scan, by id."""
    tracker, pose, found = Tracker(0, Camera(ALL_ROUND, 1), settings), Pose.level(0, 0, 60), []
    for time, detections in zip(scene.times, scene.detections, strict=True):
        z = np.array(sorted(np.array(d.state_vector, float).ravel().tolist() for d in detections)).reshape(-1, 2)
        step([tracker], [Scan(0, (time - EPOCH).total_seconds(), pose, z, np.tile(R, (len(z), 1, 1)))])
        found.append({t.id: t.belief.mean[:2] for t in tracker.tracks if t.reported})
    return found


def theirs(scene: Scene, cell: Cell, tuning: Tuning) -> list[dict[Any, Array]]:
    """The same of Stone Soup's tracker."""
    predictor = KalmanPredictor(
        LinearGaussianTimeInvariantTransitionModel(transition_matrix=MOTION.F, covariance_matrix=MOTION.Q)
    )
    updater = KalmanUpdater(None)
    nearest = GNNWith2DAssignment(Near(DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=3)))
    hypothesiser = PDAHypothesiser(
        predictor,
        updater,
        clutter_spatial_density=cell.clutter,
        prob_detect=cell.detection,
        prob_gate=tuning.gate,
    )
    tracker = MultiTargetMixtureTracker(
        initiator=MultiMeasurementInitiator(
            GaussianState(np.zeros(4), np.diag([0, 0, SPEED**2, SPEED**2])),
            deleter=UpdateTimeStepsDeleter(tuning.tentative),
            data_associator=nearest,
            updater=updater,
            min_points=tuning.points,
        ),
        deleter=UpdateTimeStepsDeleter(tuning.steps),
        detector=list(zip(scene.times, scene.detections, strict=True)),
        data_associator=JPDAwithEHM2(Near(hypothesiser)),
        updater=updater,
    )
    return [{t.id: np.array(t.state_vector, float).ravel()[:2] for t in tracks} for _, tracks in tracker]


class Near(Hypothesiser):
    """The same hypotheses in less time: detections farther than `NEAR`, which are in no gate, are left out first."""

    hypothesiser: Hypothesiser = Property()

    def hypothesise(self, track: Track, detections: Iterable[Any], *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401, D102
        x, y = track.state_vector[0, 0], track.state_vector[1, 0]
        near = {d for d in detections if abs(d.state_vector[0, 0] - x) < NEAR and abs(d.state_vector[1, 0] - y) < NEAR}
        return self.hypothesiser.hypothesise(track, near, *args, **kwargs)


class Score(NamedTuple):
    """Means over the scans of a scene, but for the switches, which are counted."""

    gospa: float  # m
    missed: float
    false: float
    switches: int
    before: float  # missed without a track so far
    after: float  # missed whose last track is not reported any more
    elsewhere: float  # missed whose last track is still reported


def score(scene: Scene, found: Sequence[Mapping[Any, Array]]) -> Score:
    """Score of the reported positions of each scan."""
    far = CUT_OFF**2 / 2
    parts = [gospa(places(tracks), places(people), CUT_OFF) for tracks, people in zip(found, scene.people, strict=True)]
    tracks, people = columns(found), columns(scene.people)
    matches = find_correspondence(tracks, people, CUT_OFF)
    causes = {"before": 0, "after": 0, "elsewhere": 0}
    for scan, person in np.argwhere((matches < 0) & ~np.isnan(people[..., 0])).tolist():
        held = matches[:scan, person]
        last = held[held >= 0][-1:]
        gone = len(last) and math.isnan(tracks[scan, last[0], 0])
        causes["before" if not len(last) else "after" if gone else "elsewhere"] += 1
    return Score(
        float(np.mean([part.distance for part in parts])),
        float(np.mean([part.missed**2 / far for part in parts])),
        float(np.mean([part.false**2 / far for part in parts])),
        int(count_switches(matches).sum()),
        **{cause: count / len(found) for cause, count in causes.items()},
    )


def places(scan: Mapping[Any, Array]) -> Array:
    """Positions (N, 2) m of all in a scan."""
    return np.array([*scan.values()]).reshape(-1, 2)


def columns(scans: Sequence[Mapping[Any, Array]]) -> Array:
    """Positions (K, N, 2) m of all that occur in K scans, in the order of their first; NaN where absent."""
    ids = list(dict.fromkeys(itertools.chain(*scans)))
    absent = np.full(2, np.nan)
    return np.array([[scan.get(id, absent) for id in ids] for scan in scans]).reshape(len(scans), len(ids), 2)


def tune(cell: Cell, seeds: Sequence[int], scans: int = SCANS) -> Tuning:
    """The settings of Stone Soup's tracker with the least mean GOSPA, one varied at a time until none gets better."""
    scenes = [simulate(cell, seed, scans) for seed in seeds]

    @cache
    def cost(tuning: Tuning) -> float:
        mean = float(np.mean([score(scene, theirs(scene, cell, tuning)).gospa for scene in scenes]))
        print(cell, tuning, f"{mean:.3f} m", flush=True)
        return mean

    best, before = Tuning(), None
    while best != before:
        before = best
        for name, values in TRIED.items():
            best = min((best._replace(**{name: value}) for value in values), key=cost)
    return best


def compare(cells: Iterable[Cell], seeds: Sequence[int], scans: int = SCANS) -> str:
    """Table of Stone Soup's means over the seeds, and of our paired differences from these with their intervals."""
    lines = []
    for cell in cells:
        scenes = [simulate(cell, seed, scans) for seed in seeds]
        peer = np.array([score(scene, theirs(scene, cell, TUNED[cell])) for scene in scenes])
        lines.append([f"{cell.detection}, {cell.alarms}", "Stone Soup's JPDA", *shown(peer), causes(peer)])
        for name, changes in {"ours": {}, "ours, confirmed at 0.5": {"confirmation_threshold": 0.5}}.items():
            own = np.array([score(scene, ours(scene, parameters(cell, **changes))) for scene in scenes])
            lines.append(["", f"{name}, less these", *gaps(own - peer), causes(own)])
    return markdown(["P_D, false alarms", "tracker", "GOSPA [m]", "missed", "false", "switches", "causes"], lines)


def shown(scores: Array) -> list[str]:
    """The means of scores (n, 7), without the causes of misses."""
    return [f"{mean:.2f}" for mean in scores[:, :4].mean(axis=0)]


def gaps(scores: Array) -> list[str]:
    """The means of differences of scores (n, 7), without the causes of misses, with their intervals."""
    return [f"{e.value:+.2f} [{e.low:+.2f}, {e.high:+.2f}]" for e in estimate_means(scores[:, :4])]


def causes(scores: Array) -> str:
    """People missed in a scan before their first track, after their last one, and while it is elsewhere."""
    return " / ".join(f"{mean:.2f}" for mean in scores[:, 4:].mean(axis=0))


def markdown(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (heads, ["---"] * len(heads), *lines))


def main(words: Sequence[str] | None = None) -> None:
    """Print what the words of the command line ask for."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=SEEDS)
    parser.add_argument("--seeds", help="such as 0-9; by default those of docs/results/peers.md")
    parser.add_argument("--scans", type=int, default=SCANS)
    options = parser.parse_args(words)
    seeds = parse_integers(options.seeds or SEEDS[options.task], "--seeds")
    if options.task == "tune":
        for cell in TUNED:
            print(cell, tune(cell, seeds, options.scans))
    else:
        print(compare(list(TUNED), seeds, options.scans))


if __name__ == "__main__":
    main()
