"""Beliefs of a fleet in a person hidden under a canopy, against a particle filter that has all frames of all UAVs."""

import math
from functools import cache

import numpy as np
import pytest
from helpers.graphs import graph
from helpers.scenes import CAMERA, MOTION, scan, track, tracker

from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest, Tree

INSTANTS = (10, 25, 50)  # scans: 2, 5 and 10 s
UAVS, COUNT = 3, 20_000
# Cameras above the canopy, or around it so that each sees another side; its radius [m]; and at how many of the instants
# the bounds hold. Later, and under smaller canopies, beliefs are wider: their Gaussians reach beyond the edge, and the
# average of beliefs that each lack another side lacks none.
HELD = [(0, 2, 1), (0, 3, 2), (0, 5, 2), (0, 8, 3), (1, 2, 1), (1, 3, 1), (1, 5, 2), (1, 8, 2)]


def poses(radius: float, around: bool) -> list[Pose]:
    away = radius + 6.0 if around else 2.0
    corners = [2 * math.pi * u / UAVS + 0.3 for u in range(UAVS)]
    return [Pose.level(away * math.cos(a), away * math.sin(a), 20.0 + radius) for a in corners]


def start(radius: float, speed: float) -> np.ndarray:
    """A state under the canopy, on the way out."""
    return np.array([-0.2 * radius, 0.0, speed, 0.0])


@cache
def true_deviations(radius: float, speed: float, around: bool, instants: int = 3) -> np.ndarray:
    """Deviations of the position at the first `INSTANTS`, by particles and the likelihood of all frames."""
    rng, tree = np.random.default_rng(5), Forest((Tree(0.0, 0.0, radius),))
    kick, out = MOTION.sigma_a * np.kron([[MOTION.dt**2 / 2], [MOTION.dt]], np.eye(2)), []
    x = rng.multivariate_normal(start(radius, speed), 0.05 * np.eye(4), COUNT)
    for k in range(INSTANTS[instants - 1] + 1):
        if k:
            x = x @ MOTION.F.T + rng.normal(size=(COUNT, 2)) @ kick.T
        points, weights = np.column_stack([x[:, :2], np.full(COUNT, TARGET_HEIGHT)]), np.ones(COUNT)
        for pose in poses(radius, around):
            weights *= 1.0 - 0.99 * (CAMERA.sees(pose, points) & tree.visible(pose.position, points)[0])
        steps = (np.arange(COUNT) + rng.random()) / COUNT  # systematic resampling
        x = x[np.searchsorted(np.cumsum(weights / weights.sum()), steps).clip(max=COUNT - 1)]
        if k in INSTANTS:
            out.append(math.sqrt(x[:, :2].var(axis=0).sum()))
    return np.array(out)


def believed(radius: float, speed: float, around: bool, instants: int = 3, **settings) -> np.ndarray:
    """The same of a fleet of trackers, all of which hear one another."""
    known, tree, out = track(3, *start(radius, speed)), Forest((Tree(0.0, 0.0, radius),)), []
    members = [tracker(known, uav=u, forest=tree, doubt=1e-300, **settings) for u in range(UAVS)]
    for k in range(INSTANTS[instants - 1] + 1):
        for member, pose in zip(members, poses(radius, around), strict=True):
            member.step(scan(k, uav=member.uav, pose=pose))
        fuse(members, graph("complete", UAVS), 5)
        if k in INSTANTS:
            out.append(math.sqrt(np.trace(members[0].tracks[0].belief.covariance[:2, :2])))
    return np.array(out)


@pytest.mark.parametrize("speed", [0.5, 1.5])
@pytest.mark.parametrize(("around", "radius", "instants"), HELD)
def test_a_fleets_belief_in_a_hidden_person_is_as_wide_as_a_particle_filters(around, radius, instants, speed):
    case = float(radius), speed, bool(around), instants
    for fusion in ("kla", "hcmci"):
        ratios = believed(*case, fusion=fusion) / true_deviations(*case)
        assert 0.8 <= ratios.min() and ratios.max() <= 1.25


def test_without_negative_information_beliefs_are_wider():
    ratios = believed(2.0, 1.0, True, absence_weight=0.0) / true_deviations(2.0, 1.0, True)
    assert ratios[0] > 1.3 and ratios[1] > 2.5
