"""Values that readers of formats give and writers take: logged flights, labelled images, and columns of a recording."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sim.facts.metrics.score import estimate_velocities
from sim.mission.recording import Recording
from sim.scenario.camera_settings import CameraSettings, make_camera
from sim.scenario.geo import Geo
from sim.scenario.uavs import UavSettings
from sim.world.terrain import Terrain
from tracking.errors import InputError
from tracking.geometry.camera import Camera
from tracking.geometry.quaternions import interpolate_poses
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.trigonometry import tan
from tracking.settings import read_settings

SPLITS = ("train", "val", "test")  # of labelled images
Columns = Mapping[str, NDArray[Any]]  # columns (N,) of a table by name
STATE = ("x", "y", "vx", "vy")  # m, m/s
# Upper triangle of a covariance by rows; each entry is named by its two states.
COVARIANCE = tuple(a + b for i, a in enumerate(STATE) for b in STATE[i:])
TRACK = ("time", "uav", "id", *STATE, *COVARIANCE, "existence")
NOWHERE = (math.nan, math.nan)
POSE_GAP = 2.0  # s, longest time from a frame to the nearest pose
_STILL = 1e-3  # m, and parts of a quaternion, by which poses of a camera that stands still differ at most


class PoseLog(NamedTuple):
    """Poses of one UAV's camera in order of time."""

    times: Array  # (P,) s
    rows: Array  # (P, 7), position [m] and quaternion xyzw

    def at(self, times: Array) -> Array:
        """Poses (N, 7) at times (N,) s, interpolated; the first and the last one also hold before and after."""
        return interpolate_poses(self.times, self.rows, np.clip(times, *self.times[[0, -1]]))

    def distances(self, times: Array) -> Array:
        """Time (N,) s from each of the times (N,) s to the nearest pose; 0 where the camera stands still."""
        if len(self.times) == 1:
            return np.zeros(len(times))
        near = np.searchsorted(self.times, times)
        before, after = np.maximum(near - 1, 0), np.minimum(near, len(self.times) - 1)
        gaps = np.minimum(np.abs(times - self.times[before]), np.abs(times - self.times[after]))
        moves = (before == after) | (np.abs(self.rows[before] - self.rows[after]) > _STILL).any(axis=1)
        return np.where(moves, gaps, 0.0)

    def cut(self, first: float, last: float) -> "PoseLog":
        """The poses from one time [s] to another, with those next to them; all unless they cover both."""
        if not self.covers(np.array([first, last])).all():
            return self
        inner = slice(np.searchsorted(self.times, first, "right") - 1, np.searchsorted(self.times, last) + 1)
        return PoseLog(self.times[inner], self.rows[inner])

    def covers(self, times: Array) -> Flags:
        """Mask (N,) of the times (N,) s that are not before the first pose or after the last one."""
        return np.asarray((self.times[0] <= times) & (times <= self.times[-1]))


class DroneLog(NamedTuple):
    """What a drone logged, in order of time; NaN where it lacks a value."""

    path: Path
    times: Array  # (N,) s, of the log's own clock, or of its video
    places: Array  # (N, 2) deg, latitude and longitude, or m to the east and north
    heights: Array  # (N,) m
    attitudes: Array  # (N, 3) deg, yaw, pitch and roll of a gimbal as in `find_attitudes`, or (N, 4) quaternions xyzw
    above: str = "start"  # what heights are above: "start", "sea" or "ground"
    on_map: bool = True  # False if places are in m
    axes: str = "frd"  # of quaternions
    epoch: float = math.nan  # s, time since 1970 of the log's zero
    film: tuple[float, float] | None = None  # s, first and last time of its video, if the log tells it
    focal: float = math.nan  # mm, focal length of the camera as of a film 43.3 mm across the corners
    remarks: tuple[str, ...] = ()  # on what was read
    format: str = ""


def turn_at(times: Array, own: Array, quaternions: Array) -> Array:
    """Quaternions (N, 4) at times (N,) s, interpolated between those (P, 4) at their own times (P,) s."""
    known, first = np.unique(own, return_index=True)
    return PoseLog(known, np.hstack([np.zeros((len(known), 3)), quaternions[first]])).at(times)[:, 3:]


def find_attitudes(angles: Array) -> Array:
    """Attitudes (N, 4) of images by yaw, pitch and roll (N, 3) deg of a gimbal.

    Yaw is clockwise from north, pitch -90 straight down, and roll clockwise.
    """
    yaw, pitch, roll = np.radians(angles).T
    turns = np.column_stack([-yaw, math.pi / 2 + pitch, -roll])
    return np.asarray(Rotation.from_euler("ZXZ", turns).as_quat())


