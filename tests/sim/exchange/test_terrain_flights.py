"""Flights over ground that is not flat: with its heights tracking is consistent, and without them it is off."""

import math
import re
import shutil

import numpy as np
import pytest
from scipy.stats import chi2

from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight
from sim.exchange.values import find_attitudes
from sim.facts.metrics.summary import summarise
from sim.world.terrain import Terrain
from tracking.detection.detection_errors import whole_covariances
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.surface import Surface
from tracking.geometry.visibility import Forest, Tree, at_target_height
from tracking.metrics.nees import nees_interval

N, CELL, ERROR = 81, 2.0, 0.5
X = CELL * (np.arange(N) - N // 2)  # m, of columns; of rows from north to south with the other sign
HEIGHTS = 500 + 0.25 * X - 0.1 * -X[:, None] + 2 * np.sin(X / 9) * np.cos(X[:, None] / 7)
FLAT = "geo.ground=500"
TIMES = 0.2 * np.arange(60)
CAMERA = Camera.calibrated(640, 480, (560.0, 560.0), (320.0, 240.0))


def ground(x, y):
    """Height of the ground between points of the grid, written out."""
    u, v = (x - X[0]) / CELL, (-X[0] - y) / CELL
    i, j = int(v), int(u)
    (a, b), (c, d) = HEIGHTS[i : i + 2, j : j + 2]
    return (a * (1 - (u - j)) + b * (u - j)) * (1 - (v - i)) + (c * (1 - (u - j)) + d * (u - j)) * (v - i)


def places(time):
    return [(-12 + 1.2 * time, 6.0), (4.0, 14 - 1.0 * time), (-4 - 0.5 * time, 4 + 0.8 * time)]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Two UAVs, one with a tilted camera, over three people; pixels err, and so does the ground."""
    folder, rng = tmp_path_factory.mktemp("flights") / "flight", np.random.default_rng(3)
    folder.mkdir()
    head = f"ncols {N}\nnrows {N}\nxllcenter {X[0]}\nyllcenter {X[0]}\ncellsize {CELL}\n"
    (folder / "dem.asc").write_text(head + "\n".join(" ".join(f"{h:.9f}" for h in row) for row in HEIGHTS))
    (folder / "cameras.csv").write_text(f"uav,hfov_deg,width_px,height_px\n{view(0)}\n{view(1)}\n")
    poses, found, truth = (
        ["time_s,uav,x_m,y_m,altitude_m,yaw_deg,pitch_deg"],
        ["time_s,uav,u_px,v_px"],
        ["time_s,id,x_m,y_m"],
    )
    for time in TIMES:
        for uav, (x, y, z, yaw, pitch) in enumerate([(time - 6, 6.0, 540.0, 20, -90), (0.0, time - 30, 545.0, 0, -55)]):
            poses.append(f"{time},{uav},{x},{y},{z},{yaw},{pitch}")
            found.append(f"{time},{uav},,")
            pose = Pose(np.array([x, y, z]), find_attitudes(np.array([[yaw, pitch, 0.0]]))[0])
            for place in places(time):
                height = ground(*place)
                lens = CAMERA.lens(Pose(pose.position - [0.0, 0.0, height], pose.quaternion))
                off = rng.multivariate_normal([0.0, 0.0], whole_covariances(lens, np.array([place]))[0])
                point = np.array([*place + off, height + rng.normal(0.0, ERROR) + 0.85])
                (pixel,), _ = CAMERA.project(pose, point[None])
                if (pixel >= 0).all() and (pixel <= CAMERA.size).all() and rng.random() < 0.95:
                    found.append(f"{time},{uav},{pixel[0]:.9f},{pixel[1]:.9f}")
        truth += [f"{time},{i},{x},{y}" for i, (x, y) in enumerate(places(time))]
    for name, rows in (("poses", poses), ("detections", found), ("truth", truth)):
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")
    return folder


def view(uav):
    return f"{uav},{2 * math.degrees(math.atan(320 / 560))!r},640,480"


def errors_of(flight):
    """Squared errors of measurements, in their own standard deviations, and in metres, to the nearest person."""
    own, metres = [], []
    for scans in flight.scans():
        for scan in scans:
            for z, R in zip(scan.measurements, scan.covariances, strict=True):
                off = z - min(places(scan.time), key=lambda place: math.dist(place, z))
                own.append(off @ np.linalg.inv(R) @ off)
                metres.append(math.hypot(*off))
    return np.array(own), np.array(metres)


def test_tracking_is_consistent_with_the_ground_and_off_without(flight, tmp_path):
    rough = read_flight(flight, overrides=["ground.file=dem.asc", f"ground.error={ERROR}"])
    assert any(f"{N} × {N} heights from" in remark for remark in rough.remarks)
    own, metres = errors_of(rough)
    low, high = nees_interval(len(own), 2)
    assert len(own) > 250 and low < own.mean() < high and (own > chi2.ppf(0.9999, 2)).sum() <= 1
    flat, off = errors_of(read_flight(flight, overrides=[FLAT]))
    assert flat.mean() > 20 and np.median(off) > 3 * np.median(metres)
    found, lost = (
        summarise(track_flight(one))["nees"]["position"] for one in (rough, read_flight(flight, overrides=[FLAT]))
    )
    assert 1.0 < found["mean"] < found["interval_95"][1] and found["errors"] > 150  # they walk straighter than assumed
    assert lost["mean"] > 100


def test_heights_above_the_ground_below_and_above_the_sea_are_one_flight(flight, tmp_path):
    folder = tmp_path / "flight"
    shutil.copytree(flight, folder)
    first, *rows = (flight / "poses.csv").read_text().split()
    rows = [row.split(",") for row in rows]
    for row in rows:
        row[4] = f"{float(row[4]) - ground(float(row[2]), float(row[3])):.9f}"
    (folder / "poses.csv").write_text("\n".join([first.replace("altitude_m", "z_m"), *map(",".join, rows)]))
    (folder / "scenario.toml").write_text('[ground]\nfile = "dem.asc"\n')
    above, sea = read_flight(folder), read_flight(flight, overrides=["ground.file=dem.asc"])
    np.testing.assert_allclose(above.poses, sea.poses, atol=1e-6)
    for own, other in zip(above.scans(), sea.scans(), strict=True):
        for one, two in zip(own, other, strict=True):
            np.testing.assert_allclose(one.measurements, two.measurements, atol=1e-6)
    assert above.setting.ground.file == ""  # a recording is of level ground, so that its exports are


@pytest.mark.parametrize("pitch", [-90.0, -60.0])
def test_a_level_pose_has_the_same_trees_in_line_and_places_in_the_image_up_to_a_share_of_it(pitch):
    """On a slope of 20 %, lines of sight are right up to what crowns, whose tops are level, rise across themselves.

    Pixels are off by up to 3 % of the image's width in the quadratic mean.
    """
    slope, rng = 0.2, np.random.default_rng(0)
    surface = Surface(slope * np.tile(X, (N, 1)), (N // 2, 1 / CELL, 0.0), (N // 2, 0.0, -1 / CELL))
    terrain = Terrain(None, surface, 0.3)
    pose = Pose(np.array([3.0, -4.0, 40 + slope * 3.0]), find_attitudes(np.array([[0.0, pitch, 0.0]]))[0])
    level = terrain.level(CAMERA, pose)
    pixels = rng.uniform((0, 0), CAMERA.size, (400, 2))
    people = terrain.find_places(CAMERA, pose, pixels)
    found, _ = CAMERA.project(level, at_target_height(people))
    assert math.sqrt(np.square(found - pixels).sum(axis=1).mean()) < 0.03 * 640
    trees = [Tree(*rng.uniform(-25, 25, 2), rng.uniform(0.5, 2.0), 3.0, 12.0) for _ in range(60)]
    clear = Forest(tuple(trees)).visible(level.position, at_target_height(people))[0]
    standing = np.array([(*row[:3], *(row[3:5] + slope * row[0])) for row in Forest(tuple(trees)).cylinders])
    for person, free in zip(people, clear, strict=True):
        point = np.array([*person, 0.85 + slope * person[0]])
        steps = pose.position + np.linspace(0, 1, 801)[:, None] * (point - pose.position)
        gaps = np.hypot(*(steps[:, None, :2] - standing[:, :2]).transpose(2, 0, 1)) - standing[:, 2]
        beyond = np.maximum(standing[:, 3] - steps[:, 2:], steps[:, 2:] - standing[:, 4])
        nearest = np.maximum(gaps, beyond).min()
        assert free == (nearest > 0) or abs(nearest) < 2.0 * slope
    assert 50 < clear.sum() < 350


def test_ground_that_does_not_cover_the_flight_or_lies_above_cameras_is_one_line(flight, call):
    corner = f"xllcenter {X[0]}"
    text = (flight / "dem.asc").read_text()
    (flight / "elsewhere.asc").write_text(text.replace(corner, "xllcenter 7000"))
    (flight / "feet.asc").write_text(f"ncols 2\nnrows 2\n{corner}\nyllcenter {X[0]}\ncellsize 160\n" + 4 * "1640 ")
    for name, told in (
        (
            "elsewhere",
            "does not cover the flight: it reaches from 7000, -80 to 7160, 80, and UAV 0 is at -6, 6; give a",
        ),
        ("feet", "poses: UAV 0, column z_m: is -1100 m in the median; .* above people; is ground.file in metres above"),
    ):
        code, _, error = call("track", str(flight), "--set", f"ground.file={name}.asc", "--no-video")
        assert code == 2 and re.search(told, " ".join(error.split())), error
    code, _, error = call("run", "--set", "ground.file=dem.asc")
    assert code == 2 and "ground.file: is for flights that `understory track` reads" in error
