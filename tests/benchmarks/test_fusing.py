"""How long the fleet's consensus takes; docs/benchmarks.md says how to run this.

In ordinary test runs each part runs once, as a smoke test.
"""

import numpy as np
import pytest
from scenes import CAMERA, MOTION, OPEN, R, track
from test_consensus import graph

from tracking.camera import Pose
from tracking.consensus import fuse
from tracking.tracker import Scan, Tracker, TrackerParameters

pytestmark = pytest.mark.benchmark(group="consensus of 50 tracks, 5 rounds")
PLACES = np.array([[2.5 * (k % 8) - 9.0, 2.5 * (k // 8) - 9.0] for k in range(50)])


@pytest.mark.parametrize("fusion", ["kla", "hcmci"])
@pytest.mark.parametrize(("kind", "uavs"), [("complete", 20), ("ring", 20), ("ring", 60)])
def test_consensus(benchmark, kind, uavs, fusion):
    """Every UAV has seen everybody; what their scans and JPDA take is left out."""
    parameters = TrackerParameters(MOTION, fusion=fusion)
    known = [track(k, *place, 0.0, 0.0) for k, place in enumerate(PLACES)]
    seen = PLACES + np.random.default_rng(0).normal(0, 0.1, (uavs, *PLACES.shape))
    adjacency = graph(kind, uavs)

    def ready():
        trackers = [Tracker(u, CAMERA, OPEN, parameters, known) for u in range(uavs)]
        for t, z in zip(trackers, seen, strict=True):
            t.step(Scan(t.uav, 0.2, Pose.level(0.0, 0.0, 21.7), z, np.tile(R, (len(z), 1, 1))))
        return (trackers, adjacency, 5), {}

    sent = benchmark.pedantic(fuse, setup=ready, rounds=15, warmup_rounds=1)
    assert np.all(sent > 0)
