"""The area of a flight has all that its cameras, trees and people reach; what is outside a given one is said."""

import math

import numpy as np
import pytest

from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight

LARGE = ("area.width=400", "area.height=400")
# Pitch and yaw of a camera with an angle of view of 60 degrees, 20 m above the origin; the area that it reaches.
VIEWS = {
    "down": ((-90, 0), (40, 40)),
    "ahead": ((-60, 90), (80, 40)),  # 20 m * tan 60 = 34.6 m to the east, and 20 m to the side
    "behind": ((-60, 270), (80, 40)),
    "to the horizon": ((-30, 0), (180, 360)),  # ten heights along the rays of the upper corners
    "level": ((0, 90), (360, 200)),
}


def write(folder, **files):
    for name, lines in files.items():
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


def hover(folder, pitch=-90, yaw=0, **files):
    """A camera that hovers 20 m above the origin, and sees somebody there."""
    seen = ["time_s,x_m,y_m", *(f"{k / 5},0,0.5" for k in range(50))]
    poses = [f"time_s,x_m,y_m,z_m,pitch_deg,yaw_deg\n0,0,0,20,{pitch},{yaw}"]
    return write(folder, **{"poses": poses, "detections": seen, "cameras": ["fov_deg,pixels", "60,128"], **files})


@pytest.mark.parametrize("view", VIEWS)
def test_the_area_has_what_cameras_reach(tmp_path, view):
    (pitch, yaw), (width, height) = VIEWS[view]
    log = read_flight(hover(tmp_path, pitch, yaw))
    assert (log.setting.area.width, log.setting.area.height) == (width, height)
    assert f"area: {width} × {height} m was chosen, with all that cameras and trees reach" in log.remarks


def test_the_area_has_trees_and_people_beyond_the_views(tmp_path):
    truth = ["time_s,id,x_m,y_m", "0,a,0,-61", "9,a,0,0", "20,a,300,0"]  # after the flight, people do not count
    log = read_flight(hover(tmp_path, trees=["x,y", "-72,0"], truth=truth))
    assert (log.setting.area.width, log.setting.area.height) == (180, 140)
    assert any("cameras, trees and people reach" in remark for remark in log.remarks)


def leave(folder):
    """Two cameras that follow people, who walk 60 m to the east and west; one walks out of sight, too."""
    times = np.arange(0, 40.1, 0.2).round(1).tolist()
    east, west = ([(1.5 * t * side, 3.0 * side) for t in times] for side in (1, -1))
    poses = ["time_s,uav,x_m,y_m,z_m", *(f"{t},{i},{1.2 * t * (1 - 2 * i)},0,25" for t in times for i in (0, 1))]
    seen, truth = ["time_s,uav,x_m,y_m,xx_m2,xy_m2,yy_m2"], ["time_s,id,x_m,y_m"]
    for k, t in enumerate(times):
        for i, (x, y) in enumerate((east[k], west[k])):
            seen.append(f"{t},{i},{x},{y},0.01,0,0.01")
            truth.append(f"{t},{'ab'[i]},{x},{y}")
        truth.append(f"{t},c,0,{-2 * t}")
    return write(
        folder, poses=poses, detections=seen, truth=truth, cameras=["uav,fov_deg,pixels", "0,60,128", "1,60,128"]
    )


def measure(folder, *overrides):
    log = read_flight(folder, overrides=overrides)
    score = track_flight(log).scores[0]
    return log, score.present.sum(), score.held.sum()


def test_people_who_walk_out_of_view_are_there_and_held_as_in_a_large_area(tmp_path):
    own, large = measure(leave(tmp_path)), measure(tmp_path, *LARGE)
    assert own[1:] == large[1:] and own[1] == 3 * 201 and own[2] > 0.6 * own[1]
    assert (own[0].setting.area.width, own[0].setting.area.height) == (140, 160)
    assert not any("area" in remark for remark in large[0].remarks)


def test_what_is_outside_a_given_area_is_said(tmp_path):
    write(leave(tmp_path), trees=["x,y", "0,30", "0,5", "30,0"])
    log, present, _ = measure(tmp_path, "area.width=40", "area.height=60")
    # Two people walk 20 m in 13.4 s, and the third 30 m in 15 s.
    assert present == 2 * 67 + 76
    (remark,) = [text for text in log.remarks if text.startswith("area: ")]
    assert remark.startswith(
        "area: 40 × 60 m, as given; outside are 3 of 3 people for 78.4 s in all, who count as gone"
    )
    assert remark.endswith(", and 1 of 3 trees, and UAVs 0 and 1 at times")
    assert math.isclose(3 * 40 - 2 * 13.33 - 15, 78.4, abs_tol=0.1)
