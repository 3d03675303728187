"""A flight from elsewhere, placed on common scans: what its UAVs detected, its trees, and its people if known."""

import dataclasses
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from sim.exchange.flight_area import WIDEST, choose_area, leave_area
from sim.exchange.flight_doubts import Doubt, name_axes, tell_doubts
from sim.exchange.flight_files import read_files
from sim.exchange.flight_setting import EXACT, make_setting, pick_tree_keys
from sim.exchange.people_selection import Selection
from sim.exchange.values import POSE_GAP, LoggedCamera, LoggedFlight, LoggedFrame, LoggedUav, PoseLog, find_gap
from sim.scenario.loading import decode
from sim.scenario.overrides import apply_overrides
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import read_toml
from sim.world.recorded_people import describe_trajectories, read_trajectories, resample
from sim.world.terrain import Terrain
from sim.world.trajectories import SAMPLES_PER_SECOND, Trajectories
from tracking.errors import InputError, spell
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, at_target_height
from tracking.numerics.arrays import Array, Flags
from tracking.track import Scan

_NEAR = 0.49  # periods, up to which a person is there before the first time and after the last, in scans and samples
_OUTSIDE = 0.05  # of the image's edge, by which pixels of detections may be outside
_GAP = 1.5  # usual times from one frame or pose to the next, beyond which some are missing
_FOOT, _ALIKE = 0.3048, 0.15  # m, and the share by which it is told
# Where detections have no place, on flat ground and on other.
_LOST = (
    "above the horizon, or where a lens shows nothing",
    "above the horizon or beyond ground.file, or out of the lens",
)
_SEEN = 0.8  # of the time of poses, for which frames are expected


class Observed(NamedTuple):
    """What a frame shows."""

    scan: Scan
    pixels: Array  # (N, 2) of the scan's measurements, or (0, 2) if it has none


@dataclass(frozen=True, eq=False)
class ScannedFlight:
    """A flight of n UAVs, whose frames are at K scans with the rate of its scenario."""

    setting: Scenario
    forest: Forest  # with the occlusion that trackers assume
    people: Trajectories | None  # None if they are unknown
    poses: Array  # (K, n, 7) of the cameras: position [m] and quaternion xyzw
    frames: Flags  # (K, n), True where a camera took a frame
    observed: Mapping[tuple[int, int], Observed]  # by scan and UAV with a frame
    remarks: tuple[str, ...]

    @cached_property
    def cameras(self) -> list[Camera]:
        """The camera of each UAV."""
        return [self.setting.believed_camera(i) for i in range(len(self.setting.uavs))]

    def scans(self) -> Iterator[tuple[Scan, ...]]:
        """The scans of each instant with frames, by ascending UAV."""
        for k in np.flatnonzero(self.frames.any(axis=1)).tolist():
            yield tuple(self.observed[k, i].scan for i in np.flatnonzero(self.frames[k]).tolist())


def read_flight(
    folder: Path | str,
    *,
    overrides: Sequence[str] = (),
    origin: tuple[float, float] = (0.0, 0.0),
    sigma: float = 0.0,
    detector: str = "blob",
    classes: str = "",
    least_score: float | None = None,
) -> ScannedFlight:
    """Read a flight from the files in its folder; InputError says what to change.

    Args:
        folder: The files, see docs/how-to/flights.md.
        overrides: Changes of `scenario.toml`, as key=value.
        origin: Place in the files [m] that becomes the area's centre.
        sigma: Standard deviation [m] to add to detections without a covariance of their own.
        detector: Name of what finds people in images, as `sensing.detector`.
        classes: Names or numbers of the classes of detections that count, as "pedestrian,people"; by default of people.
        least_score: Of detections that count; by default more than 0.
    """
    folder = Path(folder)
    settings = folder / "scenario.toml"
    given = read_toml(settings, "scenario") if settings.exists() else {}
    of_uavs = [override for override in overrides if override.startswith("uavs")]
    apply_overrides(given, [override for override in overrides if override not in of_uavs])
    selection = Selection(tuple(filter(None, map(str.strip, classes.split(",")))), least_score)
    own = decode({"trees": pick_tree_keys(given), **{key: given[key] for key in ("geo", "ground") if key in given}})
    flight = read_files(folder, origin, own, detector, selection)
    _override_uavs(given, of_uavs, len(flight.uavs))
    setting = make_setting(folder, given, flight)
    people = _find_people(flight, setting)
    told = _tell_times(people, flight) if people else []
    if "area" in given:
        people, remarks = leave_area(flight, setting.area, people)
    else:
        area = choose_area(flight, [uav.true_camera for uav in setting.uavs], people)
        try:
            setting = replace(setting, area=area)
        except ValueError as error:  # too large for so many UAVs
            raise InputError(f"{error}; give a place near the flight: --origin X,Y") from error
        reach = "all that cameras, trees and people reach" if people else "all that cameras and trees reach"
        remarks = [f"area: {area.width:g} × {area.height:g} m was chosen, with {reach}"]
    if not any(uav.people for uav in flight.uavs):
        remarks += describe_trajectories(setting)[1]
    return _place_on_scans(flight, setting, people, sigma, [*remarks, *told])


