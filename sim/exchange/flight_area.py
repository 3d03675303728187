"""The area of a flight: all that its cameras, trees and people reach, or the one that is given, and who leaves it."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.values import LoggedFlight
from sim.scenario.environment import Area
from sim.world.trajectories import Trajectories
from tracking.errors import list_numbers
from tracking.geometry.camera import Camera
from tracking.numerics.arrays import Array, Flags

WIDEST = Area(width=20_000.0, height=20_000.0)
_MARGIN = 10.0  # m of the area beyond all cameras and trees
_STEP = 10.0  # m, of which half the sides are multiples
_FARTHEST = 10.0  # heights, up to which views reach to the side where they come near the horizon, or above it


def choose_area(flight: LoggedFlight, cameras: Sequence[Camera], people: Trajectories | None) -> Area:
    """The least area of whole steps, centred on the origin, with all that cameras, trees and people reach."""
    reached = [np.abs(flight.places).max(axis=0) + _MARGIN]
    for uav, camera in zip(flight.uavs, cameras, strict=True):
        poses = uav.poses.at(np.array([frame.time for frame in uav.frames]))
        reached.append(np.abs(_find_views(camera, poses)).max(axis=0))
    if people:
        reached.append(np.fmax.reduce(np.abs(people.positions).reshape(-1, 2), initial=0.0))
    half = _STEP * np.ceil(np.max(reached, axis=0) / _STEP - 1e-9)
    return Area(*np.minimum(2 * half, (WIDEST.width, WIDEST.height)).tolist())


def _find_views(camera: Camera, poses: Array) -> Array:
    """Places (N, 2) m where the outlines of a camera's images from poses (P, 7) are on the ground."""
    slopes = camera.slopes(camera.outline)
    views = [poses[:, :2]]
    for right, down in slopes[np.isfinite(slopes[:, 0])]:
        east, north, up = Rotation.from_quat(poses[:, 3:]).apply([right, -down, -1.0]).T
        fall = np.maximum(-up, np.maximum(np.hypot(east, north) / _FARTHEST, 1e-9))
        views.append(poses[:, :2] + poses[:, 2:3] * np.column_stack([east, north]) / fall[:, None])
    return np.vstack(views)


def leave_area(flight: LoggedFlight, area: Area, people: Trajectories | None) -> tuple[Trajectories | None, list[str]]:
    """The people, absent while they are outside a given area, and a remark on all that is outside it."""
    outside = []
    if people:
        gone = _are_outside(people.positions, area)
        if gone.any():
            seconds = float(gone.sum() * (people.times[1] - people.times[0]))
            count = f"{gone.any(axis=0).sum()} of {gone.shape[1]} people for {seconds:.1f} s in all"
            outside.append(f"{count}, who count as gone there")
            people = Trajectories(people.times, np.where(gone[..., None], np.nan, people.positions))
    if trees := int(_are_outside(flight.forest.table[:, :2], area).sum()):
        outside.append(f"{trees} of {len(flight.forest.trees)} trees")
    poses = [uav.poses.rows[:, :2] for uav in flight.uavs]
    if left := [i for i, places in enumerate(poses) if _are_outside(places, area).any()]:
        outside.append(f"{list_numbers('UAV', left)} at times")
    size = f"{area.width:g} × {area.height:g} m, as given"
    return people, [f"area: {size}; outside are {', and '.join(outside)}"] if outside else []


def _are_outside(places: Array, area: Area) -> Flags:
    """Flags (...) of places (..., 2) m that are outside the area; NaN is not."""
    return np.asarray((np.abs(places) > (area.width / 2, area.height / 2)).any(axis=-1))
