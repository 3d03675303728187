"""A flight from elsewhere: poses, cameras and detections as tables, through the testbed's tracker.

Writes the tables of a UAV that hovers over two people into `flight`, and prints the tracks at the end.
"""

from pathlib import Path

import numpy as np

import understory

rng, folder = np.random.default_rng(0), Path("flight")
folder.mkdir()
times = 0.2 * np.arange(60)
poses = [f"{time:.1f},0,0,0,25,0,-90,0" for time in times]  # straight down, north up
(folder / "poses.csv").write_text("\n".join(["time_s,uav,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg", *poses]))
(folder / "cameras.csv").write_text("uav,fov_deg,pixels\n0,60,640\n")
rows = ["time_s,uav,x_m,y_m,xx_m2,xy_m2,yy_m2"]
for time in times:
    rows.append(f"{time:.1f},0,,,,,")  # a frame, whether or not it shows anybody
    for place in ([-8 + 1.2 * time, 3.0], [2.0, 9.0 - 1.0 * time]):
        if rng.random() < 0.9:
            x, y = place + rng.normal(0.0, 0.2, 2)
            rows.append(f"{time:.1f},0,{x:.3f},{y:.3f},0.04,0,0.04")
(folder / "detections.csv").write_text("\n".join(rows))

flight = understory.track(folder)
tracks = flight.columns("tracks")
for row in np.flatnonzero(tracks["time_s"] == tracks["time_s"].max()):
    x, y, vx, vy = (tracks[name][row] for name in ("x_m", "y_m", "vx_m_per_s", "vy_m_per_s"))
    print(f"track {tracks['track'][row]} at ({x:.2f}, {y:.2f}) m walks ({vx:.2f}, {vy:.2f}) m/s")
print(flight)
