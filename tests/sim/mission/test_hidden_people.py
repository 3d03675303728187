"""Errors in people out of sight, beside those of a particle filter that has all frames of all UAVs.

`pytest -m slow -s -n 0 tests/sim/mission/test_hidden_people.py` flies 40 missions, and prints what
docs/explanation/tracks.md says of them.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from helpers.flights import fly

from planning.planners import DEFAULT_PLANNER
from sim.mission.tracker_setup import make_tracker_parameters
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import view_of
from tracking.geometry.visibility import TARGET_HEIGHT

COUNT = 3000
HELD, LOST = 1.0, 10.0  # m, where a particle filter may start, and beyond which an error is of no belief


def moved(states: np.ndarray, scenario: Scenario, rng: np.random.Generator) -> np.ndarray:
    """States (COUNT, 4) a scan later: directions stay, speeds return to that of walking in 3 s, at most `max_speed`."""
    tracking, dt = scenario.tracking, 1 / scenario.rates.sensing
    speeds = np.linalg.norm(states[:, 2:], axis=1)[:, None]
    left = np.exp(-dt / 3.0)
    wanted = np.minimum(tracking.walking_speed + left * (speeds - tracking.walking_speed), tracking.max_speed)
    after = states[:, 2:] * wanted / speeds + rng.normal(scale=tracking.sigma_a * dt, size=(COUNT, 2))
    return np.hstack([states[:, :2] + dt / 2 * (states[:, 2:] + after), after])


def unseen(states: np.ndarray, cameras, poses, forest, missed: float, rng: np.random.Generator) -> np.ndarray:
    """States (COUNT, 4) drawn anew, given that no camera detects the person; looks at one place count once."""
    points = np.column_stack([states[:, :2], np.full(COUNT, TARGET_HEIGHT)])
    seen = [c.sees(p, points) & forest.visible(p.position, points)[0] for c, p in zip(cameras, poses, strict=True)]
    weights = np.cumsum(np.where(np.any(seen, axis=0), missed, 1.0))
    places = (np.arange(COUNT) + rng.random()) / COUNT * weights[-1]
    return states[np.searchsorted(weights, places).clip(max=COUNT - 1)]


def errors(seed: int) -> Iterator[tuple[float, float]]:
    """Errors [m] of the particle filter's mean and of UAV 0's track, of each person at each scan out of sight.

    Infinite where there is no track.
    """
    flown, snapshots = fly("trees.density=75", planner=DEFAULT_PLANNER, seed=seed, duration=40)
    scenario, rng, states = flown.scenario, np.random.default_rng(seed), {}
    cameras, p = [view_of(uav, scenario) for uav in scenario.uavs], make_tracker_parameters(scenario)
    missed = 1.0 - p.detection_probability
    for snapshot in snapshots:
        tracks = {track.id: track for track in snapshot.tracks[0]}
        for person, place in enumerate(snapshot.people):
            track = tracks.get(person)
            off = np.inf if track is None else np.linalg.norm(track.belief.mean[:2] - place)
            if snapshot.matched[:, person].any():
                states.pop(person, None)
                if off < HELD:
                    states[person] = rng.multivariate_normal(track.belief.mean, track.belief.covariance, COUNT)
            elif person in states:
                predicted = moved(states[person], scenario, rng)
                states[person] = unseen(predicted, cameras, snapshot.cameras, flown.forest, missed, rng)
                error = np.linalg.norm(states[person][:, :2].mean(axis=0) - place)
                yield error, off


@pytest.mark.slow
def test_tracks_of_hidden_people_are_as_near_as_a_particle_filters_means():
    found = np.array([pair for seed in range(400, 440) for pair in errors(seed)])
    near = np.all(found < LOST, axis=1)
    particles, tracks = found[near].T
    print(f"\n{len(tracks)} errors [m]: particle filter {particles.mean():.3f}, tracks {tracks.mean():.3f}")
    print(f"left out: {1.0 - near.mean():.2%}, of the particle filter {np.mean(found[:, 0] >= LOST):.2%}")
    print(f"above 2 m: {np.mean(particles > 2.0):.1%} and {np.mean(tracks > 2.0):.1%}")
    assert near.mean() > 0.95  # lost tracks are neither dropped nor far off
    assert tracks.mean() < particles.mean()
    assert np.mean(tracks > 2.0) < np.mean(particles > 2.0)
