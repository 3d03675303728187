"""Times of the parts of a mission, beside what each replaces; docs/results/benchmarks.md says how to run this.

In ordinary test runs each part runs once, as a smoke test.
"""

import dataclasses
import math

import numpy as np
import pytest
from helpers.nominal import nominal, plain_cost
from helpers.scenes import CAMERA, MOTION, R, track
from helpers.timing import least

from planning.baselines import Hover
from planning.composed import Composed
from planning.objective.nbo import make_objective
from sim.mission.mission import Mission
from sim.scenario.environment import Trees
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.parameters import TrackerParameters
from tracking.track import Scan
from tracking.tracker import Tracker

pytestmark = pytest.mark.benchmark(warmup=True, warmup_iterations=2, min_rounds=20)
# Seventy-five trees, five by fifteen, and people between them.
TREES = Forest(tuple(Tree(10.0 * i - 70, 20.0 * j - 40, 4.5) for i in range(15) for j in range(5)))
PEOPLE = np.array([[3.0, 7.0], [-5.0, 10.0], [6.0, 15.0], [-2.0, 12.0]])
POSE = Pose.level(0.0, 10.0, 19.0)
CANDIDATES = 256
SPARSE = [
    "duration=2",
    "sensing.mode=ideal",
    "area.width=5000",
    "area.height=5000",
    "uavs=[{start=[-2,0]}, {start=[2,0]}]",
]


@pytest.mark.benchmark(group="detection")
def test_detection(benchmark):
    with World(Scenario(), TREES, len(PEOPLE)) as world:
        world.place_people(PEOPLE, np.zeros(len(PEOPLE)))
        frame = Frame(0, 0.0, CAMERA, POSE, Renderer(world).render(CAMERA, POSE).image)
    assert len(benchmark(BlobDetector().detect, frame).ground) == len(PEOPLE)


@pytest.mark.benchmark(group="scan")
@pytest.mark.parametrize("targets", [4, 10])
@pytest.mark.parametrize("uavs", [1, 3])
def test_scan(benchmark, judged, uavs, targets):
    """JPDA of UAVs that all see all targets, and the consensus that ends a scan; of 3 UAVs and 4 targets in 0.5 ms."""
    places = np.array([[3.5 * (k % 4) - 5.0, 3.5 * (k // 4) - 4.0] for k in range(targets)])
    known = [track(k, *place, 0.0, 0.0) for k, place in enumerate(places)]
    seen = places + np.random.default_rng(0).normal(0, 0.1, (uavs, targets, 2))
    pose = Pose.level(0.0, 0.0, 21.7)

    def ready():
        trackers = [Tracker(i, CAMERA, TrackerParameters(MOTION), known) for i in range(uavs)]
        return (trackers, [Scan(i, 0.2, pose, z, np.tile(R, (targets, 1, 1))) for i, z in enumerate(seen)]), {}

    def once(trackers, scans):
        for tracker, scan in zip(trackers, scans, strict=True):
            tracker.step(scan)
        fuse(trackers, ~np.eye(uavs, dtype=bool), 5)
        return trackers

    trackers = benchmark.pedantic(once, setup=ready, rounds=200, warmup_rounds=5)
    assert [[t.id for t in tracker.tracks] for tracker in trackers] == [list(range(targets))] * uavs
    assert not judged or (uavs, targets) != (3, 4) or 1e3 * benchmark.stats.stats.median < 0.5


@pytest.mark.benchmark(group="objective")
def test_objective_of_256_candidates(benchmark, random_team):
    situation, joint, candidates = problem(random_team)
    belief = nominal(situation, 5)
    values = benchmark(lambda: make_objective(belief, joint, [0], 0.5)(candidates[:, None]))
    assert values[0] == pytest.approx(plain_cost(situation, joint, 0.5)[0])


@pytest.mark.benchmark(group="objective")
def test_objective_of_one_candidate_in_plain_numpy(benchmark, random_team):
    situation, joint, _ = problem(random_team)
    assert math.isfinite(benchmark(plain_cost, situation, joint, 0.5)[0])


def problem(random_team):
    """A situation among 75 trees, the team's plans, and candidates for the first UAV, of which the first is its own."""
    rng = np.random.default_rng(0)
    situation = dataclasses.replace(random_team(0)[0], forest=TREES)
    candidates = rng.uniform(-3, 3, (CANDIDATES, 5, 2))
    joint = rng.uniform(-3, 3, (3, 5, 2))
    joint[0] = candidates[0]
    return situation, joint, candidates


@pytest.mark.benchmark(group="mission of 5 s")
@pytest.mark.parametrize("mode", ["camera", "ideal"])
def test_mission(benchmark, mode):
    """All stages but start-up and video, 75 trees expected."""
    scenario = Scenario(duration=5.0, trees=Trees(density=75.0), sensing=Sensing(mode=mode))

    def ready():
        return (Mission(scenario, Composed(), 0),), {}

    snapshots = benchmark.pedantic(lambda mission: list(mission.fly()), setup=ready, rounds=5, warmup_rounds=1)
    assert len(snapshots) == 26


def test_mission_among_5000_trees_against_50(judged):
    """Two quadrotors with ideal sensing, 2 s in 5 x 5 km, from start-up on; far trees cost no physics."""

    def fly(trees):
        setting = load_scenario("forest", [*SPARSE, f"trees.density={trees}"])
        for _ in Mission(setting, Hover(), 0).fly():
            pass

    fly(50)
    many, few = least(lambda: fly(5000), lambda: fly(50), rounds=10 if judged else 1)
    print(f"\nmission among 5000 trees: {1e3 * many:.0f} ms, among 50: {1e3 * few:.0f} ms, ratio {many / few:.1f}")
    assert not judged or many < 4 * few
