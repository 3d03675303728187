"""A mission flown scan by scan: your own velocities first, then a planner's, and a copy that tries another future.

Prints the errors of both futures, and writes the mission to `flown.npz`, which all commands read.
"""

import copy

import numpy as np

import understory

settings = {"duration": 8, "sensing.mode": "ideal", "dynamics": "kinematic"}
mission = understory.mission("forest", "greedy", seed=3, settings=settings)
snapshots = []
while mission.time < 4.0:
    eastward = [[2.0, 0.0] for situation in mission.team]  # m/s; empty between decisions
    snapshots.append(mission.step(eastward))

hovering = copy.deepcopy(mission)  # goes on as the original would, to the last bit
while not mission.over:
    snapshots.append(mission.step())  # asks the planner
    held = hovering.step(np.zeros((len(hovering.team), 2)))
print(f"OSPA at the end: {snapshots[-1].error:.2f} m with greedy, {held.error:.2f} m if the UAVs hover")
flight = understory.record(mission, snapshots, "eastward, then greedy")
flight.save("flown.npz")
print(flight)
