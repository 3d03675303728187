"""A lens that bends images: one flight with a camera that the fleet knows, and one whose distortion it does not know.

Prints how far measurements are off in each, and draws a frame through the lens into `bent.png`.
"""

import numpy as np

import understory

CAMERA = {"width": 160, "height": 120, "hfov_deg": 60, "distortion": [-0.25, 0.05]}  # k1, k2 as in OpenCV
SETTINGS = {"duration": 5, "sensing.noise": "camera", "trees.density": 10}  # no noise but the detector's own

for name, believed in (("known", {}), ("unknown", {"believed": {"distortion": []}})):
    uavs = [{"start": start, "footprint": 25, "camera": {**CAMERA, **believed}} for start in ([-38, 0], [-30, 5])]
    flight = understory.run("forest", "greedy", seed=1, settings={**SETTINGS, "uavs": uavs})
    found, people = flight.columns("measurements"), flight.recording.people
    scans = np.searchsorted(flight.recording.times, found["time_s"] - 1e-6)
    gaps = np.stack([found["x_m"], found["y_m"]], axis=1)[:, None] - people[scans]
    errors = np.nanmin(np.linalg.norm(gaps, axis=2), axis=1)
    print(f"distortion {name}: measurements are {np.median(errors):.2f} m off in the median; {flight}")
    if name == "known":
        flight.frame_figure(2.0, uav=0).savefig("bent.png")