class LoggedDetection(NamedTuple):
    """One detection, on the ground or in the image; NaN for what is not known."""

    place: tuple[float, float] = NOWHERE  # m
    covariance: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # xx, xy, yy [m²]
    pixel: tuple[float, float] = NOWHERE  # of the person's mid-height
    person: str = ""  # id, if this is a label
    category: str = ""  # name of its class, or a number without a name
    score: float = math.nan  # the detector's confidence

    @property
    def is_somewhere(self) -> bool:
        """False for a box without a size."""
        return not (math.isnan(self.place[0]) and math.isnan(self.pixel[0]))


class LoggedFrame(NamedTuple):
    """The detections of one frame."""

    time: float  # s
    where: str  # file, and line of the first detection
    detections: list[LoggedDetection]


class CameraFrames(NamedTuple):
    """Frames of one camera in order of time."""

    frames: list[LoggedFrame]
    people: Sequence[LoggedFrame] = ()  # with the ids of people, if they are known
    size: tuple[int, int] | None = None  # width and height of the images, if known
    categories: Mapping[str, str] = {}  # names of the classes that have numbers, which detections have, too
    groups: Mapping[str, Collection[str]] = {}  # names of classes by those of groups, as COCO's supercategories
    remarks: tuple[str, ...] = ()  # on what was read

    def without_places(self) -> "CameraFrames":
        """The same with pixels alone, and covariances, if ground is not as flat as a detector took it to be."""
        flat = ([found._replace(place=NOWHERE) for found in frame.detections] for frame in self.frames)
        return self._replace(
            frames=[frame._replace(detections=own) for frame, own in zip(self.frames, flat, strict=True)]
        )


class LoggedCamera(NamedTuple):
    """The camera of one UAV."""

    view: Mapping[str, Any]  # `fov_deg` and `pixels`, or `camera`, of a UAV of a scenario
    size: tuple[int, int]  # width and height of the images [pixel]
    clock_offset: float = 0.0  # s, to add to the UAV's times
    spans: str = ""  # what its angle of view is over, if that is a part of the images
    axes: str = "image"  # of the quaternions of its poses; empty if these have none
    # `pose_offset_s` to add to times of poses, and what a log may lack: `yaw_deg`, `pitch_deg`, `roll_deg`, `height_m`
    given: Mapping[str, float] = {}

    def fit(self, size: tuple[int, int], where: str) -> "LoggedCamera":
        """The camera of images of this size: of wide ones, if its own square is that in their middle; else InputError.

        The square has the shorter edge of wide images.
        """
        if self.size == size:
            return self
        width, height = self.size
        own = str(width) if width == height else f"{width} × {height}"
        images = f"images have {size[0]} × {size[1]} pixels, but the camera in cameras.csv has {own}"
        if "pixels" not in self.view:
            raise InputError(f"{where}: {images}; expected its own size")
        if width != min(size):
            raise InputError(f"{where}: {images}; give it {min(size)}, and the angle of view over these")
        return self.widen(size)

    def widen(self, size: tuple[int, int]) -> "LoggedCamera":
        """The camera of wide images whose middle square is this one; InputError if there is none."""
        pixels, fov_deg = self.view["pixels"], self.view["fov_deg"]
        focal = pixels / 2 / tan(math.radians(fov_deg) / 2)
        whole = read_settings({"width": size[0], "height": size[1], "focal": (focal, focal)}, CameraSettings)
        across, down = (math.degrees(2 * math.atan2(edge / 2, focal)) for edge in size)
        part = f"fov_deg {fov_deg:g} is over {pixels} pixels in the middle of its images"
        spans = f"{part}, so that their {size[0]} × {size[1]} span {across:.1f} × {down:.1f} deg"
        return make_calibrated_camera(whole)._replace(clock_offset=self.clock_offset, spans=spans)


class LoggedUav(NamedTuple):
    """What is logged of one UAV."""

    camera: LoggedCamera
    poses: PoseLog
    frames: list[LoggedFrame]
    people: Sequence[LoggedFrame] = ()  # as of `CameraFrames`


