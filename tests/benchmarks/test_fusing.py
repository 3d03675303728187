"""Times of the fleet's consensus; docs/results/benchmarks.md says how to run this.

In ordinary test runs each part runs once, as a smoke test, and its times are not judged.
"""

import time

import numpy as np
import pytest
from helpers.graphs import graph
from helpers.scenes import CAMERA, MOTION, R, track

from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Pose
from tracking.parameters import TrackerParameters
from tracking.track import Scan
from tracking.tracker import Tracker

pytestmark = pytest.mark.benchmark(group="consensus of 50 tracks, 5 rounds")
PLACES = np.array([[2.5 * (k % 8) - 9.0, 2.5 * (k // 8) - 9.0] for k in range(50)])


BOUND = 10.0  # ms, for 20 UAVs


def ready(uavs, fusion):
    """Trackers that have all seen every person; the times of their scans and JPDA are left out."""
    parameters = TrackerParameters(MOTION, fusion=fusion)
    known = [track(k, *place, 0.0, 0.0) for k, place in enumerate(PLACES)]
    seen = PLACES + np.random.default_rng(0).normal(0, 0.1, (uavs, *PLACES.shape))
    trackers = [Tracker(u, CAMERA, parameters, known) for u in range(uavs)]
    for t, z in zip(trackers, seen, strict=True):
        t.step(Scan(t.uav, 0.2, Pose.level(0.0, 0.0, 21.7), z, np.tile(R, (len(z), 1, 1))))
    return trackers


@pytest.mark.parametrize("fusion", ["kla", "hcmci"])
@pytest.mark.parametrize(("kind", "uavs"), [("complete", 20), ("ring", 20), ("ring", 60)])
def test_consensus(benchmark, judged, kind, uavs, fusion):
    adjacency = graph(kind, uavs)

    def setup():
        return (ready(uavs, fusion), adjacency, 5), {}

    sent = benchmark.pedantic(fuse, setup=setup, rounds=15, warmup_rounds=1)
    assert np.all(sent > 0)
    assert not judged or uavs > 20 or 1e3 * benchmark.stats.stats.median < BOUND


@pytest.mark.parametrize("fusion", ["kla", "hcmci"])
def test_consensus_on_a_ring_as_the_fleet_grows(judged, fusion):
    """CPU times, of fleets in turn; of several times the least counts.

    With `hcmci` a quarter of the time at 20 UAVs goes into tables of each UAV's shares in what each has gained, which
    grow with the square of the fleet; all else grows with the fleet.
    """
    counts = [20, 40, 80] if judged else [3, 6]
    seconds = np.full(len(counts), np.inf)
    for _ in range(10 if judged else 1):
        for i, uavs in enumerate(counts):
            trackers, adjacency = ready(uavs, fusion), graph("ring", uavs)
            start = time.process_time()
            fuse(trackers, adjacency, 5)
            seconds[i] = min(seconds[i], time.process_time() - start)
    print(f"ring, {fusion}: " + ", ".join(f"{n} UAVs {1e3 * s:.1f} ms" for n, s in zip(counts, seconds, strict=True)))
    grown = counts[-1] / counts[0]
    expected = 0.75 * grown + 0.25 * grown**2 if fusion == "hcmci" else grown
    assert not judged or seconds[-1] / seconds[0] < 1.3 * expected
