"""The mission at one scan, with ground truth."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from planning.planner import Plan
from sim.mission.fault import Fault
from sim.world.contacts import Contact
from tracking.geometry.camera import Pose
from tracking.geometry.line_of_sight import Raster
from tracking.geometry.visibility import NO_TREES
from tracking.metrics.ospa import ospa
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.track import Scan, Track


class FlownPlans(NamedTuple):
    """The plans of a decision that UAVs fly."""

    made: float  # s, time of the decision
    plans: list[Plan]


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """Truth, measurements, tracks, plans and commands at one scan, for recording, video and metrics only."""

    time: float  # s
    people: Array  # (M, 2) m, NaN where absent
    headings: Array  # (M,) rad
    poses: list[Pose]  # of the bodies of the n UAVs
    cameras: list[Pose]
    believed: list[Pose] | None = None  # poses that UAVs believe their cameras to have; None if they are the true ones
    working: list[int]  # UAVs that have not broken down; the others have neither tracks nor an error
    frames_taken: Flags  # (n,) True where the camera took a frame
    commands: Array  # (n, 2) m/s, commands on the way to this scan
    scans: list[Scan]
    pixels: list[Array]  # (N_i, 2) positions of the measurements in each image; empty in ideal sensing
    tracks: list[tuple[Track, ...]]
    plans: list[Plan] | None  # made at this scan
    flown: FlownPlans | None = None  # from this scan on, as `Scenario.find_flown` says; None before the first are due
    visible: Indices  # (n, M) number of pixels that show each person in the image
    matched: Flags  # (n, M) True if the person was detected in that camera
    contacts: tuple[Contact, ...] = ()  # since the previous scan
    bytes_sent: Indices  # (n,) sent to neighbours in all rounds of consensus
    plan_bytes: Indices  # (n,) sent to neighbours for the plans of this scan
    map_bytes: Indices | None = None  # (n,) sent to neighbours for maps of trees; None if UAVs do not share any
    plan_rounds: int  # number of rounds in which these plans were sent
    faults: tuple[Fault, ...] = ()  # of planner and detectors at this scan, and breakdowns since the previous one
    known_ospa: Array | None = None  # `ospa`, if it is known, as from a recording

    @cached_property
    def ospa(self) -> Array:
        """Distance, localisation and cardinality (n, 3) m of each UAV's error; NaN of those that do not work."""
        known = self.known_ospa
        return measure_errors(self.tracks, self.working, self.people) if known is None else known

    def decide(self, **changes: Any) -> "Snapshot":  # noqa: ANN401 - of any field
        """The same with other fields, in a fifth of `replace`'s time."""
        snapshot = object.__new__(Snapshot)
        snapshot.__dict__.update(self.__dict__, **changes)
        return snapshot

    def plain(self) -> "Snapshot":
        """The same in classes of ours alone, whatever those of plug-ins are: other processes need not know them."""
        flown = self.flown and FlownPlans(self.flown.made, _make_plain(self.flown.plans))
        tracks = [tuple(Track(t.id, t.belief, t.existence, t.sighting) for t in held) for held in self.tracks]
        plans = self.plans and _make_plain(self.plans)
        # A map that is given is large and stays; one that a UAV makes is drawn, without what was computed from it.
        made = [isinstance(scan.forest.unknown, Raster) for scan in self.scans]
        forests = [replace(s.forest) if own else NO_TREES for s, own in zip(self.scans, made, strict=True)]
        scans = [replace(scan, forest=forest) for scan, forest in zip(self.scans, forests, strict=True)]
        return replace(self, scans=scans, tracks=tracks, plans=plans, flown=flown, known_ospa=self.ospa)

    @property
    def error(self) -> float:
        """OSPA distance [m], mean over the UAVs that work; NaN if none does."""
        return float(self.ospa[self.working, 0].mean()) if self.working else math.nan


def _make_plain(plans: Iterable[Plan]) -> list[Plan]:
    return [Plan(plan.controls) for plan in plans]


def find_reported_positions(tracks: Sequence[Track]) -> Array:
    """Positions (N, 2) m of the reported tracks, which metrics compare with the positions of people."""
    return np.array([track.belief.mean[:2] for track in tracks if track.reported], dtype=float).reshape(-1, 2)


def measure_errors(tracks: Sequence[Sequence[Track]], working: Iterable[int], people: Array) -> Array:
    """OSPA and its parts (n, 3) m of each UAV's reported tracks, given people (M, 2) m; NaN of UAVs not `working`."""
    errors, present = np.full((len(tracks), 3), np.nan), people[~np.isnan(people[:, 0])]
    for i in working:
        errors[i] = ospa(find_reported_positions(tracks[i]), present)
    return errors
