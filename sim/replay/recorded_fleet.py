"""The UAVs of a recording, nearly as planners knew them."""

from planning.planner import Vehicle
from sim.recording.recording import Recording
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import vehicle_of


def vehicles_at(recording: Recording, scenario: Scenario, k: int) -> list[Vehicle]:
    """All UAVs at scan k, by id.

    Note: velocities are means since the scan before, as recordings hold none; at the first they are zero.
    """
    moved = recording.poses[k, :, :2] - recording.poses[max(k - 1, 0), :, :2]
    bodies = zip(recording.poses_at(k), moved * scenario.rates.sensing, strict=True)
    return [vehicle_of(i, body, velocity, scenario) for i, (body, velocity) in enumerate(bodies)]
