"""Visibility of a person and of a track on the rest of a UAV's plan."""

from dataclasses import dataclass, replace

import numpy as np

from planning.planner import Vehicle
from planning.prediction.response import mean_velocities, response
from sim.facts.tracking_replay import replay_tracking
from sim.mission.knowledge import BodyState, make_vehicle
from sim.mission.recording import Recording
from sim.mission.tracker_setup import make_planned_motion
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array, Indices

OUT_OF_VIEW, HIDDEN, IN_VIEW = 0, 1, 2  # states of a place in a camera
_SLACK = 1e-6  # s


@dataclass(frozen=True, eq=False)
class PlannedVisibility:
    """Visibility on the rest of one UAV's plan from a scan on, at S instants with the interval of scans."""

    made: float  # s, time of the plan's decision
    times: Array  # (S,) s
    path: Array  # (S, 2) m, path of the UAV
    person: Indices  # (S,), state of the true person: `OUT_OF_VIEW`, `HIDDEN`, `IN_VIEW`; -1 after the mission
    track: Indices | None  # (S,), state of the track as planners predict it; None without a track


def find_planned_visibility(
    recording: Recording, k: int, uav: int, person: int, belief: Gaussian | None
) -> PlannedVisibility | None:
    """Visibility of a person, and of a track with `belief`, on the plan of a UAV from scan k on.

    None if there is no plan or nothing of it is left.
    """
    scenario = recording.setting
    now = float(recording.times[k])
    rate = scenario.rates.sensing
    plan = int(recording.flown_decisions[k])
    if plan < 0 or not recording.working[k, uav]:
        return None
    at, corners, poses = _plan_flight(recording, plan, uav)
    times = now + np.arange(1, int((at[-1] - now + _SLACK) * rate) + 1) / rate
    if len(times) == 0:
        return None
    path = np.column_stack([np.interp(times, at, corners[:, axis]) for axis in (0, 1)])
    views = [Pose(np.append(place, poses.position[2]), poses.quaternion) for place in path]
    known = recording.people[k + 1 : k + 1 + len(times), person]
    ahead = np.full(len(times), -1)
    ahead[: len(known)] = _find_view_states(recording, uav, views, known)
    track = None
    if belief is not None:
        scan = replace(make_planned_motion(scenario, replay_tracking(recording).motion(k, uav)), dt=1 / rate, scans=1)
        nominal = scan.positions_ahead(belief.mean[None], belief.covariance[None], len(times))
        track = _find_view_states(recording, uav, views, nominal[:, 0])
    return PlannedVisibility(float(recording.plan_times[plan]), times, path, ahead, track)


def _plan_flight(recording: Recording, plan: int, uav: int) -> tuple[Array, Array, Pose]:
    """Times (H + 1,) s and corners (H + 1, 2) m of a plan's path, and the camera's pose at its beginning.

    The path begins at the UAV's position when the plan was due. UAV and camera move as planners assume.
    """
    setting = recording.setting
    step = setting.rates.plan_step
    begun = setting.plan_start(float(recording.plan_times[plan]))
    controls = recording.plans[plan, uav]
    controls = controls[~np.isnan(controls[:, 0])]
    vehicle = find_vehicle(recording, int(np.argmin(np.abs(recording.times - begun))), uav)
    flown = mean_velocities(response([vehicle], step), controls[None, None])[0, 0]
    corners = vehicle.position[:2] + np.vstack([np.zeros(2), step * np.cumsum(flown, axis=0)])
    camera = Pose(vehicle.position, vehicle.attitude)
    return begun + step * np.arange(len(corners), dtype=float), corners, camera


def _find_view_states(recording: Recording, uav: int, views: list[Pose], places: Array) -> Indices:
    """States (S,) of places (S, 2) m in the camera at S or more poses; `OUT_OF_VIEW` for NaN."""
    setting = recording.setting
    trees = recording.known_forest
    camera = setting.believed_camera(uav)
    found = np.full(len(places), OUT_OF_VIEW)
    for s, (pose, place) in enumerate(zip(views, places, strict=False)):
        point = at_target_height(place[None])
        if np.isfinite(place).all() and camera.sees(pose, point)[0]:
            found[s] = IN_VIEW if trees.visible(pose.position, point)[0, 0] else HIDDEN
    return found


def find_vehicle(recording: Recording, k: int, uav: int) -> Vehicle:
    """A UAV at scan k, where it believes it is.

    Note: the velocity is the mean since the previous scan, because recordings have none; at the first scan it is zero.
    """
    own = recording.poses[:, uav]
    velocity = (own[k, :2] - own[max(k - 1, 0), :2]) * recording.setting.rates.sensing
    body = recording.believed_bodies[k, uav]
    return make_vehicle(recording.setting, uav, BodyState(Pose(body[:3], body[3:]), velocity))
