"""Bags of ROS 2 as flights: frames of tf, cameras, detections, and what a bag must not lack."""

import math
import re
import shutil
from itertools import combinations, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("rosbags")
from sim.exchange import ros_bag
from sim.exchange.ros_bag import CAMERA, IN_IMAGE, LABELS, ODOMETRY, ON_GROUND, TRANSFORMS, RosBag, Topic
from sim.exchange.scanned_flight import read_flight
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.quaternions import rotation

FOCAL = 540 / math.tan(math.radians(20))  # pixels, of 1080 over 40 degrees
TIMES = np.arange(0, 2, 0.2).tolist()
DOWN = (1.0, 0.0, 0.0, 0.0)  # attitude of the optical frame of a camera that looks straight down, north up


def stamped(time, frame):
    return divmod(round(time * 1e9), 10**9), frame


def transform(time, row, child, parent):
    return ([(stamped(time, parent), child, (row[:3], row[3:]))],)


def odometry(time, row, child, parent="map"):
    return {"header": stamped(time, parent), "child_frame_id": child, "pose": {"pose": (row[:3], row[3:])}}


def camera_info(frame, width, height, distortion=(), **more):
    k = np.array([FOCAL, 0, (width - 1) / 2, 0, FOCAL, (height - 1) / 2, 0, 0, 1.0])
    return {"header": stamped(0.0, frame), "width": width, "height": height, "k": k, "d": np.array(distortion), **more}


@pytest.mark.parametrize("bend", [(), (-0.2, 0.05, 0.001, -0.002, 0.01)])
def test_a_chain_of_frames_puts_the_camera_where_tf_says(tmp_path, bend):
    turned, mounted = Rotation.from_euler("zyx", [0.7, 0.1, -0.2]), Rotation.from_euler("xyz", [0.3, -0.5, 0.2])
    optical = mounted * Rotation.from_quat(DOWN)
    with RosBag(tmp_path / "bag") as bag:
        bag.write(Topic("/drone/camera_info", CAMERA), 0.0, camera_info("drone/optical", 1920, 1080, bend))
        link = transform(0.0, [0.2, 0.0, -0.1, *optical.as_quat().tolist()], "drone/optical", "drone/base_link")
        bag.write(Topic("/tf_static", TRANSFORMS), 0.0, link)
        for time in TIMES:
            bag.write(
                Topic("/tf", TRANSFORMS), time, transform(time, [100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 1.0], "odom", "map")
            )
            row = [3.0 * time, -time, 30.0, *turned.as_quat().tolist()]
            bag.write(Topic("/drone/odom", ODOMETRY), time, odometry(time, row, "drone/base_link", "odom"))
        eye = np.array([100.0, 50.0, 30.0]) + turned.apply([0.2, 0.0, -0.1])
        camera = Camera.calibrated(1920, 1080, (FOCAL, FOCAL), (960.0, 540.0), bend)
        pose = Pose(eye, (turned * mounted).as_quat())
        places = camera.ground_points(pose, np.array([[920.0, 600.0], [1800.0, 200.0]]), TARGET_HEIGHT)
        for k, time in enumerate(TIMES):
            pixels = [(920.0, 600.0), (1800.0, 200.0)] if k == 0 else []
            head = stamped(time, "drone/optical")
            boxes = [{"header": head, "bbox": ((pixel, 0.0), 9.0, 9.0)} for pixel in pixels]
            bag.write(Topic("/drone/detections", IN_IMAGE), time, (head, boxes))
    log = read_flight(tmp_path)
    np.testing.assert_allclose(rotation(log.poses[0, 0, 3:]), rotation(pose.quaternion), atol=1e-9)
    np.testing.assert_allclose(log.poses[0, 0, :3], eye, atol=1e-9)
    np.testing.assert_allclose(log.poses[5, 0, :2], eye[:2] + np.array([3, -1]), atol=1e-9)
    np.testing.assert_allclose(log.observed[0, 0].scan.measurements, places, atol=1e-6)
    assert log.frames.sum() == len(TIMES) and log.setting.uavs[0].true_camera == camera


def boxes(time, frame, *pixels, results=()):
    found = [{"bbox": ((pixel, 0.0), 9.0, 9.0), "results": [*results]} for pixel in pixels]
    return stamped(time, frame), found


