"""The UAVs of a recording, and the map of trees."""

from functools import lru_cache

from planning.planner import Vehicle
from sim.mission.recording import Recording
from sim.sensing.cameras import vehicle_of
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest


@lru_cache(maxsize=1)  # with its grid
def make_known_forest(recording: Recording) -> Forest:
    """The map of trees with the occlusion that trackers and planners assumed."""
    return Forest(recording.forest.trees, recording.setting.sensing.occlusion)


def make_vehicles(recording: Recording, k: int) -> list[Vehicle]:
    """All UAVs at scan k, by id, where they believe they are.

    Note: velocities are means since the previous scan, because recordings have none; at the first scan they are zero.
    """
    setting = recording.setting
    moved = recording.poses[k, :, :2] - recording.poses[max(k - 1, 0), :, :2]
    places = recording.believed_cameras[k, :, :3]  # a camera is where its UAV is
    known = [Pose(place, pose.quaternion) for place, pose in zip(places, recording.poses_at(k), strict=True)]
    bodies = zip(known, moved * setting.rates.sensing, strict=True)
    return [vehicle_of(i, body, velocity, setting) for i, (body, velocity) in enumerate(bodies)]
