"""History of each person, scan by scan: shown or detected by cameras, hidden by trees, and held by tracks."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.facts.metrics.holding import NO_TRACK, find_episodes, find_gaps, hold_states
from sim.facts.metrics.score import find_reported_tracks
from sim.facts.metrics.unmatched import find_standing_tracks
from sim.facts.sightings import NO_TREE, find_inside_and_hiding
from sim.mission.recording import Recording, find_last_frames
from sim.sensing.cameras import true_view_of
from tracking.errors import list_numbers
from tracking.numerics.arrays import Array, Flags, Indices

STATES = ("absent", "out of view", "hidden", "missed", "seen")
BROKEN = -1  # in place of a state for a UAV that has broken down
_View = tuple[str, dict[int, list[int]]]  # a state, and its UAVs by the hiding tree, -1 for none


@dataclass(frozen=True)
class Loss:
    """A person that no UAV held from a first to a last scan, both included."""

    person: int
    first: int
    last: int
    found: bool  # True if the person was held before; otherwise no UAV has found them yet
    # scans without a track that holds nobody within `FAR` m, outside the 95 % ellipse of each such track, and inside
    scans: tuple[int, int, int]

    @property
    def kind(self) -> str:
        """Kind of the event: a person inside an ellipse at each scan is off the track, not lost."""
        if not self.found:
            return "person not found yet"
        return "person lost" if any(self.scans[:2]) else "person off"


@dataclass(frozen=True, eq=False)
class History:
    """States of M people at K scans in the cameras of n UAVs and to their tracks."""

    times: Array  # (K,) s
    present: Flags  # (K, M)
    working: Flags  # (K, n)
    looked: Flags  # (K, n), the camera took a frame
    inside: Flags  # (K, n, M), the camera took a frame that contains the person's mid-height, hidden or not
    # (K, n, M), first tree between the camera and the mid-height of a person inside; -1 for none
    hidden_by: Indices
    shown: Flags  # (K, n, M), the frame showed a part of the person
    detected: Flags  # (K, n, M)
    tracks: Indices  # (K, n, M), id of the track that stands for the person; -1 for none
    gaps: Indices  # (K, M), as from `holding.find_gaps`, of people whom no UAV holds

    @staticmethod
    def of(recording: Recording) -> "History":
        """The history of a recording."""
        looked, uavs = recording.frames_taken, range(recording.uav_count)
        inside = np.zeros(recording.visible.shape, dtype=np.bool_)
        hidden_by = np.full(inside.shape, -1)
        forest = recording.hiding_forest
        for k, i in np.argwhere(looked).tolist():
            camera, pose = true_view_of(recording.setting.uavs[i], recording.setting), recording.camera_at(k, i)
            inside[k, i], hiding = find_inside_and_hiding(camera, pose, recording.people[k], forest)
            if forest.trees:
                hidden_by[k, i] = np.where(hiding.any(axis=1), hiding.argmax(axis=1), -1)
        tracks = [find_standing_tracks(find_reported_tracks(recording, i), recording) for i in uavs]
        standing = np.stack(tracks, axis=1)
        return History(
            times=recording.times,
            present=~np.isnan(recording.people[..., 0]),
            working=recording.working,
            looked=looked,
            inside=inside,
            hidden_by=hidden_by,
            shown=(recording.visible > 0) & looked[:, :, None],
            detected=recording.matched & looked[:, :, None],
            tracks=standing,
            gaps=_find_gaps(recording, standing),
        )

    @cached_property
    def held(self) -> Indices:
        """Number of UAVs that hold each person at each scan (K, M)."""
        return np.asarray(np.count_nonzero(self.tracks >= 0, axis=1), dtype=np.int64)

    @cached_property
    def states(self) -> Indices:
        """State (K, M) of each person in the cameras of a scan, as an index into `STATES`.

        The best state in any camera counts: seen if the person was detected, missed if a frame showed them without a
        detection, and hidden if they were inside a frame that did not show them.
        """
        best = self._frame_states.max(axis=1, initial=STATES.index("out of view"))
        return np.where(self.present, best, STATES.index("absent"))

    @cached_property
    def _frame_states(self) -> Indices:
        """State (K, n, M) of each person in each camera's frame at each scan; out of view if none was taken."""
        found = np.full(self.inside.shape, STATES.index("out of view"))
        for name, having in (("hidden", self.inside), ("missed", self.shown), ("seen", self.detected)):
            found[having] = STATES.index(name)
        return found

    @cached_property
    def last_frames(self) -> Indices:
        """As `find_last_frames` of the cameras."""
        return find_last_frames(self.looked)

    @cached_property
    def camera_states(self) -> Indices:
        """State (K, n, M) of each person in each camera's last frame, as an index into `STATES`, or `BROKEN`."""
        found = np.take_along_axis(self._frame_states, self.last_frames[:, :, None], axis=0)
        found[np.broadcast_to(~self.present[:, None], found.shape)] = STATES.index("absent")
        found[~self.working] = BROKEN
        return found

    @cached_property
    def hiding_trees(self) -> Indices:
        """The tree (K, n, M) between each camera and each person in its last frame; -1 for none."""
        return np.asarray(np.take_along_axis(self.hidden_by, self.last_frames[:, :, None], axis=0), dtype=np.int64)

    @cached_property
    def hold_states(self) -> Indices:
        """State (K, M) of each person to the tracks of the working UAVs, as an index into `HOLDS`."""
        fleet = np.count_nonzero(self.working, axis=1)[:, None]
        found = np.maximum.accumulate(self.held > 0, axis=0)
        return hold_states(self.held, found, fleet, self.present, self.gaps)

    @cached_property
    def losses(self) -> tuple[Loss, ...]:
        """Spans in which no UAV held a present person, sorted by scan, then person."""
        found = []
        for m in range(self.held.shape[1]):
            lost = self.present[:, m] & (self.held[:, m] == 0)
            spans = [episode for episode in find_episodes(lost.astype(np.int64)) if episode.value]
            for first, last, _ in spans:
                off, outside, without = np.bincount(self.gaps[first : last + 1, m], minlength=3).tolist()
                found.append(Loss(m, first, last, bool(np.any(self.held[:first, m])), (without, outside, off)))
        return tuple(sorted(found, key=lambda loss: (loss.first, loss.person)))

    def view_texts(self, person: int) -> list[str]:
        """The states of one person in the cameras in words, scan by scan; empty while the person is absent."""
        rows = np.hstack([self.camera_states[:, :, person], self.hiding_trees[:, :, person]])
        kinds, which = np.unique(rows, axis=0, return_inverse=True)
        texts = ["; ".join(describe_view(*view) for view in group_views(*np.split(kind, 2))) for kind in kinds]
        return [texts[n] if there else "" for n, there in zip(which.ravel(), self.present[:, person], strict=True)]


