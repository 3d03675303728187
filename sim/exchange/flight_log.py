"""A flight from elsewhere: poses and detections of its UAVs, its trees, and its people if they are known."""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim.exchange.flight_files import FlightFiles, read_files
from sim.exchange.flight_setting import EXACT, find_rate, make_setting
from sim.exchange.flight_tables import CameraRow, LoggedFrame, Poses, measure_gap
from sim.scenario.overrides import apply_overrides
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import read_toml
from sim.sensing.cameras import view_of
from sim.world.recorded_people import read_trajectories, resample
from sim.world.trajectories import Trajectories
from tracking.detection.detection_errors import whole_covariances
from tracking.errors import InputError, spell
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.quaternions import interpolate_poses
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Flags
from tracking.track import Scan

_POSE_GAP = 2.0  # s, longest time from a frame to the nearest pose
_OUTSIDE = 0.05  # of the image's edge, by which pixels of detections may be outside


class FlightOptions(NamedTuple):
    """What the files of a flight do not say."""

    overrides: Sequence[str] = ()  # `key=value` of `scenario.toml`
    origin: tuple[float, float] = (0.0, 0.0)  # m, place in the files of the origin
    sigma: float = 0.0  # m, standard deviation to add to detections without a covariance of their own
    detector: str = "blob"  # as `sensing.detector`, for images


PLAIN = FlightOptions()


@dataclass(frozen=True, eq=False)
class FlightLog:
    """A flight of n UAVs, whose frames are at K scans with the rate of its scenario."""

    setting: Scenario
    forest: Forest  # with the occlusion that trackers assume
    people: Trajectories | None  # None if they are unknown
    poses: Array  # (K, n, 7) of the cameras: position [m] and quaternion xyzw
    frames: Flags  # (K, n), True where a camera took a frame
    observed: Mapping[tuple[int, int], tuple[Scan, Array]]  # by scan and UAV with a frame: scan, and pixels (N, 2)
    remarks: tuple[str, ...]

    @property
    def cameras(self) -> list[Camera]:
        """The camera of each UAV."""
        return [view_of(uav, self.setting) for uav in self.setting.uavs]

    def scans(self) -> Iterator[tuple[Scan, ...]]:
        """The scans of each instant with frames, by ascending UAV."""
        for k in np.flatnonzero(self.frames.any(axis=1)).tolist():
            yield tuple(self.observed[k, i][0] for i in np.flatnonzero(self.frames[k]).tolist())


def read_flight(folder: Path | str, options: FlightOptions = PLAIN) -> FlightLog:
    """Read a flight from the files in its folder, see docs/how-to/flights.md; InputError says what to change."""
    folder = Path(folder)
    own = folder / "scenario.toml"
    given = read_toml(own, "scenario") if own.exists() else {}
    apply_overrides(given, options.overrides)
    files = read_files(folder, options.origin, options.detector)
    rate = find_rate(given, files.fleet)
    end = given.get("duration", max(frames[-1].time for frames in files.fleet.values()))
    setting = make_setting(folder, given, files, rate=rate, end=end)
    return _place_on_scans(files, setting, _find_people(files, setting), options.sigma)


def _find_people(files: FlightFiles, setting: Scenario) -> Trajectories | None:
    """The people, if they are known; those in frames are present from frame to frame, at places by the first UAV."""
    path, rate = setting.people.trajectory_file, setting.rates.sensing
    if path is None:
        return None
    if not any(files.people.values()):
        return read_trajectories(path, setting.area, duration=setting.duration, people=setting.people)
    found: defaultdict[str, dict[int, Array]] = defaultdict(dict)
    for i, frames in files.people.items():
        log, times = files.poses[i], np.array([frame.time for frame in frames])
        for frame, pose in zip(
            frames, interpolate_poses(log.times, log.rows, np.clip(times, *log.times[[0, -1]])), strict=True
        ):
            places = _find_places(frame, Pose(pose[:3], pose[3:]), setting.uavs[i].true_camera)
            for detection, place in zip(frame.detections, places, strict=True):
                found[detection.person].setdefault(round(frame.time * rate), place)
    times, slowest = np.array(setting.scan_times), max(measure_gap(frames) for frames in files.people.values())
    positions = np.full((len(times), len(found), 2), np.nan)
    for m, rows in enumerate(found.values()):
        stay = {k / rate: place for k, place in rows.items() if not np.isnan(place[0])}
        if len(stay) > 1:
            positions[:, m] = resample(f"truth: {path}", str(m), stay, times, 1.5 * slowest)
        for k, place in rows.items():
            if k < len(times):
                positions[k, m] = place
    return Trajectories(times, positions)


def _place_on_scans(files: FlightFiles, setting: Scenario, people: Trajectories | None, sigma: float) -> FlightLog:
    """The flight with its frames at scans; frames after its end are left out."""
    times = np.array(setting.scan_times)
    rate, uavs = setting.rates.sensing, len(files.cameras)
    poses, frames = np.empty((len(times), uavs, 7)), np.zeros((len(times), uavs), dtype=np.bool_)
    observed: dict[tuple[int, int], tuple[Scan, Array]] = {}
    rounded, lost = 0.0, 0
    for i, log in files.poses.items():
        camera, edges = setting.uavs[i].true_camera, log.times[[0, -1]]
        poses[:, i] = interpolate_poses(log.times, log.rows, np.clip(times, *edges))
        taken = [frame for frame in files.fleet[i] if round(frame.time * rate) < len(times)]
        at = np.array([frame.time for frame in taken])
        _check_pose_times(log, at, i, files.start)
        _check_pixels(taken, i, files.cameras[i])
        for frame, pose in zip(taken, interpolate_poses(log.times, log.rows, np.clip(at, *edges)), strict=True):
            k = round(frame.time * rate)
            rounded = max(rounded, abs(frame.time - k / rate))
            poses[k, i], frames[k, i] = pose, True
            observed[k, i] = _make_scan(frame, i, k / rate, Pose(pose[:3], pose[3:]), camera, sigma)
            lost += len(frame.detections) - len(observed[k, i][0].measurements)
        _check_attitude([scan for (_, uav), (scan, _) in observed.items() if uav == i])
    remarks = [*_remark(files, rate, rounded, lost), *([] if sigma else _remark_on_covariances(files, observed))]
    forest = Forest(files.forest.trees, setting.sensing.occlusion)
    return FlightLog(setting, forest, people, poses, frames, observed, tuple(remarks))