def _override_uavs(given: dict[str, Any], overrides: Sequence[str], count: int) -> None:
    """Apply overrides of UAVs, of which the scenario may list fewer than the flight has, in place."""
    rows = given.get("uavs", [])
    if overrides and isinstance(rows, list):
        given["uavs"] = [*rows, *({} for _ in range(count - len(rows)))]
    apply_overrides(given, overrides)


def _find_people(flight: LoggedFlight, setting: Scenario) -> Trajectories | None:
    """The people, if they are known; those in frames are present from frame to frame, at places by the first UAV."""
    path = setting.people.trajectory_file
    rate = setting.rates.sensing
    if path is None:
        return None
    if not any(uav.people for uav in flight.uavs):
        slack = _NEAR * max(1 / rate, 2 / SAMPLES_PER_SECOND)  # between two samples, people are there if in both
        return read_trajectories(
            path, WIDEST, duration=setting.duration, people=setting.people, slack=slack, geo=setting.geo
        )
    found: defaultdict[str, dict[int, Array]] = defaultdict(dict)
    for i, (uav, settings) in enumerate(zip(flight.uavs, setting.uavs, strict=True)):
        poses = flight.raised(i).at(np.array([frame.time for frame in uav.people]))
        for frame, pose in zip(uav.people, poses, strict=True):
            places = _find_places(frame, Pose(pose[:3], pose[3:]), settings.true_camera, flight.ground)
            for detection, place in zip(frame.detections, places, strict=True):
                found[detection.person].setdefault(round(frame.time * rate), place)
    times = np.array(setting.scan_times)
    slowest = max(find_gap(uav.people) for uav in flight.uavs)
    positions = np.full((len(times), len(found), 2), np.nan)
    for m, rows in enumerate(found.values()):
        stay = {k / rate: place for k, place in rows.items() if not np.isnan(place[0])}
        if len(stay) > 1:
            positions[:, m] = resample(f"truth: {path}", str(m), stay, times, 1.5 * slowest)
        for k, place in rows.items():
            if k < len(times):
                positions[k, m] = place
    return Trajectories(times, positions)


def _tell_times(people: Trajectories, flight: LoggedFlight) -> list[str]:
    """A remark if nobody is known at the times of some frames."""
    there = people.times[(~np.isnan(people.positions[..., 0])).any(axis=1)]
    last = max(uav.frames[-1].time for uav in flight.uavs)
    if not len(there) or (there[0] <= POSE_GAP and last - there[-1] <= POSE_GAP):
        return []
    spans = [(flight.start + np.array(span)).tolist() for span in ((there[0], there[-1]), (0.0, last))]
    known, seen = (f"from {spell(round(first, 2))} to {spell(round(end, 2))} s" for first, end in spans)
    false = "tracks at other times count as false"
    return [f"truth: people are there {known}, and frames {seen}; {false}; do both have one clock?"]


