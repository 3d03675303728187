"""What became of each person, scan by scan: in whose view, hidden by which tree, detected, and held by which track."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.evaluation.score import HELD, held_by
from sim.mission.snapshot import Bools, Ints
from sim.recording.recording import Recording
from sim.scenario.scenario import Scenario
from sim.sensing.sensors import view_of
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.metrics.clearmot import correspondence
from tracking.numerics.compiled import Array

STATES = ("absent", "out of view", "hidden", "missed", "seen")


@dataclass(frozen=True)
class Loss:
    """A person whom no UAV held, from one scan to another, both included."""

    person: int
    first: int
    last: int
    found: bool  # whether the person was held before: else nobody had ever found them


@dataclass(frozen=True, eq=False)
class History:
    """M people at K scans, as n UAVs had them."""

    times: Array  # (K,) s
    present: Bools  # (K, M)
    working: Bools  # (K, n)
    looked: Bools  # (K, n), whether the camera took a frame
    inside: Bools  # (K, n, M), whether a frame was taken with the mid-height in it, occlusion aside
    hidden_by: Ints  # (K, n, M), the first tree between a camera with the person inside and the mid-height; -1 for none
    shown: Bools  # (K, n, M), whether the frame showed any of the person
    detected: Bools  # (K, n, M)
    tracks: Ints  # (K, n, M), id of the track within `HELD` m that stands for the person; -1 for none

    @staticmethod
    def of(recording: Recording, scenario: Scenario) -> History:
        """The history of a recording that was flown in a scenario."""
        scans, uavs = recording.poses.shape[:2]
        working = recording.working
        looked = np.array([[scenario.has_frame(i, k) for i in range(uavs)] for k in range(scans)]) & working
        inside = np.zeros((scans, uavs, recording.people.shape[1]), dtype=np.bool_)
        hidden_by = np.full(inside.shape, -1)
        forest = recording.forest
        for k, i in np.argwhere(looked).tolist():
            camera, row = view_of(scenario.uavs[i], scenario), recording.cameras[k, i]
            inside[k, i], hidden_by[k, i] = _view(camera, Pose(row[:3], row[3:]), recording.people[k], forest)
        return History(
            times=recording.times,
            present=~np.isnan(recording.people[..., 0]),
            working=working,
            looked=looked,
            inside=inside,
            hidden_by=hidden_by,
            shown=(recording.visible > 0) & looked[:, :, None],
            detected=recording.matched & looked[:, :, None],
            tracks=np.stack([_holders(recording, i) for i in range(uavs)], axis=1),
        )

    @cached_property
    def held(self) -> Ints:
        """How many UAVs hold each person at each scan (K, M)."""
        return np.asarray(np.count_nonzero(self.tracks >= 0, axis=1), dtype=np.int64)

    @cached_property
    def states(self) -> Ints:
        """What the fleet's cameras made of each person (K, M), an index into `STATES`.

        The best that any UAV has: seen if one detected them, missed if a frame showed them without a detection, hidden
        if they were inside a frame that showed none of them.
        """
        state = np.where(self.present, STATES.index("out of view"), STATES.index("absent"))
        for name, told in (("hidden", self.inside), ("missed", self.shown), ("seen", self.detected)):
            state[told.any(axis=1) & self.present] = STATES.index(name)
        return state

    @cached_property
    def losses(self) -> tuple[Loss, ...]:
        """When people who were there were held by no UAV, by scan, then person."""
        found = []
        for m in range(self.held.shape[1]):
            lost = self.present[:, m] & (self.held[:, m] == 0)
            edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(np.int8))).tolist()
            for first, end in zip(edges[::2], edges[1::2], strict=True):
                found.append(Loss(m, first, end - 1, bool(np.any(self.held[:first, m]))))
        return tuple(sorted(found, key=lambda loss: (loss.first, loss.person)))


def _view(camera: Camera, pose: Pose, people: Array, forest: Forest) -> tuple[Bools, Ints]:
    """Which of the people (M, 2) m are inside one frame (M,), and behind which tree (M,)."""
    points = np.column_stack([np.nan_to_num(people), np.full(len(people), TARGET_HEIGHT)])
    inside = ~np.isnan(people[:, 0]) & camera.sees(pose, points)
    if not forest.trees:
        return inside, np.full(len(people), -1)
    hiding = forest.hiding(pose.position, points) & inside[:, None]
    return inside, np.where(hiding.any(axis=1), hiding.argmax(axis=1), -1)


def _holders(recording: Recording, uav: int) -> Ints:
    """Ids of the tracks of one UAV that stand for each person (K, M); -1 for none."""
    believed = held_by(recording, uav)
    columns = correspondence(believed.means[:, :, :2], recording.people, HELD)
    return np.where(columns >= 0, np.append(believed.ids, -1)[columns], -1)
