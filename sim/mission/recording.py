"""One mission as plain arrays: truth, measurements, tracks and commands at each scan."""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple, get_type_hints

import msgspec
import numpy as np

from planning.planner import Plan
from sim.mission.fault import Fault
from sim.mission.recorded_maps import decode_map
from sim.mission.snapshot import FlownPlans, Snapshot
from sim.scenario.loading import decode_recorded
from sim.scenario.scenario import Scenario
from sim.world.believed_forest import believe_forest
from sim.world.contacts import KINDS, Contact
from tracking.errors import InputError, one_line
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import multiply
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.track import UNLIKELY, Scan, Track, make_tracks

VERSION = 1
MOST_FAULTS = 1000  # number of faults that are kept; a planner may fail at every decision
LONGEST_FAULT = 300  # characters of a message
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]{6,}\b")  # as in <object at 0x7f...>, which differs from process to process
# Tables with a row for each scan, which have the same names in snapshots.
_AS_IN_SNAPSHOTS = ("people", "headings", "commands", "visible", "matched", "bytes_sent", "plan_bytes")


@dataclass(frozen=True, eq=False)
class Recording:
    """A whole mission of K scans, n UAVs, M people, T trees and E decisions with horizon H.

    Each annotation gives data type and shape. Tables of D measurements or S tracks have rows for each scan and UAV in
    turn: scan k and UAV i have the rows `offsets[k n + i]` to `offsets[k n + i + 1]`. Poses are x, y, z [m] and
    quaternion xyzw. Absent people are NaN, and so is the OSPA of a UAV that has broken down. A flight from elsewhere
    whose people are unknown has none, and an OSPA of zero.

    Attributes:
        version: number of the format.
        scenario: JSON, from `encode_scenario`.
        planner: name of the planner, with its options.
        seed: in the file as text, because a seed may have more than 64 bits.
        interrupted: True if the mission was ended before its time.
        times: times of the scans [s].
        trees: the fields of each `Tree`; the seventh if any is porous.
        people: positions [m].
        headings: of people [rad], from east, anticlockwise.
        poses: true poses of UAVs.
        cameras: true poses of cameras.
        commands: velocities in force [m/s], east and north.
        measurement_offsets: rows of `measurements` by scan and UAV.
        measurements: positions on the ground [m].
        measurement_covariances: of the errors of `measurements` [m²].
        pixels: places of the measurements in images; NaN in ideal sensing.
        track_offsets: rows of the tables of tracks by scan and UAV.
        track_ids: ids; pictures and tables show `track_numbers` in their place.
        track_means: positions [m] and velocities [m/s].
        track_covariances: m², m²/s, m²/s².
        plan_times: times of the decisions [s].
        plans: velocities [m/s], NaN after the end of a shorter plan.
        ospa: distance, localisation and cardinality [m].
        visible: number of pixels that show each person.
        matched: True if the person was detected.
        contacts: scan, UAV, kind (in `KINDS`) and index of a body that it has touched since the previous scan; sorted
            by scan.
        bytes_sent: bytes to neighbours in all rounds of consensus of a scan.
        plan_bytes: bytes of plans, to neighbours in all rounds of a decision.
        plan_rounds: number of these rounds.
        sees_truth: True if the planner knows the truth.
        track_existence: probability; NaN if the tracker has none, as with m of n scans.
        track_sightings: position [m] and time [s] of the fleet's last sure detection; NaN if the tracker has none.
        faults: JSON, see `encode_faults`.
        repeat: decides, with the seed, the mission's noise.
        frames: True where a camera took a frame in a flight from elsewhere; None for a mission, whose scenario says it.
        believed: as `cameras`, poses that UAVs believe their cameras to have; None if they are the true ones.
        maps: for each scan and UAV, which of B maps of the forest it believed; None if all believed the one that they
            were given, `believed_forest`, all the time.
        map_sizes: rows of `map_trees` of each map.
        map_trees: the fields of each `Tree`, and the deviation [m] of its place; a row with an infinite deviation is
            the `unknown_tree`.
        map_unknown: number per m² of unknown trees in the cells of a raster over the area.
        map_bytes: bytes of maps of trees to neighbours; None if UAVs share none.
    """

    version: Annotated[int, "<i8", ""]
    scenario: Annotated[str, "<U", ""]
    planner: Annotated[str, "<U", ""]
    seed: Annotated[int, "<U", ""]
    interrupted: Annotated[bool, "|b1", ""]
    times: Annotated[Array, "<f8", "K"]
    trees: Annotated[Array, "<f8", "T 6|7"]
    people: Annotated[Array, "<f8", "K M 2"]
    headings: Annotated[Array, "<f8", "K M"]
    poses: Annotated[Array, "<f8", "K n 7"]
    cameras: Annotated[Array, "<f8", "K n 7"]
    commands: Annotated[Array, "<f8", "K n 2"]
    measurement_offsets: Annotated[Indices, "<i8", "K*n+1"]
    measurements: Annotated[Array, "<f8", "D 2"]
    measurement_covariances: Annotated[Array, "<f8", "D 2 2"]
    pixels: Annotated[Array, "<f8", "D 2"]
    track_offsets: Annotated[Indices, "<i8", "K*n+1"]
    track_ids: Annotated[Indices, "<i8", "S"]
    track_means: Annotated[Array, "<f8", "S 4"]
    track_covariances: Annotated[Array, "<f8", "S 4 4"]
    plan_times: Annotated[Array, "<f8", "E"]
    plans: Annotated[Array, "<f8", "E n H 2"]
    ospa: Annotated[Array, "<f8", "K n 3"]
    visible: Annotated[Indices, "<i8", "K n M"]
    matched: Annotated[Flags, "|b1", "K n M"]
    contacts: Annotated[Indices, "<i8", "C 4"]
    bytes_sent: Annotated[Indices, "<i8", "K n"]
    plan_bytes: Annotated[Indices, "<i8", "K n"]
    plan_rounds: Annotated[Indices, "<i8", "K"]
    sees_truth: Annotated[bool, "|b1", ""]
    track_existence: Annotated[Array, "<f8", "S"]
    track_sightings: Annotated[Array, "<f8", "S 3"]
    faults: Annotated[str, "<U", ""]
    repeat: Annotated[int, "<i8", ""]
    frames: Annotated[Flags | None, "|b1", "K n"] = None
    believed: Annotated[Array | None, "<f8", "K n 7"] = None
    maps: Annotated[Indices | None, "<i8", "K n"] = None
    map_sizes: Annotated[Indices | None, "<i8", "B"] = None
    map_trees: Annotated[Array | None, "<f8", "R 8"] = None
    map_unknown: Annotated[Array | None, "<f8", "B y x"] = None
    map_bytes: Annotated[Indices | None, "<i8", "K n"] = None

    @property
    def scan_count(self) -> int:
        """Number K of scans."""
        return len(self.times)

    @property
    def uav_count(self) -> int:
        """Number n of UAVs."""
        return int(self.poses.shape[1])

    @property
    def person_count(self) -> int:
        """Number M of people."""
        return int(self.people.shape[1])

    @cached_property
    def setting(self) -> Scenario:
        """The scenario of the mission; InputError if this program cannot read it, or it contradicts the recording."""
        try:
            found = decode_recorded(self.scenario)
        except (ValueError, RecursionError, OverflowError) as error:
            other = "made by another understory? its summary.json names the version that reads it"
            raise InputError(f"recording: its scenario: {one_line(error, 400)}; {other}") from error
        _check_setting(self, found)
        return found

    @cached_property
    def forest(self) -> Forest:
        """The true trees with exact occlusion; `believed_forest` is what UAVs took them for."""
        return Forest(tuple(Tree(*row) for row in self.trees.tolist()))

    @property
    def working(self) -> Flags:
        """Mask (K, n) of the UAVs that had not broken down at each scan."""
        return ~np.isnan(self.ospa[:, :, 0])

    @property
    def present(self) -> Flags:
        """Mask (K, M) of the people who are in the area at each scan."""
        return ~np.isnan(self.people[..., 0])

    @cached_property
    def believed_forest(self) -> Forest:
        """The map of trees that UAVs are given at the start, with the occlusion that they assume."""
        return believe_forest(self.forest, self.setting, self.seed)

    def believed_at(self, k: int, uav: int) -> Forest:
        """What one UAV, with its detector, tracker and planner, believed of the forest at scan k."""
        return self.believed_forest if self.maps is None else self._maps[int(self.maps[k, uav])]

    @property
    def new_maps(self) -> Flags:
        """Mask (K, n) of the scans at which a UAV began to believe another map; none if all were given one."""
        if self.maps is None:
            return np.zeros((self.scan_count, self.uav_count), dtype=np.bool_)
        return np.asarray(np.diff(self.maps, axis=0, prepend=-1) != 0)

    @cached_property
    def _maps(self) -> list[Forest]:
        assert self.map_sizes is not None and self.map_trees is not None and self.map_unknown is not None
        area, occlusion = (self.setting.area.width, self.setting.area.height), self.setting.sensing.occlusion
        parts = np.split(self.map_trees, np.cumsum(self.map_sizes)[:-1])
        return [
            decode_map(rows, unknown, area, occlusion) for rows, unknown in zip(parts, self.map_unknown, strict=True)
        ]

    @property
    def labelled(self) -> bool:
        """False if the people are unknown, as in a flight from elsewhere without labels."""
        return self.frames is None or self.person_count > 0

    @property
    def errors(self) -> Array:
        """OSPA (K, n, 3) m as recorded, but NaN everywhere if people are unknown."""
        return self.ospa if self.labelled else np.full(self.ospa.shape, np.nan)

    @cached_property
    def frames_taken(self) -> Flags:
        """Mask (K, n) of the scans at which the camera of a working UAV took a frame."""
        if self.frames is not None:
            return self.working & self.frames
        due = [[self.setting.has_frame(i, k) for i in range(self.uav_count)] for k in range(self.scan_count)]
        return np.logical_and(self.working, due)

    @cached_property
    def hiding_forest(self) -> Forest:
        """The map of trees with the true occlusion: exact or, in ideal sensing, that of `sensing.occlusion`."""
        sensing = self.setting.sensing
        exact = self.forest
        return Forest(exact.trees, sensing.occlusion) if sensing.mode == "ideal" else exact

    @cached_property
    def track_numbers(self) -> dict[int, int]:
        """The displayed number of each track by id, in the order of first appearance."""
        return {id_: n for n, id_ in enumerate(dict.fromkeys(self.track_ids.tolist()))}

    def numbers_of(self, ids: Indices) -> Indices:
        """The displayed numbers of tracks with these ids (N,); -1 for ids that were never recorded."""
        return np.array([self.track_numbers.get(id_, -1) for id_ in ids.tolist()], dtype=np.int64)

    def cells(self, offsets: Indices) -> tuple[Indices, Indices]:
        """Scan and UAV of each row of the table with these offsets."""
        scans, uavs = self.scan_count, self.uav_count
        k, uav = np.divmod(np.repeat(np.arange(scans * uavs), np.diff(offsets)), uavs)
        return k, uav

    def _rows(self, offsets: Indices, k: int, uav: int) -> slice:
        cell = k * self.uav_count + uav
        return slice(int(offsets[cell]), int(offsets[cell + 1]))

    def camera_at(self, k: int, uav: int) -> Pose:
        """Pose of the camera of one UAV at scan k."""
        row = self.cameras[k, uav]
        return Pose(row[:3], row[3:])

    @property
    def believed_cameras(self) -> Array:
        """Poses (K, n, 7) that UAVs believe their cameras to have."""
        return self.cameras if self.believed is None else self.believed

    @cached_property
    def believed_bodies(self) -> Array:
        """Poses (K, n, 7) that UAVs believe their bodies to have: moved and turned from the true ones as cameras."""
        if self.believed is None:
            return self.poses
        own, true, believed = (rows.reshape(-1, 7) for rows in (self.poses, self.cameras, self.believed))
        back = true[:, 3:] * (-1.0, -1.0, -1.0, 1.0)  # the inverse turn
        turned = multiply(multiply(believed[:, 3:], back), own[:, 3:])
        return np.hstack([own[:, :3] + believed[:, :3] - true[:, :3], turned]).reshape(self.poses.shape)

    def believed_camera_at(self, k: int, uav: int) -> Pose:
        """Pose of the camera of one UAV at scan k, as the UAV believes it."""
        row = self.believed_cameras[k, uav]
        return Pose(row[:3], row[3:])

    def scan_at(self, k: int, uav: int) -> Scan:
        """Measurements of one UAV at scan k."""
        rows = self._rows(self.measurement_offsets, k, uav)
        z, R = self.measurements[rows], self.measurement_covariances[rows]
        return Scan(uav, float(self.times[k]), self.believed_camera_at(k, uav), z, R, self.believed_at(k, uav))

    def pixels_at(self, k: int, uav: int) -> Array:
        """Pixels (N, 2) of the detections of one UAV at scan k; (0, 2) in ideal sensing."""
        pixels = self.pixels[self._rows(self.measurement_offsets, k, uav)]
        return pixels[~np.isnan(pixels[:, 0])]

    def tracks_at(self, k: int, uav: int) -> tuple[Track, ...]:
        """The tracks of one UAV after scan k."""
        rows = self._rows(self.track_offsets, k, uav)
        certain = np.nan_to_num(self.track_existence[rows], nan=1.0)
        beliefs = self.track_means[rows], self.track_covariances[rows]
        return make_tracks(self.track_ids[rows], *beliefs, certain, self.track_sightings[rows])

    def track_ids_at(self, k: int, uav: int) -> Indices:
        """Ids (N,) of the tracks of one UAV after scan k."""
        return self.track_ids[self._rows(self.track_offsets, k, uav)]

    def existence_at(self, k: int, uav: int) -> Array:
        """Existence probability (N,) of each track of one UAV after scan k; NaN if the tracker has none."""
        return self.track_existence[self._rows(self.track_offsets, k, uav)]

    @property
    def reported(self) -> Flags:
        """Mask (S,) of the reported tracks, as in `tracking.track.Track.reported`."""
        return ~(self.track_existence <= UNLIKELY)

    def plans_at(self, k: int) -> list[Plan] | None:
        """The plans made at scan k; None if there are none."""
        made = np.flatnonzero(self.plan_times == self.times[k])
        return self._plans_of(int(made[0])) if len(made) else None

    def _plans_of(self, decision: int) -> list[Plan]:
        return [Plan(controls[~np.isnan(controls[:, 0])]) for controls in self.plans[decision]]

    @cached_property
    def flown_decisions(self) -> Indices:
        """Index (K,) of the decision whose plans are flown from each scan on; -1 before the first is due."""
        return np.array(self.setting.find_flown(self.plan_times.tolist(), self.times.tolist()), dtype=np.int64)

    def flown_at(self, k: int) -> FlownPlans | None:
        """The plans that are flown from scan k on; None before the first are due."""
        e = int(self.flown_decisions[k])
        return FlownPlans(float(self.plan_times[e]), self._plans_of(e)) if e >= 0 else None

    def contacts_at(self, k: int) -> tuple[Contact, ...]:
        """Contacts of UAVs between scan k - 1 and scan k."""
        rows = self.contacts[self.contacts[:, 0] == k].tolist()
        return tuple(Contact(uav, KINDS[kind], other) for _, uav, kind, other in rows)

    @cached_property
    def all_faults(self) -> tuple[Fault, ...]:
        """All faults that were recorded, in order of time."""
        return decode_faults(self.faults)

    def faults_at(self, k: int) -> tuple[Fault, ...]:
        """Faults after scan k - 1 and until scan k."""
        before = float(self.times[k - 1]) if k else -math.inf
        return tuple(fault for fault in self.all_faults if before < fault.time <= float(self.times[k]))

    def poses_at(self, k: int) -> list[Pose]:
        """Poses of the UAVs' bodies at scan k."""
        return [Pose(row[:3], row[3:]) for row in self.poses[k]]

    def snapshot(self, k: int) -> Snapshot:
        """The snapshot of scan k, as given to the recorder."""
        uavs = range(self.uav_count)
        return Snapshot(
            time=float(self.times[k]),
            poses=self.poses_at(k),
            cameras=[self.camera_at(k, i) for i in uavs],
            believed=None if self.believed is None else [self.believed_camera_at(k, i) for i in uavs],
            working=np.flatnonzero(self.working[k]).tolist(),
            frames_taken=self.frames_taken[k],
            scans=[self.scan_at(k, i) for i in uavs],
            pixels=[self.pixels_at(k, i) for i in uavs],
            tracks=[self.tracks_at(k, i) for i in uavs],
            plans=self.plans_at(k),
            flown=self.flown_at(k),
            contacts=self.contacts_at(k),
            plan_rounds=int(self.plan_rounds[k]),
            faults=self.faults_at(k),
            known_ospa=self.ospa[k],
            map_bytes=None if self.map_bytes is None else self.map_bytes[k],
            **{name: getattr(self, name)[k] for name in _AS_IN_SNAPSHOTS},
        )