def write(path, said):
    """Write a bag of topics by name, each with its type and its messages by time."""
    with RosBag(path) as bag:
        for time, name in sorted((time, name) for name, (_, messages) in said.items() for time in messages):
            bag.write(Topic(name, said[name][0]), time, said[name][1][time])
    return path


def fly_alone(*, odometry=TIMES, base=TIMES, late=0.0, frames=TIMES, pixel=(500.0, 600.0), info=None):
    """Topics of a drone without a namespace that moves by 3 m/s in a frame that moves by 1 m/s; late: its clock [s]."""
    told = {t: transform(t, [float(t), 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], "odom", "map") for t in base}
    moved = {t: odometry_of(t + late, [3.0 * t, 0.0, 30.0, *DOWN]) for t in odometry}
    return {
        "/tf": (TRANSFORMS, told),
        "/mavros/local_position/odom": (ODOMETRY, moved),
        "/camera/camera_info": (CAMERA, {t: info or camera_info("optical", 1920, 1080) for t in odometry[:1]}),
        "/detections": (IN_IMAGE, {t: boxes(t, "optical", pixel) for t in frames}),
    }


def odometry_of(time, row, child="optical"):
    return odometry(time, row, child, "odom")


LONG = np.arange(0, 12, 0.5).tolist()
EARLY = LONG[:12]  # until 5.5 s
LINKS = {
    "another clock": (
        {"late": 1e9},
        "'optical' in 'odom' from 1000000000 to 1000000011.5 s, 'odom' in 'map' from 0 to",
    ),
    "a link that ends early": ({"base": EARLY}, "has a frame at 11.5 s, but no pose within 2 s; poses are 'optical'"),
    "odometry that ends early": ({"odometry": EARLY}, "has a frame at 11.5 s, but no pose within 2 s"),
    "a link that begins late": ({"base": LONG[12:]}, "has a frame at 0 s, but no pose within 2 s"),
    "a link with a gap": ({"base": [*LONG[:4], *LONG[-4:]]}, "but no pose within 2 s"),
}


@pytest.mark.parametrize(("options", "complaint"), LINKS.values(), ids=LINKS)
def test_each_link_of_tf_has_poses_near_each_frame(tmp_path, options, complaint):
    topics = fly_alone(**{"odometry": LONG, "base": LONG, "frames": LONG, **options})
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(write(tmp_path / "bag", topics))
    assert "\n" not in str(told.value) and "of one clock?" in str(told.value)


@pytest.mark.parametrize("span", [slice(0, 5), slice(3, 10), slice(2, 7)])
@pytest.mark.parametrize("link", ["odometry", "base"])
def test_frames_beyond_a_link_are_left_out_with_a_remark(tmp_path, span, link):
    log = read_flight(write(tmp_path / "bag", fly_alone(**{link: TIMES[span]})))
    whole = read_flight(write(tmp_path / "whole", fly_alone()))
    kept = len(TIMES[span])
    assert int(log.frames.sum()) == kept
    assert sum(f"left out: {len(TIMES) - kept} frames before or after poses, which are" in r for r in log.remarks) == 1
    for one, other in zip(log.scans(), list(whole.scans())[span], strict=True):
        np.testing.assert_allclose(one[0].measurements, other[0].measurements, atol=1e-9)


def mount(child, parent):
    """A transform that stays what it is."""
    return TRANSFORMS, {0.0: transform(0.0, [0.2, 0.0, -0.1, *DOWN], child, parent)}


APART = {  # frame of odometry, how far it flies, topics, and the frame that has no link to it
    "no tf": ("base_link", 3.0, {}, "optical"),
    "no tf of a hover": ("base_link", 0.0, {}, "optical"),
    "no name": ("", 3.0, {}, "optical"),
    "a prefix": ("drone/base_link", 3.0, {"/tf_static": mount("optical", "base_link")}, "base_link"),
    "a mount alone": ("base_link", 3.0, {"/tf_static": mount("optical", "gimbal")}, "gimbal"),
}


@pytest.mark.parametrize("name", APART)
def test_odometry_of_a_body_without_a_link_to_the_camera_is_refused_with_the_cure(tmp_path, name):
    body, speed, more, top = APART[name]
    topics = fly_alone() | more
    moved = {t: odometry_of(t, [speed * t, 0.0, 30.0, *DOWN], body) for t in TIMES}
    topics["/mavros/local_position/odom"] = (ODOMETRY, moved)
    said = f"/mavros/local_position/odom has poses of {body!r}, to which no tf links {top!r}, which is of the camera; "
    with pytest.raises(InputError, match=re.escape(f"{said}record /tf_static, too, or give poses of the camera")):
        read_flight(write(tmp_path / "bag", topics))
    (tmp_path / "poses.csv").write_text("\n".join(["time_s,x_m,y_m,z_m", *(f"{t},{4 * t},0,30" for t in TIMES)]))
    np.testing.assert_allclose(read_flight(tmp_path).poses[:, 0, 0], 4 * np.array(TIMES))


