"""A metric of your own: how far a UAV flew, beside GOSPA at the end of the mission by a public function.

Prints both for two planners; `understory compare --metric own_metric:DISTANCE` has it in its tables.
"""

import numpy as np

import understory


def measure_distance(outcome):
    """Mean length [m] of the ways that the UAVs of a mission flew."""
    steps = np.diff(outcome.recording.poses[:, :, :3], axis=0)
    return np.linalg.norm(steps, axis=2).sum(axis=0).mean()


DISTANCE = understory.Metric("distance flown by a UAV", measure_distance, unit="m", better="neither")

if __name__ == "__main__":
    for planner in ("greedy", "hover"):
        flight = understory.run("forest", planner, seed=1, settings={"duration": 30, "sensing.mode": "ideal"})
        tracks, people = flight.columns("tracks"), flight.recording.people[-1]
        last = (tracks["uav"] == 0) & (tracks["time_s"] == tracks["time_s"].max())
        error = understory.gospa(np.column_stack([tracks["x_m"], tracks["y_m"]])[last], people)
        flown = DISTANCE(understory.Outcome(flight.recording))
        print(f"{planner}: {DISTANCE.with_unit(flown)} flown, GOSPA of UAV 0 at the end {error.distance:.2f} m")
