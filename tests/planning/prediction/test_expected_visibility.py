"""Expected visibility against Monte Carlo: traces of a covariance that is updated where drawn targets are in view."""

import dataclasses

import numpy as np
import pytest
from helpers.nominal import team_cost

from planning.prediction.propagation import Nominal
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree
from tracking.track import Track

HORIZON, DRAWS = 5, 3000
# Half of the field of view's edge is 11.0 m at 20 m: targets inside, at and outside the edges and a corner.
PLACES = [(0, 0), (8, 0), (10, 3), (11, -2), (12, 0), (14, 5), (9, 9), (11, 11), (0, 10), (0, 12), (18, 0)]
TREES = (Tree(6.0, 3.0), Tree(-5.0, -8.0))


def covariances(noise, offsets):
    """R (N, 2, 2) m² of targets at these offsets (N, 2) m from the camera."""
    distances = np.hypot(*offsets.T)
    ahead, r = offsets / distances[:, None], np.maximum(distances, noise.minimum_range)
    along, across = ((c[0] + r * (c[1] + r * c[2]))[:, None, None] for c in (noise.radial, noise.tangential))
    return across * np.eye(2) + (along - across) * ahead[:, :, None] * ahead[:, None]


def monte_carlo(situation, controls, rng):
    """Sum over steps of the expected trace, over targets drawn from belief and motion model."""
    (track,), motion = situation.tracks, situation.motion
    states = rng.multivariate_normal(track.belief.mean, track.belief.covariance, DRAWS)
    P = np.repeat(track.belief.covariance[None], DRAWS, axis=0)
    total, positions = 0.0, [v.position[:2] for v in situation.vehicles]
    for step in range(HORIZON):
        states = states @ motion.F.T + rng.multivariate_normal(np.zeros(4), motion.Q, DRAWS)
        points = np.column_stack([states[:, :2], np.full(DRAWS, TARGET_HEIGHT)])
        P = motion.F @ P @ motion.F.T + motion.Q
        positions = [p + u * situation.step for p, u in zip(positions, controls[:, step], strict=True)]
        for v, p in zip(situation.vehicles, positions, strict=True):
            camera = np.array([*p, v.position[2]])
            seen = v.camera.sees(Pose(camera, v.attitude), points) & situation.forest.visible(camera, points)[0]
            R = covariances(v.noise, points[seen, :2] - p)
            gain = P[seen][:, :, :2] @ np.linalg.inv(P[seen][:, :2, :2] + R)
            P[seen] -= gain @ P[seen][:, :2]
        total += np.trace(P[:, :2, :2], axis1=1, axis2=2).mean()
    return total


def watched(base, place, deviation, trees):
    """A UAV above the origin and one target with these standard deviations [m], half as much in velocity [m/s]."""
    belief = Gaussian(np.array([*place, 0.8, 0.3]), np.diag([deviation**2] * 2 + [0.25] * 2))
    own = dataclasses.replace(base.own, position=np.array([0.0, 0.0, 20.0]))
    return dataclasses.replace(base, own=own, tracks=(Track(0, belief),), forest=Forest(trees))


@pytest.mark.parametrize("deviation", [0.3, 1.0, 3.0, *(pytest.param(d, marks=pytest.mark.slow) for d in (0.5, 1.5))])
def test_the_expected_trace_is_that_of_monte_carlo(random_team, deviation):
    """In the mean over places inside, at and outside the edge, from UAVs that hover or fly; five are coarse at one."""
    base = random_team(0, uavs=1)[0]
    ratios = np.empty((2, 2, len(PLACES)))
    for k, velocity in enumerate(((0.0, 0.0), (2.0, 2.0))):
        controls, rng = np.tile(np.array(velocity), (1, HORIZON, 1)), np.random.default_rng(0)
        for m, trees in enumerate(((), TREES)):
            for n, place in enumerate(PLACES):
                situation = watched(base, place, deviation, trees)
                belief = Nominal(expected=True).predict(situation, HORIZON, rng)
                ratios[k, m, n] = team_cost(belief, controls, 0.0) / monte_carlo(situation, controls, rng)
    off = np.abs(PLACES).max(axis=1)
    inside, edge, outside = (ratios[:, :, at].mean() for at in (off < 10, (off >= 10) & (off <= 12), off > 12))
    assert 0.9 < inside < 1.1 and 0.9 < edge < 1.18 and 0.97 < outside < 1.03
    each = ratios.mean(axis=(1, 2))  # of a UAV that hovers and of one that flies
    assert each.min() > 0.92 and each.max() < 1.12
    assert ratios.min() > 0.6 and ratios.max() < 1.85