@dataclass(frozen=True, eq=False)
class LoggedFlight:
    """A flight as its files log it, with times [s] since its first frame and places [m] from its origin."""

    uavs: Sequence[LoggedUav]
    forest: Forest
    start: float  # s, time in the files of the first frame
    origin: tuple[float, float]  # m, place in the files of the origin
    geo: Geo  # where the origin of files is on the map
    labels: Path | None  # file of the people, if they are known
    ground: Terrain  # heights of poses are above it
    remarks: Sequence[str] = ()  # on what was read

    def raised(self, uav: int) -> PoseLog:
        """Poses of a UAV with heights above sea level, if the ground has such heights."""
        log = self.uavs[uav].poses
        return PoseLog(log.times, self.ground.raise_poses(log.rows, f"UAV {uav}"))

    @property
    def places(self) -> Array:
        """Places (N, 2) m of poses and trees."""
        return np.vstack([*(uav.poses.rows[:, :2] for uav in self.uavs), self.forest.table[:, :2]])


def make_square_camera(fov_deg: float, pixels: int) -> LoggedCamera:
    """A camera of square images; InputError if there is none."""
    read_settings({"start": (0.0, 0.0), "fov_deg": fov_deg, "pixels": pixels}, UavSettings)
    return LoggedCamera({"fov_deg": fov_deg, "pixels": pixels}, (pixels, pixels))


def make_calibrated_camera(settings: CameraSettings) -> LoggedCamera:
    """A calibrated camera."""
    return LoggedCamera({"camera": msgspec.to_builtins(settings)}, make_camera(settings).size)


def find_gap(frames: Sequence[LoggedFrame]) -> float:
    """The usual time [s] from one frame to the next; 0 for a single one."""
    return float(np.median(np.diff([frame.time for frame in frames]))) if len(frames) > 1 else 0.0


class ShownPerson(NamedTuple):
    """A person of whom an image shows a pixel or more."""

    person: int
    mask: Flags  # (H, W)
    box: tuple[int, int, int, int]  # left, top, width and height around the mask, in pixels from the top left corner
    visible_share: float  # pixels shown over those that the image would show if nothing hid the person


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """An image of a flight, with the people whom it shows."""

    split: str  # one of `SPLITS`
    flight: int  # number of the flight in the data set
    recording: Recording
    k: int  # scan
    uav: int
    people: list[ShownPerson]

    @property
    def camera(self) -> Camera:
        """The camera that took it."""
        return self.recording.setting.uavs[self.uav].true_camera

    @property
    def name(self) -> str:
        """Name of its files, without an ending."""
        return f"flight{self.flight:04d}-uav{self.uav}-scan{self.k:05d}"


def list_measurements(recording: Recording) -> Columns:
    """Position [m] and entries of the covariance [m²] of each measurement."""
    k, uav = recording.cells(recording.measurement_offsets)
    (x, y), R = recording.measurements.T, recording.measurement_covariances
    entries = {"xx": R[:, 0, 0], "xy": R[:, 0, 1], "yy": R[:, 1, 1]}
    return {"scan": k, "uav": uav, "time": recording.times[k], "x": x, "y": y, **entries}


def list_tracks(recording: Recording) -> Columns:
    """Each track of working UAVs: id, mark of a reported one, state, covariance and existence (NaN if it has none)."""
    k, uav = recording.cells(recording.track_offsets)
    row, column = np.triu_indices(len(STATE))
    columns = {
        "scan": k,
        "uav": uav,
        "time": recording.times[k],
        "reported": recording.reported,
        "id": recording.track_ids,
        **dict(zip(STATE, recording.track_means.T, strict=True)),
        **dict(zip(COVARIANCE, recording.track_covariances[:, row, column].T, strict=True)),
        "existence": recording.track_existence,
    }
    works = recording.working[k, uav]
    return {name: values[works] for name, values in columns.items()}


def list_truth(recording: Recording) -> Columns:
    """Position [m] and velocity [m/s] of each person present."""
    k, person = np.nonzero(~np.isnan(recording.people[:, :, 0]))
    state = np.hstack([recording.people[k, person], estimate_velocities(recording)[k, person]])
    return {"scan": k, "person": person, "time": recording.times[k], **dict(zip(STATE, state.T, strict=True))}


def list_rows(table: Columns, names: Sequence[str], where: Flags | None = None) -> Iterator[tuple[Any, ...]]:
    """Rows of the named columns as Python numbers; where (N,): the rows to take, by default all."""
    columns = (table[name] if where is None else table[name][where] for name in names)
    return zip(*(column.tolist() for column in columns), strict=True)
