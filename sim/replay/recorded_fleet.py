"""The UAVs of a recording and the map of trees, approximately as planners knew them."""

from functools import lru_cache
from itertools import pairwise

from planning.planner import Vehicle
from sim.mission.tracker_setup import tracker_parameters
from sim.recording.recording import Recording
from sim.sensing.cameras import vehicle_of
from tracking.filter.motion import MotionModel
from tracking.geometry.visibility import Forest


@lru_cache(maxsize=1)  # with its grid
def known_forest(recording: Recording) -> Forest:
    """The map of trees with the occlusion that trackers and planners assumed."""
    return Forest(recording.forest.trees, recording.setting.sensing.occlusion)


def vehicles_at(recording: Recording, k: int) -> list[Vehicle]:
    """All UAVs at scan k, by id.

    Note: velocities are means since the previous scan, because recordings have none; at the first scan they are zero.
    """
    setting = recording.setting
    moved = recording.poses[k, :, :2] - recording.poses[max(k - 1, 0), :, :2]
    bodies = zip(recording.poses_at(k), moved * setting.rates.sensing, strict=True)
    return [vehicle_of(i, body, velocity, setting) for i, (body, velocity) in enumerate(bodies)]


def motion_at(recording: Recording, k: int, uav: int) -> MotionModel:
    """Motion model of one UAV's tracker after scan k, with the speeds of people that it had learned until then."""
    return _motions(recording)[k][uav]


@lru_cache(maxsize=1)  # because callers ask about all scans of one mission
def _motions(recording: Recording) -> list[list[MotionModel]]:
    """Motion model of each UAV's tracker after each scan."""
    uavs, (k, _) = recording.poses.shape[1], recording.cells(recording.track_offsets)
    detected = recording.track_sightings[:, 2] >= recording.times[k]
    motions = [[tracker_parameters(recording.setting).motion] * uavs]
    for cell, (first, last) in enumerate(pairwise(recording.track_offsets.tolist())):
        if cell % uavs == 0:
            motions.append(motions[-1].copy())
        velocities = recording.track_means[first:last, 2:][detected[first:last]]
        if len(velocities):
            motions[-1][cell % uavs] = motions[-1][cell % uavs].observed(velocities)
    return motions[1:]
