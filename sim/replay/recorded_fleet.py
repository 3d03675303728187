"""The UAVs of a recording as planners knew them."""

import numpy as np

from planning.planner import Vehicle
from sim.recording.recording import Recording
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import vehicle_of
from tracking.geometry.camera import Pose


def vehicles_at(recording: Recording, scenario: Scenario, k: int) -> list[Vehicle]:
    """All UAVs at scan k, by id.

    Note: velocities are means over the scan before, as recordings hold none.
    """
    places = recording.poses[max(k - 1, 0) : k + 1, :, :2]
    velocities = np.zeros_like(places[0]) if k == 0 else np.diff(places, axis=0)[0] * scenario.rates.sensing
    bodies = [Pose(row[:3], row[3:]) for row in recording.poses[k]]
    return [vehicle_of(i, body, velocities[i], scenario) for i, body in enumerate(bodies)]
