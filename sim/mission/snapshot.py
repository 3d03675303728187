"""The mission at one scan, ground truth included."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planning.planner import Plan
from sim.sensing.fault import Fault
from sim.world.contacts import Contact
from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.track import Scan, Track, beliefs_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """Truth, measurements, tracks, plans and commands at one scan: for recording, video and metrics alone."""

    time: float  # s
    people: Array  # (M, 2) m, NaN where absent
    headings: Array  # (M,) rad
    poses: list[Pose]  # of the n UAVs' bodies
    cameras: list[Pose]
    commands: Array  # (n, 2) m/s, in force
    scans: list[Scan]
    pixels: list[Array]  # (N_i, 2) detections in each image, one per measurement; empty in ideal sensing
    tracks: list[tuple[Track, ...]]
    plans: list[Plan] | None  # those made at this instant
    ospa: Array  # (n, 3) m: distance, localisation, cardinality
    visible: Indices  # (n, M) pixels that the renderer shows of each person
    matched: Flags  # (n, M) True if the person was detected in that camera
    contacts: tuple[Contact, ...] = ()  # since the scan before
    bytes_sent: Indices  # (n,) to neighbours, in all rounds of consensus; -1 if unknown
    plan_bytes: Indices  # (n,) to neighbours, of plans made at this instant; -1 if unknown
    plan_rounds: int  # in which these were sent
    faults: tuple[Fault, ...] = ()  # of planner and detectors at this instant, and breakdowns since the scan before

    @property
    def working(self) -> list[int]:
        """UAVs that have not broken down; the others have neither tracks nor an error."""
        return np.flatnonzero(~np.isnan(self.ospa[:, 0])).tolist()

    @property
    def error(self) -> float:
        """OSPA distance [m], mean over the UAVs that work; NaN if none does."""
        return float(self.ospa[self.working, 0].mean()) if self.working else math.nan


def reported_positions(tracks: Sequence[Track]) -> Array:
    """Positions (N, 2) m of the tracks that are reported, which metrics compare with those of people."""
    return beliefs_of([track for track in tracks if track.reported])[0][:, :2]