def _check_pose_times(log: Poses, times: Array, uav: int, start: float) -> None:
    """InputError if a frame has no pose of its UAV near its time [s]."""
    near = np.searchsorted(log.times, times)
    before, after = log.times[np.maximum(near - 1, 0)], log.times[np.minimum(near, len(log.times) - 1)]
    gaps = np.minimum(np.abs(times - before), np.abs(times - after))
    if len(gaps) and gaps.max() > _POSE_GAP:
        at, first, last = (spell(start + time) for time in (times[gaps.argmax()], *log.times[[0, -1]]))
        far = f"UAV {uav} has a frame at {at} s, but no pose within {_POSE_GAP:g} s"
        raise InputError(f"poses: {far}; its poses are from {first} to {last} s; are both in seconds, of one clock?")


def _find_places(frame: LoggedFrame, pose: Pose, camera: Camera) -> Array:
    """Places (N, 2) m of a frame's detections; NaN for pixels above the horizon."""
    places = np.array([found.place for found in frame.detections]).reshape(-1, 2)
    pixels = np.array([found.pixel for found in frame.detections]).reshape(-1, 2)
    imaged = np.isnan(places[:, 0])
    places[imaged] = camera.ground_points(pose, pixels[imaged], TARGET_HEIGHT)
    return places


def _make_scan(
    frame: LoggedFrame, uav: int, time: float, pose: Pose, camera: Camera, sigma: float
) -> tuple[Scan, Array]:
    """Scan of a frame at a pose, and its pixels (N, 2), or (0, 2) if it has none.

    Left out are detections above the horizon, or where a lens shows nothing.
    """
    pixels = np.array([found.pixel for found in frame.detections]).reshape(-1, 2)
    entries = np.array([found.covariance for found in frame.detections]).reshape(-1, 3)
    places = _find_places(frame, pose, camera)
    own, R = np.isnan(entries[:, 0]), entries[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    R[own] = whole_covariances(camera.lens(pose), places[own]) + sigma * sigma * np.eye(2)
    kept = ~np.isnan(places[:, 0])
    known = pixels[kept] if np.isfinite(pixels[kept]).all() else np.zeros((0, 2))
    return Scan(uav, time, pose, places[kept], R[kept]), known


def _check_pixels(frames: Sequence[LoggedFrame], uav: int, camera: CameraRow) -> None:
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


def _check_attitude(scans: Sequence[Scan]) -> None:
    """InputError if a camera looks above the horizon in all of its scans, without a measurement in front of it."""
    if scans and not any(_sees_ground(scan) for scan in scans):
        always = f"the camera of UAV {scans[0].uav} looks above the horizon in each of its {len(scans)} frames"
        hint = "quaternions are xyzw, 0,0,0,1 looks straight down, and pitch_deg is -90 there"
        raise InputError(f"poses: {always}; {hint}; are these wxyz?")


def _sees_ground(scan: Scan) -> bool:
    back, away = scan.pose.rotation[:, 2], scan.measurements - scan.pose.position[:2]
    depths = scan.pose.position[2] * back[2] - away[:, 0] * back[0] - away[:, 1] * back[1]
    return bool(back[2] >= 0 or (depths > 0).any())


def _remark(files: FlightFiles, rate: int, rounded: float, lost: int) -> Iterator[str]:
    """Remarks on what the files leave out, or what of them is left out."""
    if files.start:
        yield f"time_s: times count from the first frame, at {spell(files.start)} s"
    if rounded > EXACT / rate:
        yield f"time_s: frames are at scans of {rate} Hz, {1000 * rounded:.0f} ms or less from their own times"
    if lost:
        yield f"detections: left out: {lost} above the horizon, or where a lens shows nothing"
    for uav, frames in files.fleet.items():
        if len(frames) > 1 and all(frame.detections for frame in frames):
            every = f"each frame of UAV {uav} has a detection"
            yield f"detections: {every}; list those without, too, as rows of time_s and uav: they show where nobody is"


def _remark_on_covariances(files: FlightFiles, observed: Mapping[tuple[int, int], tuple[Scan, Array]]) -> Iterator[str]:
    """A remark if detections have covariances that take poses as exact."""
    detections = (found for frames in files.fleet.values() for frame in frames for found in frame.detections)
    if any(math.isnan(found.covariance[0]) for found in detections):
        traces = [np.trace(scan.covariances, axis1=1, axis2=2) for scan, _ in observed.values()]
        spread = math.sqrt(np.median(np.concatenate(traces)) / 2)
        exact = f"those without a covariance get {spread:.2f} m, as of exact poses"
        yield f"detections: {exact}; if too many tracks begin, --sigma adds errors of poses"
