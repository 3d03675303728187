"""Costs of a scan beside Stone Soup's JPDA, and as scenes grow; docs/results/benchmarks.md says how to run this.

What is compared runs in turn, so that the load of the machine falls on all of it. Times are those of the processor, and
of several the least counts.
In ordinary test runs each comparison runs once, on little, and its times are not judged.
"""

import math
import time

import numpy as np
import pytest
from helpers.peers import StoneSoup
from helpers.scenes import ALONE, CAMERA, MOTION, R, track
from stonesoup.dataassociator.probability import JPDA, JPDAwithEHM2

from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Pose
from tracking.parameters import TrackerParameters
from tracking.track import Scan
from tracking.tracker import Tracker

PARAMETERS = TrackerParameters(MOTION, management="m_of_n")


class Scene:
    """People in a square, all in view, `spacing` m apart: at 3.5 m gates of tracks hardly ever overlap."""

    def __init__(self, people, scans, spacing=3.5, groups=1, alike=True):
        side = math.ceil(math.sqrt(people / groups))
        places = spacing * (np.array([divmod(k, side) for k in range(people // groups)]) - (side - 1) / 2)
        places = np.concatenate([places + np.array([12.0 * g - 6.0 * (groups - 1), 0.0]) for g in range(groups)])
        people = len(places)
        self.known = [track(k, *place, 0.0, 0.0) for k, place in enumerate(places)]
        noise = np.random.default_rng(0).multivariate_normal([0, 0], R, (scans, people))
        pose = Pose.level(0.0, 0.0, max(20.0, spacing * side, 15.0 * groups))
        covariances = R * np.ones((people, 1, 1)) if alike else R * np.linspace(0.9, 1.1, people)[:, None, None]
        self.scans = [Scan(0, 0.2 * k, pose, places + n, covariances) for k, n in enumerate(noise)]

    def run(self, known=True, whole=False):
        """Seconds of each scan but the first, and the tracker afterwards."""
        subject, seconds = Tracker(0, CAMERA, PARAMETERS, self.known if known else ()), []
        for scan in self.scans:
            start = time.process_time()
            subject.step(scan)
            if whole:
                fuse([subject], ALONE, 5)
            seconds.append(time.process_time() - start)
            if not whole:
                fuse([subject], ALONE, 5)
        return seconds[1:], subject

    def run_peer(self, associator):
        """The same of Stone Soup, from our tracks after the first scan; its detections are made beforehand."""
        subject = Tracker(0, CAMERA, PARAMETERS, self.known)
        subject.step(self.scans[0])
        peer, seconds = StoneSoup(PARAMETERS, subject.tracks, R=R, associator=associator), []
        for detections in [peer.detections(scan) for scan in self.scans[1:]]:
            start = time.process_time()
            peer.step(*detections)
            seconds.append(time.process_time() - start)
        return seconds, peer


@pytest.mark.parametrize(("people", "bound"), [(4, 20), (10, 50)])
def test_scan_against_stone_soup(people, bound, judged):
    """Predict, associate, update on the same scans; ours looks for newcomers besides. EHM2 is its faster associator."""
    scene, rounds = Scene(people, 15 if judged else 2), 5 if judged else 1
    runs = [
        (scene.run()[0], scene.run(whole=True)[0], scene.run_peer(JPDA)[0], scene.run_peer(JPDAwithEHM2)[0])
        for _ in range(rounds)
    ]
    step, whole, jpda, ehm = 1e3 * np.array(runs).min(axis=0).mean(axis=1)  # the least of each scan's times
    print(f"\n{people} people: {step:.3f} ms, with the end of the scan {whole:.3f} ms; Stone Soup {jpda:.2f} ms,")
    print(f"with EHM2 {ehm:.2f} ms; ratios {jpda / step:.0f} and {ehm / step:.0f}, bound {bound}")
    ours, theirs = scene.run()[1].tracks, scene.run_peer(JPDA)[1].beliefs
    for t, belief in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(t.belief.mean, belief.mean, atol=1e-6)
    assert not judged or jpda >= bound * step


@pytest.mark.parametrize("known", [True, False])
def test_scan_of_fifty_people(known, judged):
    """The slowest scan of a run; without people known beforehand, those in which fifty tracks begin are among them."""
    scene = Scene(50, 20 if judged else 3)
    runs = [scene.run(known) for _ in range(5 if judged else 1)]
    slowest = 1e3 * np.min([seconds for seconds, _ in runs], axis=0).max()
    assert len(runs[0][1].tracks) == 50
    print(f"\n50 people, {'known' if known else 'new'}: slowest scan {slowest:.2f} ms")
    assert not judged or slowest < 5.0


def test_scan_as_clusters_grow_in_number(judged):
    """Ten to eight hundred people, each a cluster: time grows no faster than their number."""
    counts = [10, 25, 50, 100, 200, 400, 800] if judged else [10, 20]
    scenes = [Scene(n, 10) for n in counts]
    runs = [[scene.run()[0] for scene in scenes] for _ in range(10 if judged else 1)]
    times = 1e3 * np.min(runs, axis=0).mean(axis=1)
    slope = np.polyfit(np.log(counts), np.log(times), 1)[0]
    each = np.diff(times) / np.diff(counts)
    print(f"\nscan of {counts} people: {np.round(times, 3).tolist()} ms, exponent {slope:.2f}")
    last = np.polyfit(np.log(counts[-3:]), np.log(times[-3:]), 1)[0]
    print(f"of the last three {last:.2f}; microseconds of each further person: {np.round(1e3 * each, 1).tolist()}")
    assert not judged or (max(slope, last) <= 1.0 and each[-1] <= 1.5 * each[:3].mean())


@pytest.mark.parametrize("alike", [True, False], ids=["equal covariances", "each its own"])
@pytest.mark.parametrize(
    ("people", "spacing", "groups"),
    [(50, 1.0, 1), (50, 0.5, 1), (50, 0.3, 1), (48, 0.8, 4), (45, 0.8, 5)],
    ids=["1 m", "0.5 m", "0.3 m", "four groups, 0.8 m", "five groups of nine"],
)
def test_scan_of_a_crowd(people, spacing, groups, alike, judged):
    """So close that their gates chain all of a group to one cluster: groups of nine are enumerated."""
    scene = Scene(people, 10 if judged else 2, spacing, groups, alike)
    runs = [scene.run() for _ in range(5 if judged else 1)]
    times = 1e3 * np.min([seconds for seconds, _ in runs], axis=0)
    print(f"\n{people} people {spacing} m apart, {groups} groups: {times.mean():.2f} ms, slowest {times.max():.2f} ms")
    assert len(runs[0][1].tracks) >= 0.9 * people
    assert not judged or times.max() < 5.0
