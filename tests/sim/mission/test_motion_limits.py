"""Measurements of held people outside the gate, and beliefs that are faster than people, by motion model.

`pytest -m slow -s -n 0 tests/sim/mission/test_motion_limits.py` flies 55 missions with the default motion model, tracks
their scans anew with each model, and prints what docs/explanation/tracks.md says of them.
"""

from dataclasses import dataclass, field

import numpy as np
import pytest
from helpers.flights import mission_of, recording_of
from msgspec.structs import replace
from scipy.stats import poisson

from planning.catalogue import DEFAULT_PLANNER
from sim.mission.recording import Recording
from sim.mission.tracker_setup import make_initial_tracks, make_tracker_parameters
from sim.scenario.loading import load_scenario
from sim.sensing.cameras import view_of
from tracking.fusion.consensus import step
from tracking.numerics.arrays import Array
from tracking.numerics.assignment import most_pairs
from tracking.numerics.distances import squared_distance
from tracking.parameters import TrackerParameters
from tracking.track import Track, beliefs_of
from tracking.tracker import Tracker

FASTEST, MARGIN = 3.0, 1.0  # m/s and m: people come no farther from where they were last seen
ANGLES = 2.0 * np.pi / 64 * np.arange(64)
DIRECTIONS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])


@dataclass
class Found:
    """Findings in the tracks of several missions."""

    errors: list[list[float]] = field(default_factory=list)  # of held people, see `squared_errors`
    speeds: list[float] = field(default_factory=list)  # m/s, of the means of reported tracks
    beyond: list[float] = field(default_factory=list)  # probability of places out of reach, of tracks out of sight

    def add(self, recording: Recording, motion: str) -> None:
        """Track the scans of a recording anew with a motion model; tracks with the model flown must be the recorded."""
        setting = recording.setting
        anew = replace(setting, tracking=replace(setting.tracking, motion=motion))
        forest, known = recording.known_forest, make_initial_tracks(setting, *recording.people[:2])
        fleet = [
            Tracker(i, view_of(u, anew), forest, make_tracker_parameters(anew), known) for i, u in enumerate(anew.uavs)
        ]
        for k, time in enumerate(recording.times.tolist()):
            for tracker in fleet if k else ():
                self.errors += squared_errors(recording, k, tracker)
            step(fleet, [recording.scan_at(k, i) for i in range(len(fleet))], rounds=anew.network.rounds)
            tracks = fleet[0].tracks
            if motion == setting.tracking.motion:
                for ours, theirs in zip(beliefs_of(tracks), beliefs_of(recording.tracks_at(k, 0)), strict=True):
                    np.testing.assert_array_equal(ours, theirs)
            reported = [track for track in tracks if track.reported]
            self.speeds += [float(np.linalg.norm(track.belief.mean[2:])) for track in reported]
            self.beyond += [out_of_reach(track, time) for track in reported if track.sighting[2] < time]

    def report(self, name: str, p: TrackerParameters) -> tuple[int, float, float]:
        """Print shares, and return those that are asserted.

        These are the number of measurements outside the gate, without those outside by their own error alone, the
        share of fast beliefs, and the mean probability of places out of reach.
        """
        outside, noise, moved = np.array(self.errors).T > p.measurement_gate
        speeds, beyond = np.array(self.speeds), np.array(self.beyond)
        fast, count = float(np.mean(speeds > FASTEST)), len(outside)
        expected = (1.0 - p.gate_probability) * count
        print(f"\n{name}: {outside.sum()} of {count} measurements are outside the gate, {expected:.1f} expected")
        alone = np.sum(outside & noise), np.sum(outside & moved)
        print(f"by the error of the measurement alone {alone[0]}, by that of the prediction alone {alone[1]}")
        print(f"faster than {FASTEST} m/s: {fast:.2%} of {len(speeds)} beliefs")
        print(f"out of reach: {beyond.mean():.3%}, above 1 % in {np.mean(beyond > 0.01):.1%} of {len(beyond)} beliefs")
        return int(np.sum(outside & ~noise)), fast, float(beyond.mean())


def squared_errors(recording: Recording, k: int, tracker: Tracker) -> list[list[float]]:
    """Squared Mahalanobis distances (D, 3) of a scan's measurements of people that a track held at the scan before.

    They are those of the measurement from the prediction, of the measurement from the person, and of the person from
    the prediction. Detected people and measurements are paired at the least total distance, however large.
    """
    tracks = [track for track in tracker.tracks if track.reported]
    means, covariances = beliefs_of(tracks)
    gap = between(recording.people[k - 1], means[:, :2])
    held = dict(most_pairs(gap <= 1.0, gap))
    predicted, spread = tracker.motion.predict_all(means, covariances)
    scan, detected = recording.scan_at(k, tracker.uav), np.flatnonzero(recording.matched[k, tracker.uav])
    gap = between(recording.people[k, detected], scan.measurements)
    pairs = [(int(detected[d]), j) for d, j in most_pairs(gap < np.inf, gap) if detected[d] in held]
    of, columns = np.array(pairs, dtype=int).reshape(-1, 2).T
    rows = [held[person] for person in of.tolist()]
    z, R, there = scan.measurements[columns], scan.covariances[columns], recording.people[k, of]
    x, P = predicted[rows, :2], spread[rows, :2, :2]
    errors = (z - x, P + R), (z - there, R), (there - x, P)
    return np.column_stack([squared_distance(*error) for error in errors]).tolist()


def between(ours: Array, theirs: Array) -> Array:
    """Distances (A, B) m of points (A, 2) and (B, 2)."""
    return np.linalg.norm(ours[:, None] - theirs[None], axis=2)


def out_of_reach(track: Track, time: float) -> float:
    """Probability of places that the person cannot have reached since the last sure detection.

    A ray from the mean crosses the circle of reach at two distances r, in standard deviations, if at all; beyond r is
    the share exp(-r²/2) of the ray's probability.
    """
    rays = DIRECTIONS @ np.linalg.cholesky(track.belief.covariance[:2, :2]).T
    off, reach = track.belief.mean[:2] - track.sighting[:2], FASTEST * (time - track.sighting[2]) + MARGIN
    a, b, c = (rays**2).sum(axis=1), rays @ off, off @ off - reach**2
    root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    enters, leaves = (np.exp(-(np.maximum(r / a, 0.0) ** 2) / 2.0) for r in (-b - root, -b + root))
    return float(1.0 - np.mean(enters - leaves))


@pytest.mark.slow
@pytest.mark.parametrize(("world", "seeds"), [("forest", range(300, 340)), ("crowd", range(300, 315))])
def test_gates_cover_changes_of_speed_and_few_beliefs_are_faster_than_people(world, seeds):
    setting, found = load_scenario(world), {"mean-reverting": Found(), "ncv": Found()}
    for seed in seeds:
        mission = mission_of(setting, DEFAULT_PLANNER, seed)
        recording = recording_of(mission, list(mission.fly()), seed=seed)
        for motion, findings in found.items():
            findings.add(recording, motion)
    p = make_tracker_parameters(setting)
    (outside, fast, beyond), (_, *ncv) = (f.report(f"{world}, {name}", p) for name, f in found.items())
    assert outside <= poisson.ppf(0.999, (1.0 - p.gate_probability) * len(found["mean-reverting"].errors))
    assert fast < 0.2 * ncv[0] and beyond < 0.2 * ncv[1]