def test_a_camera_that_tf_places_needs_no_odometry(tmp_path):
    """As of a gimbal that keeps still in the world while its body sways."""
    topics = fly_alone()
    moved = {t: odometry_of(t, [0.04 * t, 0.0, 30.0, *DOWN], "base_link") for t in TIMES}
    topics["/mavros/local_position/odom"] = (ODOMETRY, moved)
    topics["/tf"] = (TRANSFORMS, {t: transform(t, [9.0, 0.0, 30.0, *DOWN], "optical", "map") for t in TIMES})
    assert (read_flight(write(tmp_path / "bag", topics)).poses[:, 0, 0] == 9).all()


def test_frames_of_several_uavs_beyond_their_links_are_told_once(tmp_path):
    topics = {name + topic: told for name in ("/a", "/b", "/c") for topic, told in fly_alone(base=TIMES[2:]).items()}
    (line,) = [line for line in read_flight(write(tmp_path / "bag", topics)).remarks if "left out" in line]
    assert "/a: left out: 2 frames before or after poses, which are" in line and "(UAVs 1 and 2 likewise)" in line


@pytest.mark.parametrize("kept", [slice(0, 1), slice(4, 6)])
def test_a_link_that_stays_what_it_is_holds_at_all_times(tmp_path, kept):
    still = fly_alone()
    still["/tf"] = (
        TRANSFORMS,
        {t: transform(t, [9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], "odom", "map") for t in TIMES[kept]},
    )
    log = read_flight(write(tmp_path / "bag", still))
    np.testing.assert_allclose(log.poses[:, 0, 0], 9 + 3 * np.array(TIMES))
    still["/mavros/local_position/odom"] = (ODOMETRY, {0.4: odometry_of(0.4, [1.0, 0.0, 30.0, *DOWN])})
    log = read_flight(write(tmp_path / "still", still))
    assert log.frames.all() and (log.poses[:, 0, 0] == 10).all()


def test_frames_of_tf_that_contradict_each_other_are_told(tmp_path):
    two = fly_alone()
    two["/vio/odom"] = (ODOMETRY, {t + 0.1: odometry_of(t + 0.1, [50.0, 0.0, 30.0, *DOWN]) for t in TIMES})
    log = read_flight(write(tmp_path / "two", two))
    np.testing.assert_allclose(log.poses[:, 0, 0], 4 * np.array(TIMES))
    there = "/mavros/local_position/odom has poses of 'optical'; those of /vio/odom are not used"
    assert any(there in remark for remark in log.remarks)
    two["/tf"][1][0.3] = transform(0.3, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], "odom", "earth")
    with pytest.raises(InputError, match="the frame 'odom' is in 'map' and in 'earth'; expected one"):
        read_flight(write(tmp_path / "parents", two))
    two["/tf"][1][0.3] = transform(0.3, [0.0] * 7, "odom", "map")
    with pytest.raises(InputError, match="/tf: the norm of a quaternion of 'odom' is 0; expected 1"):
        read_flight(write(tmp_path / "zero", two))


def test_uavs_whose_frames_have_the_same_names_are_told_apart_by_their_topics(tmp_path):
    topics = {}
    for i, name in enumerate(("/uav0", "/uav1")):
        for topic, (kind, messages) in fly_alone().items():
            if kind == TRANSFORMS:
                messages = {t: transform(t, [9.0 * i, t, 0.0, 0.0, 0.0, 0.0, 1.0], "odom", "map") for t in TIMES}
            topics[name + topic] = (kind, messages)
    log = read_flight(write(tmp_path / "bag", topics))
    np.testing.assert_allclose(log.poses[:, 1, :2], log.poses[:, 0, :2] + np.array([9.0, 0.0]))


def square(x, y, width, height):
    return {"x_offset": x, "y_offset": y, "width": width, "height": height}