def _find_gaps(recording: Recording, standing: Indices) -> Indices:
    """Gaps (K, M) to tracks of people whom no UAV holds; standing as `History.tracks`."""
    found, owner = np.full(recording.people.shape[:2], NO_TRACK), recording.cells(recording.track_offsets)[1]
    unheld = (standing < 0).all(axis=1) & ~np.isnan(recording.people[..., 0])
    ends = recording.track_offsets[:: standing.shape[1]]
    for k in np.flatnonzero(unheld.any(axis=1)).tolist():
        rows = np.arange(*ends[k : k + 2])
        holds = (recording.track_ids[rows, None] == standing[k, owner[rows]]).any(axis=1)
        rows = rows[recording.reported[rows] & ~holds]
        means, covariances = recording.track_means[rows], recording.track_covariances[rows]
        found[k, unheld[k]] = find_gaps(recording.people[k, unheld[k]], means, covariances)
    return found


def group_views(states: Indices, trees: Indices) -> list[_View]:
    """States of one person in the cameras, the best first; out of view only if no camera has another state.

    states (n,) and trees (n,) as in `History.camera_states` and `History.hiding_trees`.
    """
    found = []
    for state in ("seen", "missed", "hidden"):
        uavs = defaultdict(list)
        for i in np.flatnonzero(states == STATES.index(state)).tolist():
            uavs[int(trees[i]) if state == "hidden" else -1].append(i)
        found += [(state, dict(uavs))] if uavs else []
    return found or [("broken" if (states == BROKEN).all() else "out of view", {})]


def describe_view(state: str, uavs: Mapping[int, Sequence[int]]) -> str:
    """A person's state in cameras, in words; uavs: the UAVs with this state by the hiding tree, -1 for none."""
    if state == "seen":
        return f"seen by {name_fleet(uavs[-1])}"
    if state == "missed":
        return f"shown to {name_fleet(uavs[-1])}, not detected"
    if state == "hidden":
        hiding = [f"by tree {tree} from {name_fleet(uavs[tree])}" for tree in sorted(uavs) if tree >= 0]
        parts = ["hidden " + ", ".join(hiding)] if hiding else []
        if -1 in uavs:
            parts.append(f"not shown to {name_fleet(uavs[-1])}, {NO_TREE}")
        return "; ".join(parts)
    return "no UAV works" if state == "broken" else "outside every view"


def name_fleet(uavs: Sequence[int]) -> str:
    """UAVs in words: "UAV 0", "UAVs 0, 1 and 2"."""
    return list_numbers("UAV", uavs)
