"""A forest that nobody has mapped: trees from the frames of a UAV's camera by parallax.

Writes them as a stem map, `mapped.csv`, and draws them over the true ones into `mapped.png`.
"""

import math

import matplotlib.pyplot as plt

import understory

flight = understory.run("forest", seed=4, settings={"duration": 40})
mapped = understory.map_trees(flight, uav=1, out="mapped.csv")
true = flight.columns("trees")
places = list(zip(true["x_m"], true["y_m"], true["canopy_radius_m"], strict=True))
figure, axes = plt.subplots(figsize=(8, 5))
for x, y, radius in places:
    axes.add_patch(plt.Circle((x, y), radius, color="0.85"))
for found in mapped:
    tree, error = found.tree, math.sqrt(found.covariance[0, 0] + found.covariance[1, 1])
    axes.add_patch(plt.Circle((tree.x, tree.y), tree.canopy_radius, fill=False, color="tab:green"))
    axes.annotate(f"{error:.1f} m", (tree.x, tree.y), ha="center", va="center")
    x, y, radius = min(places, key=lambda place: math.dist(place[:2], (tree.x, tree.y)))
    off = math.dist((x, y), (tree.x, tree.y))
    print(f"crown of {tree.canopy_radius:.1f} m, {tree.canopy_top:.1f} m high: {off:.2f} m off, seen {found.rim:.0%}")
path = flight.recording.cameras[:, 1]
axes.plot(path[:, 0], path[:, 1], color="tab:blue")
axes.set(xlim=(-50, 50), ylim=(-32, 32), aspect="equal", xlabel="east [m]", ylabel="north [m]")
figure.savefig("mapped.png", dpi=100, bbox_inches="tight")
