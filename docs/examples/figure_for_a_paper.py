"""A figure for a paper: OSPA over time of two planners, the mean and the range over several maps.

Draws `figure.pdf`, and prints the shares of scans below 1 m.
"""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import understory

SEEDS, SETTINGS = range(3), {"duration": 20, "sensing.mode": "ideal"}
figure, axes = plt.subplots(figsize=(3.5, 2.2), layout="constrained")
for planner, colour in (("sma-nbo-gospa", "tab:blue"), ("hover", "tab:orange")):
    flights = [understory.run("forest", planner, seed=seed, settings=SETTINGS) for seed in SEEDS]
    errors = np.array([flight.recording.ospa[..., 0].mean(axis=1) for flight in flights])  # m, mean of the UAVs
    times = flights[0].recording.times
    axes.plot(times, errors.mean(axis=0), color=colour, label=planner)
    axes.fill_between(times, errors.min(axis=0), errors.max(axis=0), color=colour, alpha=0.2, linewidth=0)
    print(f"{planner}: {100 * (errors < 1).mean():.1f} % of the scans below 1 m")
axes.set(xlabel="time [s]", ylabel="OSPA [m]", yscale="log")
axes.legend(frameon=False, fontsize="small")
figure.savefig("figure.pdf")