REDUCED = {
    "binned": {"binning_x": 2, "binning_y": 2},
    "binned by unlike numbers": {"binning_x": 4, "binning_y": 3},
    "binned along one edge": {"binning_y": 2},
    "a window": {"roi": square(400, 300, 1280, 720)},
    "a binned window": {"roi": square(300, 200, 1200, 800), "binning_x": 2, "binning_y": 4},
    "all of it": {"roi": square(0, 0, 1920, 1080), "binning_x": 1, "binning_y": 1},
}


@pytest.mark.parametrize("more", REDUCED.values(), ids=REDUCED)
@pytest.mark.parametrize("bend", [(), (-0.2, 0.05, 0.001, -0.002, 0.01)])
def test_images_that_are_cut_and_binned_show_the_same_places(tmp_path, more, bend):
    full, info = (camera_info("optical", 1920, 1080, bend, **keys) for keys in ({}, more))
    u, v = 700.0, 600.0
    roi = more.get("roi", square(0, 0, 1920, 1080))
    pixel = ((u - roi["x_offset"]) / more.get("binning_x", 1), (v - roi["y_offset"]) / more.get("binning_y", 1))
    one = read_flight(write(tmp_path / "full", fly_alone(info=full, pixel=(u, v))))
    other = read_flight(write(tmp_path / "reduced", fly_alone(info=info, pixel=pixel)))
    np.testing.assert_allclose(other.observed[3, 0].scan.measurements, one.observed[3, 0].scan.measurements, atol=1e-6)
    size = (roi["width"] // more.get("binning_x", 1), roi["height"] // more.get("binning_y", 1))
    assert other.setting.uavs[0].true_camera.size == size


@pytest.mark.parametrize("change", [{"binning_x": 2}, {"roi": square(0, 0, 640, 480)}, {"k": np.eye(3).ravel() * 500}])
def test_a_camera_that_changes_or_cannot_be_is_refused(tmp_path, change):
    topics = fly_alone()
    topics["/camera/camera_info"][1][1.0] = {
        **camera_info("optical", 1920, 1080),
        "header": stamped(1.0, "o"),
        **change,
    }
    with pytest.raises(InputError, match="its CameraInfo changes at 1 s; expected one camera in a flight"):
        read_flight(write(tmp_path / "changes", topics))
    info = camera_info("optical", 1920, 1080, roi=square(1000, 0, 1000, 500))
    with pytest.raises(InputError, match=r"roi of 1000 × 500 pixels from \(1000, 0\) is not in the image of 1920"):
        read_flight(write(tmp_path / "outside", fly_alone(info=info)))


def result(name, score):
    return {"hypothesis": (name, score)}


SELECTED = {
    "a class": ([[result("person", 0.9)], [result("car", 0.9)]], {}, [500.0], "used: 10 of class person; left out: 10"),
    "another class": ([[result("person", 0.9)], [result("car", 0.9)]], {"classes": "car"}, [540.0], "10 of class car;"),
    "the likeliest": ([[result("dog", 0.6), result("person", 0.2)], [result("dog", 0.1), result("person", 0.3)]], {},
                      [540.0], "left out: 10 of class dog"),
    "numbers": ([[result("0", 0.9)], [result("2", 0.9)]], {}, [500.0], "left out: 10 of class 2"),
    "a score": ([[result("person", 0.9)], [result("person", 0.3)]], {"least_score": 0.5}, [500.0], "10 with a score b"),
    "no result": ([[], []], {}, [500.0, 540.0], None),
    "names of numbers": ([[result("3", 0.9)], [result("7", 0.9)]], {}, [540.0], "left out: 10 of class car"),
}  # fmt: skip


@pytest.mark.parametrize(("results", "options", "expected", "said"), SELECTED.values(), ids=SELECTED)
def test_classes_and_scores_say_who_is_a_person(tmp_path, results, options, expected, said):
    topics = fly_alone()
    found = [{"bbox": (((500.0 + 40 * n, 600.0), 0.0), 9.0, 9.0), "results": r} for n, r in enumerate(results)]
    topics["/detections"] = (IN_IMAGE, {t: (stamped(t, "optical"), found) for t in TIMES})
    if results[0] == [result("3", 0.9)]:
        topics["/labels"] = (LABELS, {0.0: {"class_map": [(3, "car"), (7, "Person")]}})
    log = read_flight(write(tmp_path / "bag", topics), **options)
    assert [observed.pixels[:, 0].tolist() for observed in log.observed.values()] == [expected] * len(TIMES)
    assert (said is None) == (not any("left out" in remark for remark in log.remarks))
    assert said is None or any(said in remark for remark in log.remarks)


def test_boxes_of_negative_size_are_left_out(tmp_path):
    topics = fly_alone()
    found = [{"bbox": (((500.0, 600.0), 0.0), 9.0, size)} for size in (9.0, -9.0)]
    topics["/detections"] = (IN_IMAGE, {t: (stamped(t, "optical"), found) for t in TIMES})
    log = read_flight(write(tmp_path / "bag", topics))
    assert [len(observed.pixels) for observed in log.observed.values()] == [1] * len(TIMES)


@pytest.mark.parametrize("kind", ["string", "int64"])
def test_detections_of_older_releases_have_ids_and_plain_centres(tmp_path, monkeypatch, kind):
    """As vision_msgs 2 and 1 have them, whose definitions the bag holds."""
    old = {"BoundingBox2D": "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n"}
    old["ObjectHypothesisWithPose"] = f"{kind} id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n"
    monkeypatch.setattr(ros_bag, "_VISION", ros_bag._VISION | old)
    topics, person, other = fly_alone(), {"string": "person", "int64": 1}[kind], {"string": "car", "int64": 3}[kind]
    found = [
        {"bbox": ((u, 600.0, 0.0), 9.0, 9.0), "results": [{"id": id_, "score": 0.5}]}
        for u, id_ in ((500.0, person), (540.0, other))
    ]
    topics["/detections"] = (IN_IMAGE, {t: (stamped(t, "optical"), found) for t in TIMES})
    log = read_flight(write(tmp_path / "bag", topics))
    assert [observed.pixels.tolist() for observed in log.observed.values()] == [[[500.0, 600.0]]] * len(TIMES)


def test_of_several_cameras_it_is_the_one_in_whose_frame_detections_are(tmp_path):
    topics = fly_alone()
    topics["/camera/depth/camera_info"] = (CAMERA, {0.0: camera_info("depth", 640, 480)})
    log = read_flight(write(tmp_path / "bag", topics))
    assert log.setting.uavs[0].true_camera.size == (1920, 1080)


def test_a_bag_is_read_by_its_file_its_folder_and_the_folder_around(tmp_path, call):
    bare = tmp_path / "bare"
    for folder in (bare, tmp_path / "flight"):
        folder.mkdir()
    bag = write(tmp_path / "flight" / "bag", fly_alone())
    expected = read_flight(bag).poses
    shutil.copy(bag / "bag.mcap", bare / "flight.mcap")
    for place in (bare, bare / "flight.mcap", tmp_path / "flight"):
        np.testing.assert_array_equal(read_flight(place).poses, expected)
    assert call("track", "bare/flight.mcap", "--no-video", "--out", "tracked")[0] == 0
    shutil.copy(bare / "flight.mcap", bare / "again.mcap")
    with pytest.raises(InputError, match=r"holds 2 bags, again\.mcap, flight\.mcap; expected one, or its own path"):
        read_flight(bare)
    for name, content, complaint in (
        ("short.mcap", (bare / "flight.mcap").read_bytes()[:3000], "cannot be read: "),
        ("none.mcap", b"", "cannot be read: "),
        ("none.db3", b"nothing", "cannot be read: "),
        ("old.bag", b"#ROSBAG V2.0", "is a bag of ROS 1; rosbags-convert makes one of ROS 2 of it"),
        ("notes.txt", b"nothing", "is not a folder; expected one with"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=complaint) as told:
            read_flight(tmp_path / name)
        assert "\n" not in str(told.value)


def test_files_give_what_a_bag_lacks(tmp_path):
    """Poses, cameras and detections, each from the bag or from a file beside it."""
    topics = fly_alone(pixel=(960.0, 540.0))
    whole = read_flight(write(tmp_path / "whole", topics))
    fov = math.degrees(2 * math.atan(540 / FOCAL))
    files = {
        "/camera/camera_info": {"cameras.csv": ["fov_deg,pixels,width_px,height_px,axes", f"{fov!r},1080,1920,1080,"]},
        "/detections": {"detections.csv": ["time_s,u_px,v_px", *(f"{t},960,540" for t in TIMES)]},
        "/mavros/local_position/odom": {"poses.csv": ["time_s,x_m,y_m,z_m", *(f"{t},{4 * t},0,30" for t in TIMES)]},
    }
    for count in (1, 2):
        for lacking in combinations(files, count):
            folder = tmp_path / "-".join(name.strip("/").split("/")[0] for name in lacking)
            folder.mkdir()
            write(folder / "bag", {name: topic for name, topic in topics.items() if name not in lacking})
            for name, lines in (file for topic in reversed(lacking) for file in files[topic].items()):
                # The axes are those of quaternions in `poses.csv`; a bag has those of ROS.
                axes = "optical" if name == "cameras.csv" and not (folder / "poses.csv").exists() else ""
                (folder / name).write_text("\n".join(lines) + axes + "\n")
            log = read_flight(folder)
            np.testing.assert_allclose(log.poses[..., :3], whole.poses[..., :3], atol=1e-9)
            unused = "cameras: not used: column axes, optical, which are of quaternions in poses.csv; a bag has its own"
            assert (unused in log.remarks) == ("/camera/camera_info" in lacking and not (folder / "poses.csv").exists())
            found = [scan.measurements for (scan,) in log.scans()]
            np.testing.assert_allclose(found, [scan.measurements for (scan,) in whole.scans()], atol=1e-9)
    body = {t: odometry_of(t, [3.0 * t, 0.0, 30.0, *DOWN], "base_link") for t in TIMES}
    shutil.rmtree(folder / "bag")
    (folder / "poses.csv").unlink()
    (folder / "cameras.csv").write_text("\n".join(files["/camera/camera_info"]["cameras.csv"]))
    write(folder / "bag", {"/odom": (ODOMETRY, body)})
    with pytest.raises(
        InputError, match=r"has no sensor_msgs/CameraInfo, whose header .* frames are 'base_link'; poses.csv"
    ):
        read_flight(folder)


def fly(path, *, uavs=("/uav0",), lacking="", frame="map", distortion=(), more=()):
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = np.eye(2)
    with RosBag(path) as bag:
        for name in uavs if lacking != "camera" else ():
            info = camera_info(f"{name.strip('/')}/optical", 1080, 1080, distortion)
            bag.write(Topic(f"{name}/camera_info", CAMERA), 0.0, info)
        for time, name in product(TIMES, uavs):
            own = name.strip("/")
            for kind in ("odometry", *more) if lacking != "odometry" else ():
                x = 99.0 if "true" in kind else float(own.removeprefix("uav"))
                told = odometry(time, [x, 0.0, 30.0, *DOWN], f"{own}/optical")
                bag.write(Topic(f"{name}/{kind}", ODOMETRY), time, told)
            pose = ((1.0, 2.0, 0.0), DOWN)
            found = {"results": [(("person", 1.0), (pose, covariance.ravel()))], "bbox": {"center": pose}}
            bag.write(Topic(f"{name}/detections", ON_GROUND), time, (stamped(time, frame), [found]))


def test_uavs_are_in_the_order_of_their_numbers_and_true_odometry_is_left_out(tmp_path):
    fly(tmp_path / "bag", uavs=("/uav10", "/uav2"), more=("odometry_true",))
    log = read_flight(tmp_path)
    assert log.frames.all() and log.poses[:, :, 0].T.tolist() == [[2.0] * len(TIMES), [10.0] * len(TIMES)]


LACKS = {
    "odometry": ({"lacking": "odometry"}, "/uav0: has neither nav_msgs/Odometry nor tf of the frame 'uav0/optical'"),
    "camera": ({"lacking": "camera"}, "/uav0 has no topic of sensor_msgs/msg/CameraInfo; expected one, among"),
    "frame": ({"frame": "odom"}, "detections of /uav0 are in the frame 'odom', but tf ends at 'map'; expected them"),
    "distortion": ({"distortion": (-0.9, 0.0, 0.0, 0.0, 0.0)}, "/uav0: its CameraInfo: distortion: [-0.9, 0.0, 0.0, 0"),
    "file": ({"metadata": "nothing: 1\n"}, " cannot be read: "),
}


@pytest.mark.parametrize(("options", "complaint"), LACKS.values(), ids=LACKS)
def test_a_bag_that_lacks_something_is_refused_in_one_line(tmp_path, options, complaint):
    if "metadata" in options:
        (tmp_path / "metadata.yaml").write_text(options["metadata"])
    else:
        fly(tmp_path / "bag", **options)
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(tmp_path)
    assert "\n" not in str(told.value)
