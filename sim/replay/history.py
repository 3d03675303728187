"""History of each person, scan by scan: in view of a camera, hidden by a tree, detected, and held by a track."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.evaluation.holding import HOLDS, episodes, hold_states
from sim.evaluation.score import held_by
from sim.evaluation.unmatched import standing
from sim.mission.snapshot import Bools, Ints
from sim.recording.recording import Recording
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import view_of
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.numerics.arrays import Array

STATES = ("absent", "out of view", "hidden", "missed", "seen")
BROKEN = -1  # stands for a UAV that has broken down where others have a state


@dataclass(frozen=True)
class Loss:
    """A person that no UAV held, from one scan to another, both included."""

    person: int
    first: int
    last: int
    found: bool  # whether the person was held before; if not, no UAV has found them yet


@dataclass(frozen=True, eq=False)
class History:
    """M people at K scans, as n UAVs had them."""

    times: Array  # (K,) s
    present: Bools  # (K, M)
    working: Bools  # (K, n)
    looked: Bools  # (K, n), frames taken
    inside: Bools  # (K, n, M), a frame was taken with the mid-height in it, occlusion aside
    hidden_by: Ints  # (K, n, M), the first tree between a camera with the person inside and the mid-height; -1 for none
    shown: Bools  # (K, n, M), the frame showed some of the person
    detected: Bools  # (K, n, M)
    tracks: Ints  # (K, n, M), id of the track within `HELD` m that stands for the person; -1 for none

    @staticmethod
    def of(recording: Recording, scenario: Scenario) -> "History":
        """The history of a recording that was flown in a scenario."""
        scans, uavs = recording.poses.shape[:2]
        working = recording.working
        looked = np.array([[scenario.has_frame(i, k) for i in range(uavs)] for k in range(scans)]) & working
        inside = np.zeros((scans, uavs, recording.people.shape[1]), dtype=np.bool_)
        hidden_by = np.full(inside.shape, -1)
        forest = recording.forest
        for k, i in np.argwhere(looked).tolist():
            camera, pose = view_of(scenario.uavs[i], scenario), recording.camera_at(k, i)
            inside[k, i], hidden_by[k, i] = _view(camera, pose, recording.people[k], forest)
        return History(
            times=recording.times,
            present=~np.isnan(recording.people[..., 0]),
            working=working,
            looked=looked,
            inside=inside,
            hidden_by=hidden_by,
            shown=(recording.visible > 0) & looked[:, :, None],
            detected=recording.matched & looked[:, :, None],
            tracks=np.stack([standing(held_by(recording, i), recording.people) for i in range(uavs)], axis=1),
        )

    @cached_property
    def held(self) -> Ints:
        """Number of UAVs that hold each person at each scan (K, M)."""
        return np.asarray(np.count_nonzero(self.tracks >= 0, axis=1), dtype=np.int64)

    @cached_property
    def states(self) -> Ints:
        """State of each person to all cameras of a scan (K, M), an index into `STATES`.

        The best that any UAV has: seen if one detected them, missed if a frame showed them without a detection, hidden
        if they were inside a frame that showed none of them.
        """
        best = self._frame_states.max(axis=1, initial=STATES.index("out of view"))
        return np.where(self.present, best, STATES.index("absent"))

    @cached_property
    def _frame_states(self) -> Ints:
        """State of each person in the frame of each camera at each scan (K, n, M), out of view where none was taken."""
        found = np.full(self.inside.shape, STATES.index("out of view"))
        for name, having in (("hidden", self.inside), ("missed", self.shown), ("seen", self.detected)):
            found[having] = STATES.index(name)
        return found

    @cached_property
    def last_frames(self) -> Ints:
        """The last scan up to each at which a UAV's camera took a frame (K, n); 0 before the first."""
        scans = np.arange(len(self.times))[:, None]
        return np.asarray(np.maximum.accumulate(np.where(self.looked, scans, 0), axis=0), dtype=np.int64)

    @cached_property
    def camera_states(self) -> Ints:
        """State of each person in the last frame of each camera (K, n, M), an index into `STATES`, or `BROKEN`."""
        found = np.take_along_axis(self._frame_states, self.last_frames[:, :, None], axis=0)
        found[np.broadcast_to(~self.present[:, None], found.shape)] = STATES.index("absent")
        found[~self.working] = BROKEN
        return found

    @cached_property
    def hiding_trees(self) -> Ints:
        """The tree between each camera and each person in its last frame (K, n, M); -1 for none."""
        return np.asarray(np.take_along_axis(self.hidden_by, self.last_frames[:, :, None], axis=0), dtype=np.int64)

    @cached_property
    def hold_states(self) -> Ints:
        """State of each person to the tracks of the UAVs that work (K, M), an index into `HOLDS`."""
        fleet = np.count_nonzero(self.working, axis=1)[:, None]
        states = hold_states(self.held, np.maximum.accumulate(self.held > 0, axis=0), fleet)
        states[~self.present] = HOLDS.index("absent")
        return states

    @cached_property
    def losses(self) -> tuple[Loss, ...]:
        """Spans in which a present person was held by no UAV, by scan, then person."""
        found = []
        for m in range(self.held.shape[1]):
            lost = self.present[:, m] & (self.held[:, m] == 0)
            spans = [episode for episode in episodes(lost.astype(np.int64)) if episode.value]
            found += [Loss(m, first, last, bool(np.any(self.held[:first, m]))) for first, last, _ in spans]
        return tuple(sorted(found, key=lambda loss: (loss.first, loss.person)))


def _view(camera: Camera, pose: Pose, people: Array, forest: Forest) -> tuple[Bools, Ints]:
    """People (M, 2) m inside one frame (M,), and the tree that hides each (M,); -1 for none."""
    points = np.column_stack([np.nan_to_num(people), np.full(len(people), TARGET_HEIGHT)])
    inside = ~np.isnan(people[:, 0]) & camera.sees(pose, points)
    if not forest.trees:
        return inside, np.full(len(people), -1)
    hiding = forest.hiding(pose.position, points) & inside[:, None]
    return inside, np.where(hiding.any(axis=1), hiding.argmax(axis=1), -1)
