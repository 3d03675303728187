"""Why somebody was lost: the worst loss of a mission, which tree hid the person from which UAV, and pictures of it.

Draws `timeline.png`, and what a camera saw when the loss began into `loss.png`.
"""

import numpy as np

import understory

flight = understory.run("forest", "greedy", seed=10, settings={"duration": 6, "trees.density": 75})
losses, sightings = flight.columns("losses"), flight.columns("sightings")
worst = int(np.argmax(losses["until_s"] - losses["from_s"]))
person, begin, end = (losses[name][worst] for name in ("person", "from_s", "until_s"))
print(f"person {person} was lost from {begin:.1f} to {end:.1f} s")
during = (sightings["person"] == person) & (sightings["time_s"] >= begin) & (sightings["time_s"] < end)
for uav in np.unique(sightings["uav"][during]):
    own = during & (sightings["uav"] == uav) & sightings["inside"]
    trees, scans = np.unique(sightings["hidden_by_tree"][own], return_counts=True)
    hidden = {f"tree {tree}": int(count) for tree, count in zip(trees, scans, strict=True) if tree >= 0}
    print(f"UAV {uav}: {own.sum()} scans with the person inside the image; hidden by {hidden or 'nothing'}")
for text in flight.columns("events")["text"]:
    print(text)
flight.timeline_figure().savefig("timeline.png")
flight.frame_figure(begin, uav=1).savefig("loss.png")