def _place_on_scans(
    flight: LoggedFlight, setting: Scenario, people: Trajectories | None, sigma: float, remarks: Sequence[str]
) -> ScannedFlight:
    """The flight with its frames at scans; those after a given end, or after a breakdown, are left out."""
    times = np.array(setting.scan_times)
    rate = setting.rates.sensing
    poses = np.empty((len(times), len(flight.uavs), 7))
    frames = np.zeros((len(times), len(flight.uavs)), dtype=np.bool_)
    observed: dict[tuple[int, int], Observed] = {}
    forest = Forest(flight.forest.trees, setting.sensing.occlusion)
    rounded = 0.0
    lost = late = every = unseen = 0
    for i, uav in enumerate(flight.uavs):
        poses[:, i] = uav.poses.at(times)
        taken = [frame for frame in uav.frames if round(frame.time * rate) < len(times)]
        late += len(uav.frames) - len(taken)
        working = [frame for frame in taken if setting.works(i, round(frame.time * rate) / rate)]
        if broken := len(taken) - len(working):
            after = f"after UAV {i} breaks down at {spell(setting.uavs[i].fails_at or 0.0)} s"
            remarks = [*remarks, f"uavs.{i}.fails_at: left out: {broken} frame{'s' * (broken > 1)} {after}"]
        taken = working
        at = np.array([frame.time for frame in taken])
        _check_pose_times(uav.poses, at, i, flight.start)
        _check_pixels(taken, i, uav.camera)
        for frame, pose in zip(taken, flight.raised(i).at(at), strict=True):
            k = round(frame.time * rate)
            rounded = max(rounded, abs(frame.time - k / rate))
            frames[k, i] = True
            placed = frame._replace(time=k / rate)
            camera = setting.uavs[i].true_camera
            scan, pixels = _observe(placed, i, Pose(pose[:3], pose[3:]), camera, sigma, flight.ground)
            observed[k, i] = Observed(dataclasses.replace(scan, forest=forest), pixels)
            poses[k, i] = *scan.pose.position, *scan.pose.quaternion
            measured = scan.measurements
            lost += len(frame.detections) - len(measured)
            seen = setting.believed_camera(i).sees(scan.pose, at_target_height(measured))
            every, unseen = every + len(seen), unseen + int((~seen).sum())
        _check_attitude([found.scan for (_, j), found in observed.items() if j == i], uav.camera.axes)
    if lost and not any(len(found.scan.measurements) for found in observed.values()):
        away = f"all {lost} are {_LOST[flight.ground.surface is not None]}"
        axes = "x right, y up and z back, away from the scene"
        raise InputError(f"detections: {away}; pitch_deg is -90 straight down, and quaternions turn a camera's {axes}")
    remarks = [*flight.remarks, *remarks, *_remark(flight, setting, rounded, lost)]
    if late:
        remarks.append(f"duration: left out: {late} frame{'s' * (late > 1)} after {spell(setting.duration)} s")
    if 2 * unseen > every:
        out = f"{unseen} of {every} are outside the views of their cameras"
        remarks.append(f"detections: {out}; do places, poses, attitudes and angles of view belong together?")
    remarks += _doubt_feet(observed, setting)
    remarks += _remark_on_covariances(flight, [found.scan for found in observed.values()], sigma)
    return ScannedFlight(setting, forest, people, poses, frames, observed, tuple(remarks))


def _check_pose_times(log: PoseLog, times: Array, uav: int, start: float) -> None:
    """InputError if a frame has no pose of its UAV near its time [s], unless the camera stands still there."""
    gaps = log.distances(times)
    if not len(gaps) or gaps.max() <= POSE_GAP:
        return
    worst = times[gaps.argmax()]
    at, first, last = (spell(start + time) for time in (worst, *log.times[[0, -1]]))
    far = f"UAV {uav} has a frame at {at} s, but no pose within {POSE_GAP:g} s"
    if log.covers(worst):
        raise InputError(f"poses: {far}, and moves there; give a pose every {POSE_GAP:g} s")
    raise InputError(f"poses: {far}; its poses are from {first} to {last} s; are both in seconds, of one clock?")


def _find_places(frame: LoggedFrame, pose: Pose, camera: Camera, ground: Terrain) -> Array:
    """Places (N, 2) m of a frame's detections; NaN for pixels above the horizon, or where no ground is known."""
    places = np.array([found.place for found in frame.detections]).reshape(-1, 2)
    pixels = np.array([found.pixel for found in frame.detections]).reshape(-1, 2)
    imaged = np.isnan(places[:, 0])
    places[imaged] = ground.find_places(camera, pose, pixels[imaged])
    return places