class Field(NamedTuple):
    """Form of a field of a recording."""

    kind: Any  # its type in Python
    dtype: str
    shape: str  # sizes or their symbols; empty for a single value


FIELDS = {
    name: Field(hint.__origin__, *hint.__metadata__)
    for name, hint in get_type_hints(Recording, include_extras=True).items()
}
MAPS = ("maps", "map_sizes", "map_trees", "map_unknown")
OPTIONAL = ("frames", "believed", *MAPS, "map_bytes")  # fields that are not written if they are None


def _check_setting(recording: Recording, scenario: Scenario) -> None:
    """InputError if a recording contradicts its scenario."""
    times = recording.times
    people = recording.person_count
    uavs = recording.uav_count
    rate = scenario.rates.sensing
    planned = scenario.duration * rate + 1
    if len(scenario.uavs) != uavs:
        raise InputError(f"recording: {uavs} UAVs flew, but its scenario has {len(scenario.uavs)}")
    if not scenario.people.trajectories and scenario.people.count != people:
        raise InputError(f"recording: {people} people walked, but its scenario has {scenario.people.count}")
    if len(times) > planned + 1e-6:
        raise InputError(f"recording: has {len(times)} scans, but its scenario allows at most {planned:g}")
    if np.abs(times * rate - np.arange(len(times))).max() > 1e-6 * len(times):
        raise InputError(f"recording: its scans are not {1 / rate:g} s apart, as its scenario says")


