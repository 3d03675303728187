"""The people of a recording, scan by scan: shown or detected by cameras, hidden by trees, and held by tracks."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sim.facts.event import find_ends
from sim.facts.metrics.holding import Held, Unheld, find_holding, find_unheld
from sim.facts.sightings import NO_TREE, STATES, find_inside_and_hiding, find_states
from sim.facts.words import name_fleet
from sim.mission.recording import Recording, find_last_frames
from tracking.numerics.arrays import Flags, Indices

BROKEN = -1  # in place of a state for a UAV that has broken down
_View = tuple[str, dict[int, list[int]]]  # a state, and its UAVs by the hiding tree, -1 for none


class Views(NamedTuple):
    """Geometry of the frames that cameras took."""

    inside: Flags  # (K, n, M), the frame contains the person's mid-height, hidden or not
    hidden_by: Indices  # (K, n, M), the tree that hides most of the mid-height of a person inside; -1 for none


class PeopleFacts:
    """What follows from a recording about its M people, each table when it is first asked for."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording

    @cached_property
    def views(self) -> Views:
        """Who is inside which frame, and behind which tree."""
        recording = self.recording
        inside = np.zeros(recording.visible.shape, dtype=np.bool_)
        hidden_by = np.full(inside.shape, -1)
        forest = recording.hiding_forest
        for k, i in np.argwhere(recording.frames_taken).tolist():
            camera = recording.setting.true_camera(i)
            inside[k, i], hiding = find_inside_and_hiding(
                camera, recording.camera_at(k, i), recording.people[k], forest
            )
            if forest.trees:
                hidden_by[k, i] = np.where(hiding.any(axis=1), hiding.argmax(axis=1), -1)
        return Views(inside, hidden_by)

    @cached_property
    def holding(self) -> Held:
        """Who holds whom."""
        return find_holding(self.recording)

    @property
    def tracks(self) -> Indices:
        """Id (K, n, M) of each UAV's track of each person; -1 for none."""
        return self.holding.tracks

    @property
    def hold_states(self) -> Indices:
        """State (K, M) of each person to the tracks of the working UAVs, as an index into `HOLDS`."""
        return self.holding.states

    @property
    def shown(self) -> Flags:
        """Mask (K, n, M): the frame showed a part of the person."""
        return (self.recording.visible > 0) & self.recording.frames_taken[:, :, None]

    @property
    def detected(self) -> Flags:
        """Mask (K, n, M) of detected people."""
        return self.recording.matched & self.recording.frames_taken[:, :, None]

    @cached_property
    def held(self) -> Indices:
        """Number of UAVs that hold each person at each scan (K, M)."""
        return np.asarray(np.count_nonzero(self.tracks >= 0, axis=1), dtype=np.int64)

    @cached_property
    def states(self) -> Indices:
        """State (K, M) of each person in the cameras of a scan, as an index into `STATES`: the best in any camera."""
        best = self._frame_states.max(axis=1, initial=STATES.index("out of view"))
        return np.where(self.recording.present, best, STATES.index("absent"))

    @cached_property
    def _frame_states(self) -> Indices:
        """State (K, n, M) of each person in each camera's frame at each scan; out of view if none was taken."""
        return find_states(self.views.inside, self.shown, self.detected)

    @cached_property
    def last_frames(self) -> Indices:
        """As `find_last_frames` of the cameras."""
        return find_last_frames(self.recording.frames_taken)

    @cached_property
    def camera_states(self) -> Indices:
        """State (K, n, M) of each person in each camera's last frame, as an index into `STATES`, or `BROKEN`."""
        found = np.take_along_axis(self._frame_states, self.last_frames[:, :, None], axis=0)
        found[np.broadcast_to(~self.recording.present[:, None], found.shape)] = STATES.index("absent")
        found[~self.recording.working] = BROKEN
        return found

    @cached_property
    def hiding_trees(self) -> Indices:
        """The tree (K, n, M) between each camera and each person in its last frame; -1 for none."""
        hidden_by = np.take_along_axis(self.views.hidden_by, self.last_frames[:, :, None], axis=0)
        return np.asarray(hidden_by, dtype=np.int64)

    @cached_property
    def unheld(self) -> tuple[Unheld, ...]:
        """The losses, sorted by scan, then person."""
        return find_unheld(self.holding)

    def view_texts(self, person: int) -> list[str]:
        """The states of one person in the cameras in words, scan by scan; empty while the person is absent."""
        rows = np.hstack([self.camera_states[:, :, person], self.hiding_trees[:, :, person]])
        kinds, which = np.unique(rows, axis=0, return_inverse=True)
        texts = ["; ".join(describe_view(*view) for view in group_views(*np.split(kind, 2))) for kind in kinds]
        present = self.recording.present[:, person]
        return [texts[n] if there else "" for n, there in zip(which.ravel(), present, strict=True)]


def group_views(states: Indices, trees: Indices) -> list[_View]:
    """States of one person in the cameras, the best first; out of view only if no camera has another state.

    states (n,) and trees (n,) as in `PeopleFacts.camera_states` and `PeopleFacts.hiding_trees`.
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
        return f"missed by {name_fleet(uavs[-1])}"
    if state == "hidden":
        hiding = [f"by tree {tree} from {name_fleet(uavs[tree])}" for tree in sorted(uavs) if tree >= 0]
        parts = ["hidden " + ", ".join(hiding)] if hiding else []
        if -1 in uavs:
            parts.append(f"hidden from {name_fleet(uavs[-1])}, {NO_TREE}")
        return "; ".join(parts)
    return "no UAV works" if state == "broken" else state


def tell_losses(facts: PeopleFacts, grade: str = "lost") -> str:
    """How often people had a grade of loss, and the worst time, in words; empty for never, but for the grade "lost"."""
    losses = [loss for loss in facts.unheld if loss.grade == grade]
    if not losses:
        return "never lost" if grade == "lost" else ""
    worst = max(losses, key=lambda loss: loss.scans)
    begin, end = find_ends(facts.recording.times, worst.first, worst.last)
    often = {1: "once", 2: "twice"}.get(len(losses), f"{len(losses)} times")
    return f"{grade} {often}, at worst person {worst.person} for {end - begin:.1f} s from {begin:.1f} s"
