"""History of each person, scan by scan: in view of a camera, hidden by a tree, detected, and held by a track."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.evaluation.holding import episodes, hold_states
from sim.evaluation.score import held_by
from sim.evaluation.unmatched import standing
from sim.recording.recording import Recording
from sim.replay.frames.rerender import frames_taken, hiding_forest
from sim.replay.frames.sightings import NO_TREE, inside_and_hiding
from sim.sensing.cameras import view_of
from tracking.numerics.arrays import Array, Flags, Indices

STATES = ("absent", "out of view", "hidden", "missed", "seen")
BROKEN = -1  # stands for a UAV that has broken down where others have a state
_View = tuple[str, dict[int, list[int]]]  # a state, and the UAVs that have it by the tree between, -1 for none


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
    present: Flags  # (K, M)
    working: Flags  # (K, n)
    looked: Flags  # (K, n), frames taken
    inside: Flags  # (K, n, M), a frame was taken with the mid-height in it, occlusion aside
    # (K, n, M), the first tree between a camera with the person inside and the mid-height; -1 for none
    hidden_by: Indices
    shown: Flags  # (K, n, M), the frame showed some of the person
    detected: Flags  # (K, n, M)
    tracks: Indices  # (K, n, M), id of the track within `HELD` m that stands for the person; -1 for none

    @staticmethod
    def of(recording: Recording) -> "History":
        """The history of a recording."""
        looked, uavs = frames_taken(recording), range(recording.poses.shape[1])
        inside = np.zeros(recording.visible.shape, dtype=np.bool_)
        hidden_by = np.full(inside.shape, -1)
        forest = hiding_forest(recording)
        for k, i in np.argwhere(looked).tolist():
            camera, pose = view_of(recording.setting.uavs[i], recording.setting), recording.camera_at(k, i)
            inside[k, i], hiding = inside_and_hiding(camera, pose, recording.people[k], forest)
            if forest.trees:
                hidden_by[k, i] = np.where(hiding.any(axis=1), hiding.argmax(axis=1), -1)
        return History(
            times=recording.times,
            present=~np.isnan(recording.people[..., 0]),
            working=recording.working,
            looked=looked,
            inside=inside,
            hidden_by=hidden_by,
            shown=(recording.visible > 0) & looked[:, :, None],
            detected=recording.matched & looked[:, :, None],
            tracks=np.stack([standing(held_by(recording, i), recording.people) for i in uavs], axis=1),
        )

    @cached_property
    def held(self) -> Indices:
        """Number of UAVs that hold each person at each scan (K, M)."""
        return np.asarray(np.count_nonzero(self.tracks >= 0, axis=1), dtype=np.int64)

    @cached_property
    def states(self) -> Indices:
        """State of each person to all cameras of a scan (K, M), an index into `STATES`.

        The best that any UAV has: seen if one detected them, missed if a frame showed them without a detection, hidden
        if they were inside a frame that showed none of them.
        """
        best = self._frame_states.max(axis=1, initial=STATES.index("out of view"))
        return np.where(self.present, best, STATES.index("absent"))

    @cached_property
    def _frame_states(self) -> Indices:
        """State of each person in the frame of each camera at each scan (K, n, M), out of view where none was taken."""
        found = np.full(self.inside.shape, STATES.index("out of view"))
        for name, having in (("hidden", self.inside), ("missed", self.shown), ("seen", self.detected)):
            found[having] = STATES.index(name)
        return found

    @cached_property
    def last_frames(self) -> Indices:
        """The last scan up to each at which a UAV's camera took a frame (K, n); 0 before the first."""
        scans = np.arange(len(self.times))[:, None]
        return np.asarray(np.maximum.accumulate(np.where(self.looked, scans, 0), axis=0), dtype=np.int64)

    @cached_property
    def camera_states(self) -> Indices:
        """State of each person in the last frame of each camera (K, n, M), an index into `STATES`, or `BROKEN`."""
        found = np.take_along_axis(self._frame_states, self.last_frames[:, :, None], axis=0)
        found[np.broadcast_to(~self.present[:, None], found.shape)] = STATES.index("absent")
        found[~self.working] = BROKEN
        return found

    @cached_property
    def hiding_trees(self) -> Indices:
        """The tree between each camera and each person in its last frame (K, n, M); -1 for none."""
        return np.asarray(np.take_along_axis(self.hidden_by, self.last_frames[:, :, None], axis=0), dtype=np.int64)

    @cached_property
    def hold_states(self) -> Indices:
        """State of each person to the tracks of the UAVs that work (K, M), an index into `HOLDS`."""
        fleet = np.count_nonzero(self.working, axis=1)[:, None]
        return hold_states(self.held, np.maximum.accumulate(self.held > 0, axis=0), fleet, self.present)

    @cached_property
    def losses(self) -> tuple[Loss, ...]:
        """Spans in which a present person was held by no UAV, by scan, then person."""
        found = []
        for m in range(self.held.shape[1]):
            lost = self.present[:, m] & (self.held[:, m] == 0)
            spans = [episode for episode in episodes(lost.astype(np.int64)) if episode.value]
            found += [Loss(m, first, last, bool(np.any(self.held[:first, m]))) for first, last, _ in spans]
        return tuple(sorted(found, key=lambda loss: (loss.first, loss.person)))

    def view_texts(self, person: int) -> list[str]:
        """The states of one person to the cameras in words, scan by scan; empty where the person is absent."""
        rows = np.hstack([self.camera_states[:, :, person], self.hiding_trees[:, :, person]])
        kinds, which = np.unique(rows, axis=0, return_inverse=True)
        texts = ["; ".join(view_text(*view) for view in views_at(*np.split(kind, 2))) for kind in kinds]
        return [texts[n] if there else "" for n, there in zip(which.ravel(), self.present[:, person], strict=True)]


def views_at(states: Indices, trees: Indices) -> list[_View]:
    """States that cameras have of one person, the best first; out of view only if no camera has another.

    states (n,) and trees (n,) as in `History.camera_states` and `History.hiding_trees`.
    """
    found = []
    for state in ("seen", "missed", "hidden"):
        uavs = defaultdict(list)
        for i in np.flatnonzero(states == STATES.index(state)).tolist():
            uavs[int(trees[i]) if state == "hidden" else -1].append(i)
        found += [(state, dict(uavs))] if uavs else []
    return found or [("broken" if (states == BROKEN).all() else "out of view", {})]


def view_text(state: str, uavs: Mapping[int, Sequence[int]]) -> str:
    """A state of a person to cameras in words; `uavs` are those that have it, by the tree between, -1 for none."""
    if state == "seen":
        return f"seen by {fleet_text(uavs[-1])}"
    if state == "missed":
        return f"shown to {fleet_text(uavs[-1])}, not detected"
    if state == "hidden":
        hiding = [f"by tree {tree} from {fleet_text(uavs[tree])}" for tree in sorted(uavs) if tree >= 0]
        parts = ["hidden " + ", ".join(hiding)] if hiding else []
        if -1 in uavs:
            parts.append(f"not shown to {fleet_text(uavs[-1])}, {NO_TREE}")
        return "; ".join(parts)
    return "no UAV works" if state == "broken" else "outside every view"


def fleet_text(uavs: Sequence[int]) -> str:
    """UAVs in words: "UAV 0", "UAVs 0, 1 and 2"."""
    *most, last = map(str, uavs)
    return f"UAVs {', '.join(most)} and {last}" if most else f"UAV {last}"