def find_last_frames(taken: Flags) -> Indices:
    """The scan (K, n) of each camera's last frame up to each scan, given those with frames; 0 before the first."""
    scans = np.arange(len(taken))[:, None]
    return np.asarray(np.maximum.accumulate(np.where(taken, scans, 0), axis=0), dtype=np.int64)


def encode_faults(faults: Sequence[Fault]) -> str:
    """Faults as JSON text: a list of objects with `time` [s], `uav` (null: the whole team) and `message`.

    Messages become one line of at most `LONGEST_FAULT` printable characters without memory addresses. If there are more
    than `MOST_FAULTS`, the last one that is kept says how many others there were. `summary.json` has all faults with
    their traces, which name files and therefore differ between machines.
    """
    kept = [
        replace(fault, message=one_line(_ADDRESS.sub("0x...", fault.message), LONGEST_FAULT))
        for fault in faults[:MOST_FAULTS]
    ]
    if len(faults) > MOST_FAULTS:
        kept[-1] = Fault(kept[-1].time, None, f"{len(faults) - MOST_FAULTS + 1} more faults are not recorded")
    return json.dumps([{"time": float(f.time), "uav": f.uav, "message": f.message} for f in kept])


def decode_faults(text: str) -> tuple[Fault, ...]:
    """The faults in a recording's text, in order of time; ValueError if invalid."""
    try:
        return msgspec.json.decode(text, type=tuple[Fault, ...])
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        raise ValueError(f"is no list of faults: {error}") from error
