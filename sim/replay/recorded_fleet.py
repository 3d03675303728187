"""The UAVs of a recording, nearly as planners knew them."""

import numpy as np

from planning.planner import Vehicle
from sim.mission.tracker_setup import tracker_parameters
from sim.recording.recording import Recording
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import vehicle_of
from tracking.filter.motion import MotionModel


def vehicles_at(recording: Recording, scenario: Scenario, k: int) -> list[Vehicle]:
    """All UAVs at scan k, by id.

    Note: velocities are means since the scan before, as recordings hold none; at the first they are zero.
    """
    moved = recording.poses[k, :, :2] - recording.poses[max(k - 1, 0), :, :2]
    bodies = zip(recording.poses_at(k), moved * scenario.rates.sensing, strict=True)
    return [vehicle_of(i, body, velocity, scenario) for i, (body, velocity) in enumerate(bodies)]


def motion_at(recording: Recording, scenario: Scenario, k: int, uav: int) -> MotionModel:
    """Motion model of one UAV's tracker after scan k, with what it had seen of people's speeds until then."""
    scans, uavs = recording.cells(recording.track_offsets)
    seen = (uavs == uav) & (scans <= k) & (recording.track_sightings[:, 2] >= recording.times[scans])
    motion, velocities = tracker_parameters(scenario).motion, recording.track_means[seen, 2:]
    for of_one_scan in np.split(velocities, np.flatnonzero(np.diff(scans[seen])) + 1):
        motion = motion.observed(of_one_scan)
    return motion
