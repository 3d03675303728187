"""The order of tracks, of detections and of UAVs changes nothing but the order."""

import numpy as np
from helpers.scenes import CAMERA, MOTION, R, track
from hypothesis import given, settings
from hypothesis import strategies as st

from tracking.fusion.consensus import fuse
from tracking.fusion.rule import FUSION_RULES
from tracking.geometry.camera import Pose
from tracking.parameters import TrackerParameters, Tracking
from tracking.track import Scan
from tracking.tracker import Tracker

PEOPLE, UAVS, SCANS = 5, 3, 6
LINE = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], dtype=bool)  # adjacency; two rounds do not make all agree
SETTINGS = Tracking(detection_probability=0.9, clutter_density=0.01)
seeds = st.integers(0, 2**32 - 1)
PLAIN = list(range(PEOPLE - 1)), list(range(UAVS))


class Scene:
    """Five people with overlapping gates, one unknown to the fleet; UAVs that see parts of the scene."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.parameters = TrackerParameters(MOTION, SETTINGS, fusion=[*FUSION_RULES.built_in][seed % 2])
        self.states = np.column_stack([rng.uniform(-1.5, 1.5, (PEOPLE, 2)), rng.uniform(-1, 1, (PEOPLE, 2))])
        self.states[-1, :2] += 7
        self.poses = [Pose.level(*rng.uniform(-3, 3, 2), 20.0) for _ in range(UAVS)]
        self.measurements = [[self._seen(k, rng) for _ in range(UAVS)] for k in range(SCANS)]

    def _seen(self, k: int, rng: np.random.Generator) -> np.ndarray:
        people = self.states[:, :2] + 0.2 * k * self.states[:, 2:] + rng.multivariate_normal([0, 0], R, PEOPLE)
        return people[rng.random(PEOPLE) < 0.9]

    def play(self, ids: list[int], uavs: list[int], shuffle: np.random.Generator | None = None) -> list[np.ndarray]:
        """Rows of position-ordered beliefs of each UAV at the end, UAVs and ids being renamed, then named back.

        ids[i] is the id of known person i, uavs[j] the number of UAV j; with `shuffle` detections come in any order.
        """
        known = [track(id, *state, variance=0.2) for id, state in zip(ids, self.states[:-1], strict=True)]
        fleet = [Tracker(j, CAMERA, self.parameters, known) for j in range(UAVS)]
        adjacency = np.zeros((UAVS, UAVS), dtype=bool)
        adjacency[np.ix_(uavs, uavs)] = LINE
        for k, measured in enumerate(self.measurements):
            for j, z in enumerate(measured):
                rows = z if shuffle is None else shuffle.permutation(z)
                covariances = np.tile(R, (len(rows), 1, 1))
                fleet[uavs[j]].step(Scan(uavs[j], 0.2 * k, self.poses[j], rows, covariances))
            fuse(fleet, adjacency, 2)
        return [self._rows(fleet[uavs[j]], ids) for j in range(UAVS)]

    @staticmethod
    def _rows(tracker: Tracker, ids: list[int]) -> np.ndarray:
        rows = []
        for t in tracker.tracks:
            name = (
                ids.index(t.id) if t.id in ids else PEOPLE
            )  # new tracks by position, as their ids depend on UAV and order
            rows.append((name, *t.belief.mean, *t.belief.covariance.ravel()))
        return np.array(sorted(rows))


def same(a: list[np.ndarray], b: list[np.ndarray]) -> None:
    assert [len(x) for x in a] == [len(x) for x in b]
    for x, y in zip(a, b, strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-9)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=seeds, ids=st.permutations(PLAIN[0]), uavs=st.permutations(PLAIN[1]))
def test_the_order_of_tracks_of_detections_and_of_uavs_does_not_matter(seed, ids, uavs):
    scene = Scene(seed)
    same(scene.play(ids, uavs, np.random.default_rng(seed)), scene.play(*PLAIN))


def test_the_scenes_hold_what_the_order_could_upset():
    """New tracks known to all UAVs in the end, and UAVs that do not agree."""
    ends = [Scene(seed).play(*PLAIN) for seed in range(10)]
    assert sum(all(rows[-1, 0] == PEOPLE for rows in end) for end in ends) >= 8
    assert all(not np.allclose(end[0][0], end[2][0], rtol=1e-6) for end in ends)
