"""Recorder of a mission while it flies."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planning.planner import Plan
from sim.mission.fault import Fault
from sim.mission.recorded_maps import encode_maps
from sim.mission.recording import FIELDS, VERSION, Recording, encode_faults
from sim.mission.snapshot import Snapshot
from sim.scenario.scenario import Scenario, encode_scenario
from sim.world.believed_forest import believe_forest
from sim.world.contacts import KINDS
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.track import Scan, Track

_BY_SCAN = {
    name: field.dtype
    for name, field in FIELDS.items()
    if field.shape.split(" ")[0] == "K" and name not in ("frames", "maps")
}


class Recorder:
    """Collects copies of snapshots and makes a recording of all scans so far at any time."""

    def __init__(self, repeat: int = 0) -> None:
        """Begin without scans; `repeat` is that of the mission."""
        self._repeat = repeat
        self._dense: defaultdict[str, list[NDArray[Any]]] = defaultdict(list)
        self._scans: list[tuple[Scan, Array]] = []
        self._tracks: list[tuple[Track, ...]] = []
        self._plans: list[tuple[float, list[Plan]]] = []
        self._contacts: list[tuple[int, int, int, int]] = []
        self._faults: list[Fault] = []

    def __len__(self) -> int:
        """Number of scans so far."""
        return len(self._dense["times"])

    def add(self, snapshot: Snapshot) -> None:
        """Append one scan. ValueError if the counts of pixels and measurements differ; then nothing is appended."""
        rows = [_make_pixel_rows(scan, pixels) for scan, pixels in zip(snapshot.scans, snapshot.pixels, strict=True)]
        self._contacts.extend((len(self), c.uav, KINDS.index(c.kind), c.other) for c in snapshot.contacts)
        for name, dtype in _BY_SCAN.items():
            value = getattr(snapshot, "time" if name == "times" else name)
            if value is None:
                continue
            if name in ("poses", "cameras", "believed"):
                value = [np.concatenate([pose.position, pose.quaternion]) for pose in value]
            self._dense[name].append(np.array(value, dtype=dtype))
        self._scans.extend(zip(snapshot.scans, rows, strict=True))
        self._tracks.extend(snapshot.tracks)
        self._faults.extend(snapshot.faults)
        if snapshot.plans is not None:
            self._plans.append((snapshot.time, snapshot.plans))

    def recording(
        self,
        *,
        scenario: str,
        planner: str,
        seed: int,
        forest: Forest,
        interrupted: bool = False,
        sees_truth: bool = False,
        frames: Flags | None = None,
    ) -> Recording:
        """The recording of all scans so far; `scenario` is the resolved JSON. ValueError without any scan.

        frames: as in recordings, of a flight from elsewhere.
        """
        if not len(self):
            raise ValueError("nothing to record: the mission has no scan")
        dense: dict[str, Any] = {name: np.stack(rows) for name, rows in self._dense.items()}
        uavs, tracks = dense["poses"].shape[1], [track for held in self._tracks for track in held]
        return Recording(
            version=VERSION,
            scenario=scenario,
            planner=planner,
            seed=seed,
            repeat=self._repeat,
            interrupted=interrupted,
            trees=forest.table,
            **dense,
            measurement_offsets=_compute_offsets(len(scan.measurements) for scan, _ in self._scans),
            measurements=_join((scan.measurements for scan, _ in self._scans), 2),
            measurement_covariances=_join((scan.covariances for scan, _ in self._scans), 2, 2),
            pixels=_join((pixels for _, pixels in self._scans), 2),
            track_offsets=_compute_offsets(len(held) for held in self._tracks),
            track_ids=np.array([track.id for track in tracks], dtype=np.int64),
            track_means=_join((track.belief.mean for track in tracks), 4),
            track_covariances=_join((track.belief.covariance for track in tracks), 4, 4),
            track_existence=_list_existence(tracks),
            track_sightings=_join((track.sighting for track in tracks), 3),
            plan_times=np.array([time for time, _ in self._plans], dtype=float),
            plans=_pad([plans for _, plans in self._plans], uavs),
            contacts=np.array(self._contacts, dtype=np.int64).reshape(-1, 4),
            sees_truth=sees_truth,
            faults=encode_faults(self._faults),
            frames=frames,
            **encode_maps([scan.forest for scan, _ in self._scans], uavs),
        )


class Heading(NamedTuple):
    """What the recording of a mission says beside its scans."""

    scenario: Scenario
    planner: str
    seed: int
    repeat: int
    forest: Forest
    sees_truth: bool

    @property
    def believed_forest(self) -> Forest:
        """As `Recording.believed_forest`."""
        return believe_forest(self.forest, self.scenario, self.seed)

    def make_recording(self, recorder: Recorder) -> Recording:
        """Recording of the scans so far; it is marked as interrupted unless these are all."""
        return recorder.recording(
            scenario=encode_scenario(self.scenario),
            planner=self.planner,
            seed=self.seed,
            forest=self.forest,
            interrupted=len(recorder) < len(self.scenario.scan_times),
            sees_truth=self.sees_truth,
        )


def _make_pixel_rows(scan: Scan, pixels: Array) -> Array:
    if len(pixels) == 0:
        return np.full((len(scan.measurements), 2), np.nan)
    if len(pixels) != len(scan.measurements):
        raise ValueError(f"UAV {scan.uav} has {len(scan.measurements)} measurements of {len(pixels)} detections")
    return np.array(pixels, dtype=float)


def _list_existence(tracks: Sequence[Track]) -> Array:
    """Existence probabilities; NaN for tracks without one, which have the value 1, as estimated ones stay below it."""
    return np.array([track.existence if track.existence < 1.0 else math.nan for track in tracks], dtype=float)


def _compute_offsets(counts: Iterable[int]) -> Indices:
    return np.cumsum([0, *counts], dtype=np.int64)


def _join(blocks: Iterable[Array], *shape: int) -> Array:
    rows = [np.asarray(block, dtype=float).reshape(-1, *shape) for block in blocks]
    return np.concatenate([np.zeros((0, *shape)), *rows])


def _pad(plans: Sequence[Sequence[Plan]], uavs: int) -> Array:
    horizon = max((len(plan.controls) for made in plans for plan in made), default=0)
    table = np.full((len(plans), uavs, horizon, 2), np.nan)
    for e, made in enumerate(plans):
        for i, plan in enumerate(made):
            table[e, i, : len(plan.controls)] = plan.controls
    return table