def _observe(frame: LoggedFrame, uav: int, pose: Pose, camera: Camera, sigma: float, ground: Terrain) -> Observed:
    """Measurements of a frame at the time of its scan, without those above the horizon, or where a lens shows nothing.

    pose: raised; that of the scan is level. sigma: as of `read_flight`.
    """
    pixels = np.array([found.pixel for found in frame.detections]).reshape(-1, 2)
    entries = np.array([found.covariance for found in frame.detections]).reshape(-1, 3)
    places = _find_places(frame, pose, camera, ground)
    R = entries[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    own = np.isnan(entries[:, 0])
    R[own] = ground.find_covariances(camera, pose, places[own])
    laid = own | np.isnan([found.place[0] for found in frame.detections])
    R[laid] = ground.lay(pose, places[laid], R[laid])
    R[own] += sigma * sigma * np.eye(2)
    kept = ~np.isnan(places[:, 0])
    known = pixels[kept] if np.isfinite(pixels[kept]).all() else np.zeros((0, 2))
    return Observed(Scan(uav, frame.time, ground.level(camera, pose), places[kept], R[kept]), known)


def _check_pixels(frames: Sequence[LoggedFrame], uav: int, camera: LoggedCamera) -> None:
    """InputError if a detection is outside its image."""
    margin = _OUTSIDE * min(camera.size)
    for frame in frames:
        for found in frame.detections:
            inside = (-margin <= part <= edge + margin for part, edge in zip(found.pixel, camera.size, strict=True))
            if math.isnan(found.place[0]) and not all(inside):
                u, v = (spell(part, 6) for part in found.pixel)
                size = " × ".join(map(str, camera.size))
                outside = f"pixel ({u}, {v}) of UAV {uav} is outside its image of {size} pixels"
                raise InputError(f"{frame.where}: {outside}; does cameras.csv belong to these images?")


def _check_attitude(scans: Sequence[Scan], axes: str) -> None:
    """InputError if a camera looks above the horizon in all of its scans, without a measurement in front of it.

    axes: as of `name_axes`.
    """
    if scans and not any(_sees_ground(scan) for scan in scans):
        always = f"the camera of UAV {scans[0].uav} looks above the horizon in each of its {len(scans)} frames"
        hint = "quaternions are xyzw, 0,0,0,1 looks straight down, and pitch_deg is -90 there"
        named = name_axes(np.array([scan.pose.quaternion for scan in scans]), axes)
        raise InputError("; ".join(filter(None, (f"poses: {always}", hint, named))))


def _sees_ground(scan: Scan) -> bool:
    back = scan.pose.rotation[:, 2]
    away = scan.measurements - scan.pose.position[:2]
    depths = scan.pose.position[2] * back[2] - away[:, 0] * back[0] - away[:, 1] * back[1]
    return bool(back[2] >= 0 or (depths > 0).any())


def _remark(flight: LoggedFlight, setting: Scenario, rounded: float, lost: int) -> Iterator[str]:
    """Remarks on what the files leave out, or what of them is left out.

    rounded: longest time [s] from a frame to its scan; lost: number of detections left out.
    """
    if flight.start:
        yield f"time_s: times count from the first frame, at {spell(flight.start)} s"
    rate = setting.rates.sensing
    if rounded > EXACT / rate:
        yield f"time_s: frames are at scans of {rate} Hz, {1000 * rounded:.0f} ms or less from their own times"
    if lost:
        yield f"detections: left out: {lost} {_LOST[flight.ground.surface is not None]}"
    yield from tell_doubts(doubt for i, uav in enumerate(flight.uavs) for doubt in _doubt_times(uav, i, setting))


def _doubt_times(uav: LoggedUav, number: int, setting: Scenario) -> Iterator[Doubt]:
    """Doubts about the times of poses and frames of a UAV of this number."""
    times = np.array([frame.time for frame in uav.frames])
    after = uav.poses.distances(times)[~uav.poses.covers(times)]
    if len(uav.poses.times) > 1 and (after > _GAP * np.median(np.diff(uav.poses.times))).any():
        least = f"{len(after)} frame{'s' * (len(after) > 1)} of UAV {number} before the first pose or after the last"
        yield Doubt(number, f"poses: {least}, by up to {spell(after.max(), 3)} s", "such frames have that pose")
    usual = find_gap(uav.frames)
    flown = [time for time in uav.poses.times.tolist() if setting.works(number, time)]
    missing = len(times) > 1 and (
        np.diff(times).max() > _GAP * usual or np.ptp(times) + usual < _SEEN * np.ptp(flown or [0.0])
    )
    if missing and all(frame.detections for frame in uav.frames):
        every = f"detections: each frame of UAV {number} has a detection"
        yield Doubt(number, every, "list those without, too, as rows of time_s and uav: they show where nobody is")


def _doubt_feet(observed: Mapping[tuple[int, int], Observed], setting: Scenario) -> Iterator[str]:
    """A remark if places are as much nearer to cameras than their pixels say as a foot is shorter than a metre."""
    shares = list[float]()
    for (_, uav), (scan, pixels) in observed.items():
        if len(pixels):
            at = scan.pose.position[:2]
            seen = setting.uavs[uav].true_camera.ground_points(scan.pose, pixels, TARGET_HEIGHT) - at
            near, far = np.hypot(*(scan.measurements - at).T), np.hypot(*seen.T)
            shares += (near[far > 0] / far[far > 0]).tolist()
    if shares and abs(np.median(shares) / _FOOT - 1) < _ALIKE:
        yield "poses: places of detections are 0.3 times as far from cameras as their pixels say; are heights in feet?"


def _remark_on_covariances(flight: LoggedFlight, scans: Sequence[Scan], sigma: float) -> Iterator[str]:
    """A remark if detections have covariances that take poses as exact, or if `sigma` is added to none."""
    detections = (found for uav in flight.uavs for frame in uav.frames for found in frame.detections)
    traces = [trace for scan in scans for trace in np.trace(scan.covariances, axis1=1, axis2=2).tolist()]
    given = not any(math.isnan(found.covariance[0]) for found in detections)
    if traces and sigma and given:
        yield "--sigma: not used: all detections have covariances of their own"
    if traces and not sigma and not given:
        spread = math.sqrt(np.median(traces) / 2)
        exact = f"those without a covariance get {spread:.2f} m, as of exact poses"
        yield f"detections: {exact}; if too many tracks begin, --sigma adds errors of poses"
