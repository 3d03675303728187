"""A study in Python: two planners on the same maps, with and without messages, by an executor of your own.

Writes `network.toml`, prints the means of each cell and paired differences, and keeps the trials in `runs`.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import understory

STUDY = """
[study]
planners = ["greedy", "hover"]
seeds = "0-3"

[set]
duration = 5
sensing.mode = "ideal"

[factors.network]
whole = {}
none = { network.loss = 1.0 }
"""

Path("network.toml").write_text(STUDY)
with ThreadPoolExecutor(1) as executor:  # or MPI's, or a dask client's; without one, processes of this machine
    trials = understory.fly_study("network.toml", "runs", executor=executor)
    again = understory.fly_study("network.toml", "runs", executor=executor)  # finds all trials, and flies none
assert (again["recording"] == trials["recording"]).all()
print(trials.groupby(["factor.network", "planner"])["gospa.mean_m"].mean().round(2))
maps = trials.pivot(index=["factor.network", "seed"], columns="planner", values="gospa.mean_m")
print("hover less greedy, map by map [m]:", (maps["hover"] - maps["greedy"]).round(2).tolist())
