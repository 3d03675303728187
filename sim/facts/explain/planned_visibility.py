"""Visibility of a person and of a track on the rest of a UAV's plan."""

from dataclasses import dataclass, replace

import numpy as np

from sim.facts.planned_path import make_vehicle, predict_path
from sim.facts.tracking_replay import replay_tracking
from sim.mission.recording import Recording
from sim.mission.tracker_setup import make_planned_motion
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array, Indices

OUT_OF_VIEW, HIDDEN, IN_VIEW = 0, 1, 2  # states of a place in a camera


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
    flown = recording.flown_at(k)
    if flown is None or not recording.working[k, uav]:
        return None
    body, places = recording.believed_bodies[k, uav], recording.poses[:, uav, :2]
    vehicle = make_vehicle(scenario, uav, Pose(body[:3], body[3:]), places[k], places[max(k - 1, 0)])
    path = predict_path(scenario, vehicle, flown, now)[1:]
    if len(path) == 0:
        return None
    times = now + np.arange(1, len(path) + 1) / rate
    views = [Pose(np.append(place, vehicle.position[2]), vehicle.attitude) for place in path]
    known = recording.people[k + 1 : k + 1 + len(times), person]
    ahead = np.full(len(times), -1)
    ahead[: len(known)] = _find_view_states(recording, k, uav, views, known)
    track = None
    if belief is not None:
        scan = replace(make_planned_motion(scenario, replay_tracking(recording).motion(k, uav)), dt=1 / rate, scans=1)
        nominal = scan.positions_ahead(belief.mean[None], belief.covariance[None], len(times))
        track = _find_view_states(recording, k, uav, views, nominal[:, 0])
    return PlannedVisibility(flown.made, times, path, ahead, track)


def _find_view_states(recording: Recording, k: int, uav: int, views: list[Pose], places: Array) -> Indices:
    """States (S,) of places (S, 2) m at S or more poses of a camera, as believed at scan k; `OUT_OF_VIEW` for NaN."""
    setting = recording.setting
    trees = recording.believed_at(k, uav)
    camera = setting.believed_camera(uav)
    found = np.full(len(places), OUT_OF_VIEW)
    for s, (pose, place) in enumerate(zip(views, places, strict=False)):
        point = at_target_height(place[None])
        if np.isfinite(place).all() and camera.sees(pose, point)[0]:
            found[s] = IN_VIEW if trees.visible(pose.position, point)[0, 0] else HIDDEN
    return found
