"""Oracle of bags: a second library reads them, and its CameraInfo and tf put people where the renderer has them."""

import json
import sys
from collections import defaultdict
from itertools import chain

import cv2
import numpy as np
import pytest
from helpers.flights import recorded
from scipy.spatial.transform import Rotation

pytest.importorskip("rosbags")
pytest.importorskip("mcap_ros2")
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from sim.exchange.export import export
from sim.exchange.scanned_flight import read_flight
from sim.facts.flight import Flight
from sim.facts.metrics.metric import Outcome
from sim.facts.rerender import Rerenderer
from sim.mission.archive import save
from sim.scenario.text_files import read_toml
from tracking.errors import InputError
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import at_target_height

START = 10**9  # ns, stamp of the start: ROS takes a stamp of 0 for none
BROKEN_AT = 8  # the scan, of UAV 2
OVERRIDES = ("trees.density=75", "uavs.2.fails_at=1.5", "uavs.1.rate=1", "uavs.1.mount=body", "uavs.1.tilt_deg=20")


def read(folder, topics=None):
    """Messages by topic, as pairs of the mission's time [s] and message; names of types, and metadata, by topic.

    topics: those to read; None reads all.
    """
    messages, kinds, metadata, last = defaultdict(list), {}, {}, START
    with (folder / "bag" / "bag.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        expected = reader.get_summary().statistics.message_count
        for schema, channel, message, decoded in reader.iter_decoded_messages(topics):
            assert message.log_time >= last
            last = message.log_time
            messages[channel.topic].append(((message.log_time - START) / 1e9, decoded))
            kinds[channel.topic], metadata[channel.topic] = schema.name, channel.metadata
    assert topics or sum(map(len, messages.values())) == expected
    return messages, kinds, metadata


@pytest.fixture(scope="module")
def recording():
    return recorded(*OVERRIDES, seed=2, duration=3)


@pytest.fixture(scope="module")
def folder(recording, tmp_path_factory):
    out = tmp_path_factory.mktemp("bag") / "out"
    export(recording, "rosbag", out)
    return out


@pytest.fixture(scope="module")
def bag(folder):
    return read(folder)


def seconds(stamp):
    return (stamp.sec * 10**9 + stamp.nanosec - START) / 1e9


def row(place, turn):
    return [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]


def test_all_messages_decode_with_standard_types_and_stamps_of_their_times(bag):
    messages, kinds, _ = bag
    standard = {"sensor_msgs", "tf2_msgs", "nav_msgs", "geometry_msgs", "vision_msgs", "visualization_msgs", "std_msgs"}
    assert {kind.split("/")[0] for kind in kinds.values()} == standard | {"rcl_interfaces"}
    for found in messages.values():
        times = [time for time, _ in found]
        assert times == sorted(times)
        for time, message in found:
            inner = (getattr(message, name, ()) for name in ("detections", "markers", "transforms"))
            for stamped in (message, *chain(*inner)):
                if hasattr(stamped, "header"):
                    assert seconds(stamped.header.stamp) == time


def test_tf_is_a_tree_with_the_poses_of_bodies_and_cameras(recording, bag):
    messages, _, _ = bag
    assert [time for time, _ in messages["/tf"]] == recording.times.tolist()
    for k, (time, message) in enumerate(messages["/tf"]):
        parents = {link.child_frame_id: link.header.frame_id for link in message.transforms}
        assert len(parents) == len(message.transforms) == 6 and {*parents.values()} == {"map"}  # a tree of depth one
        poses = {link.child_frame_id: link.transform for link in message.transforms}
        for i in range(3):
            body = poses[f"uav{i}/base_link"]
            assert row(body.translation, body.rotation) == recording.poses[k, i].tolist()
            eye = poses[f"uav{i}/camera_optical_frame"]
            turn = Rotation.from_quat(row(eye.translation, eye.rotation)[3:])
            ahead = -Rotation.from_quat(recording.cameras[k, i, 3:]).as_matrix()[:, 2]
            np.testing.assert_allclose(turn.as_matrix()[:, 2], ahead, atol=1e-12)  # z of an optical frame
        for name in ("odometry", "odometry_true"):
            told = messages[f"/uav1/{name}"][k][1]
            assert row(told.pose.pose.position, told.pose.pose.orientation) == recording.poses[k, 1].tolist()
            assert told.child_frame_id == "uav1/base_link" and seconds(told.header.stamp) == time
        command = messages["/uav1/command"][k][1].twist.linear
        assert [command.x, command.y, command.z] == [*recording.commands[k, 1].tolist(), 0.0]
    steps = [(m.twist.twist.linear, Rotation.from_quat(recording.poses[k, 0, 3:]))
             for k, (_, m) in enumerate(messages["/uav0/odometry"])]  # fmt: skip
    moved = np.array([turn.apply([v.x, v.y, v.z]) for v, turn in steps])[1:] / 5
    np.testing.assert_allclose(moved, np.diff(recording.poses[:, 0, :3], axis=0), atol=1e-9)


def test_a_uav_that_errs_tells_the_poses_that_it_believes(tmp_path):
    errs = [f"uavs.{i}.navigation={kind}" for i, kind in enumerate(("consumer", "gnss", "exact"))]
    recording = recorded(*errs, seed=2, duration=1)
    export(recording, "rosbag", tmp_path / "out")
    messages, _, _ = read(tmp_path / "out")
    for k, (_, message) in enumerate(messages["/tf"]):
        for i, (body, eye) in enumerate(zip(message.transforms[::2], message.transforms[1::2], strict=True)):
            body, eye = (np.array(row(t.transform.translation, t.transform.rotation)) for t in (body, eye))
            assert eye[:3].tolist() == recording.believed[k, i, :3].tolist()
            # The camera is mounted on the believed body as on the true one.
            angle = Rotation.from_quat(body[3:]).inv() * Rotation.from_quat(recording.believed[k, i, 3:])
            true = Rotation.from_quat(recording.poses[k, i, 3:]).inv() * Rotation.from_quat(recording.cameras[k, i, 3:])
            assert (angle * true.inv()).magnitude() < 1e-7
            told = messages[f"/uav{i}/odometry_true"][k][1].pose.pose
            assert row(told.position, told.orientation) == recording.poses[k, i].tolist()
            told = messages[f"/uav{i}/odometry"][k][1].pose.pose
            np.testing.assert_array_equal(row(told.position, told.orientation), body)
            shown = next(marker for marker in messages[f"/uav{i}/markers"][k][1].markers if marker.ns == "uav")
            assert row(shown.pose.position, shown.pose.orientation)[:3] == eye[:3].tolist()
    assert np.abs(recording.believed[:, 0] - recording.cameras[:, 0]).max() > 0.1


def test_camera_info_and_tf_project_people_onto_their_pixels(tmp_path):
    """Without trees only another person or a UAV may cover the middle of a person; K is that of OpenCV."""
    each = [f"uavs.{i}.{key}" for i in range(3) for key in ("mount=body", "tilt_deg=15", "pixels=384")]
    crowd = ("trees.density=0", "people.count=180", "sensing.mode=ideal", "tracking.initial_tracks=none")
    recording = recorded(*crowd, *each, planner="lawnmower", seed=1, duration=7)
    export(recording, "rosbag", tmp_path / "out")
    messages, _, _ = read(tmp_path / "out", ["/tf", *(f"/uav{i}/camera/camera_info" for i in range(3))])
    beside, farthest = [], 0.0
    with Rerenderer(recording) as again:
        for k, (_, message) in enumerate(messages["/tf"]):
            links = {link.child_frame_id: link.transform for link in message.transforms}
            for i in range(3):
                info = messages[f"/uav{i}/camera/camera_info"][k][1]
                eye = links[info.header.frame_id]
                x, y, z, *turn = row(eye.translation, eye.rotation)
                points = Rotation.from_quat(turn).inv().apply(at_target_height(recording.people[k]) - [x, y, z])
                image = points @ np.reshape(info.k, (3, 3)).T
                pixels, masks = image[:, :2] / image[:, 2:] + 0.5, again.rendered(k, i).people
                for m, (u, v) in enumerate(pixels):
                    inside = image[m, 2] > 0 and 0 <= u < info.width and 0 <= v < info.height
                    if inside and masks[int(v), int(u)] in (m, -1) and (masks == m).any():
                        rows, columns = np.nonzero(masks == m)
                        # From a point to the nearest of the person's pixels, which are squares.
                        across = np.maximum(np.maximum(columns - u, u - columns - 1), 0)
                        down = np.maximum(np.maximum(rows - v, v - rows - 1), 0)
                        farthest = max(farthest, np.hypot(across, down).min())
                        beside.append((u - columns.mean() - 0.5, v - rows.mean() - 0.5))
    assert len(beside) >= 1000
    assert farthest <= 0.5  # pixels
    assert np.abs(np.mean(beside, axis=0)).max() < 0.2


def test_each_frame_taken_has_its_image_and_detections(recording, bag):
    messages, _, _ = bag
    with Rerenderer(recording) as again:
        for i in range(3):
            taken = np.flatnonzero(recording.frames_taken[:, i]).tolist()
            for name in ("camera/image/compressed", "camera/detections", "detections"):
                assert [time for time, _ in messages[f"/uav{i}/{name}"]] == recording.times[taken].tolist()
            for k, (_, message) in zip(taken, messages[f"/uav{i}/camera/image/compressed"], strict=True):
                shown = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
                assert message.format == "jpeg" and np.abs(shown.astype(int) - again.image(k, i)).mean() < 8
            for k, (_, message) in zip(taken, messages[f"/uav{i}/camera/detections"], strict=True):
                centres = [(d.bbox.center.position.x, d.bbox.center.position.y) for d in message.detections]
                assert centres == [tuple(pixel) for pixel in recording.pixels_at(k, i).tolist()]
                assert all(2 < d.bbox.size_x < 64 and 2 < d.bbox.size_y < 64 for d in message.detections)
                results = [result.hypothesis for d in message.detections for result in d.results]
                assert [(r.class_id, r.score) for r in results] == [("person", 1.0)] * len(message.detections)
            for k, (_, message) in zip(taken, messages[f"/uav{i}/detections"], strict=True):
                scan = recording.scan_at(k, i)
                found = [d.results[0].pose for d in message.detections]
                assert [[p.pose.position.x, p.pose.position.y] for p in found] == scan.measurements.tolist()
                assert [np.reshape(p.covariance, (6, 6))[:2, :2].tolist() for p in found] == scan.covariances.tolist()


def test_numbers_tracks_and_events_are_those_of_the_mission(recording, bag):
    messages, _, _ = bag
    scores = Outcome(recording).scores
    for i, score in enumerate(scores):
        on = np.flatnonzero(recording.working[:, i])
        assert [m.data for _, m in messages[f"/uav{i}/ospa"]] == recording.ospa[on, i, 0].tolist()
        np.testing.assert_allclose([m.data for _, m in messages[f"/uav{i}/gospa"]], score.gospa[:, 0], rtol=1e-12)
        assert [m.data for _, m in messages[f"/uav{i}/bytes_sent"]] == recording.bytes_sent[on, i].tolist()
        for k, (_, message) in zip(on.tolist(), messages[f"/uav{i}/tracks"], strict=True):
            tracks = recording.tracks_at(k, i)
            assert [d.id for d in message.detections] == [str(recording.track_numbers[t.id]) for t in tracks]
            assert [d.bbox.center.position.y for d in message.detections] == [t.belief.mean[1] for t in tracks]
    np.testing.assert_allclose([m.data for _, m in messages["/ospa"]], np.nanmean(recording.ospa[:, :, 0], axis=1))
    told = [(time, message.name, message.msg) for time, message in messages["/events"]]
    assert told == [(pytest.approx(e.time, abs=1e-9), e.kind, e.sentence) for e in Flight(recording).events]


def test_the_scene_has_trees_people_views_intents_and_ellipses(recording, bag):
    messages, _, metadata = bag
    assert "durability: 1" in metadata["/forest"]["offered_qos_profiles"]  # for who subscribes late
    assert "durability: 1" in metadata["/uav0/camera/camera_info"]["offered_qos_profiles"]
    ((_, forest),) = messages["/forest"]
    trunks = [marker.pose.position for marker in forest.markers if marker.ns == "trunks"]
    np.testing.assert_allclose([(p.x, p.y) for p in trunks], recording.trees[:, :2])
    for k, (_, message) in enumerate(messages["/people"]):
        people = [marker.pose.position for marker in message.markers if marker.ns == "people"]
        assert [[p.x, p.y] for p in people] == recording.people[k].tolist()
    for i in range(3):
        for k, (_, message) in enumerate(messages[f"/uav{i}/markers"]):
            assert message.markers[0].action == 3  # the markers of the scan before go
            kinds = [marker.ns for marker in message.markers[1:]]
            works = bool(recording.working[k, i])
            seen = {"view", "intent", "tracks", "numbers"}
            seen |= {"detections"} if len(recording.scan_at(k, i).measurements) else set()
            assert {*kinds} == {"uav", "names"} | (seen if works else set())
            names = [marker.text for marker in message.markers if marker.ns == "names"]
            assert names == [f"UAV {i}" if works else f"UAV {i}: broken down"]
            drawn = [marker for marker in message.markers if marker.ns == "tracks"]
            tracks = recording.tracks_at(k, i)
            for marker, track in zip(drawn, tracks, strict=True):
                turn = row(marker.pose.position, marker.pose.orientation)[3:]
                half = np.array([marker.scale.x, marker.scale.y]) / 2
                axes = Rotation.from_quat(turn).as_matrix()[:2, :2]
                covariance = axes @ np.diag(half**2 / 5.991465) @ axes.T  # 95 % of chi-square
                np.testing.assert_allclose(covariance, track.belief.covariance[:2, :2], rtol=1e-6, atol=1e-9)


def test_the_layout_of_foxglove_shows_topics_of_the_bag(folder, bag):
    _, kinds, _ = bag
    layout = json.loads((folder / "foxglove.json").read_text())
    panels, placed, left = layout["configById"], [], [layout["layout"]]
    while left:
        part = left.pop()
        placed += [part] if isinstance(part, str) else []
        left += [] if isinstance(part, str) else [part["first"], part["second"]]
    assert sorted(placed) == sorted(panels) and len(panels) == 1 + 1 + 3 + 3
    shown = {
        topic for panel in panels.values() for topic in [*panel.get("topics", {}), *panel.get("imageMode", {}).values()]
    }
    shown |= {path["value"].removesuffix(".data") for panel in panels.values() for path in panel.get("paths", [])}
    assert shown | {panels["RosOut!events"]["topicToRender"]} <= {*kinds}


def test_without_truth_only_what_uavs_know_is_left(recording, folder, bag, tmp_path, call):
    export(recording, "rosbag", tmp_path / "out", truth=False)
    messages, _, _ = read(tmp_path / "out")
    known = {topic for topic in bag[0] if not topic.endswith(("odometry_true", "ospa", "people", "events"))}
    assert {*messages} == known and len({*bag[0]} - known) == 3 * 3 + 4
    assert {*folder.rglob("*.csv")} == {folder / "trees.csv", folder / "truth.csv"}
    assert [path.name for path in (tmp_path / "out").glob("*.csv")] == ["trees.csv"]
    save(recording, tmp_path / "mission.npz")
    for target, option in (("csv", ["--no-truth"]), ("coco", ["--no-truth"]), ("mot", ["--images", "png"])):
        code, _, told = call("export", "mission.npz", "--to", target, *option)
        assert code == 2 and f"{option[0]}: not allowed together with --to {target}; it belongs to --to rosbag" in told
    assert "did you mean png?" in call("export", "mission.npz", "--to", "rosbag", "--images", "pn")[2]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mission.npz", "out"]


def test_images_are_exact_as_png_and_the_noise_of_places_is_told(recording, tmp_path, call):
    save(recording, tmp_path / "mission.npz")
    code, _, told = call("export", "mission.npz", "--to", "rosbag", "--images", "png", "--out", "out")
    assert code == 0 and "detections on the ground have noise, as of sensing.noise, of " in told
    messages, _, _ = read(tmp_path / "out")
    away = []
    with Rerenderer(recording) as again:
        for k, (_, message) in enumerate(messages["/uav0/camera/image/compressed"]):
            shown = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
            assert message.format == "png" and shown.tobytes() == again.image(k, 0).tobytes()
    for i in range(3):
        camera = recording.setting.uavs[i].true_camera
        for k in np.flatnonzero(recording.frames_taken[:, i]).tolist():
            shown = camera.ground_points(recording.camera_at(k, i), recording.pixels_at(k, i), TARGET_HEIGHT)
            away += np.linalg.norm(recording.scan_at(k, i).measurements - shown, axis=1).tolist()
    assert float(told.partition("noise, of ")[2].split()[0]) == pytest.approx(np.median(away), rel=0.02)
    assert np.median(away) > 0.1


def test_a_bag_knows_the_calibration_that_the_fleet_believes(tmp_path):
    """Views and boxes grow with the focal length that is believed; without truth no file has the true one."""
    lens = "{width=160,height=120,focal=[175,175],believed={focal=[140,140]}}"
    recording = recorded(f"uavs.0.camera={lens}", "trees.density=0", "tracking.initial_tracks=none", seed=2, duration=1)
    export(recording, "rosbag", tmp_path / "out", truth=False)
    messages, _, _ = read(tmp_path / "out")
    assert messages["/uav0/camera/camera_info"][0][1].k[0] == 140
    camera = recording.setting.uavs[0].believed_camera
    corners = camera.ground_points(recording.camera_at(0, 0), camera.outline)
    view = next(m for m in messages["/uav0/markers"][0][1].markers if m.ns == "view")
    assert max(p.x for p in view.points) == pytest.approx(corners[:, 0].max())
    settings = read_toml(tmp_path / "out" / "scenario.toml", "scenario")["uavs"][0]["camera"]
    assert settings["focal"] == [140.0, 140.0] and "believed" not in settings
    assert read_flight(tmp_path / "out").setting.uavs[0].true_camera == camera


def test_without_the_library_an_export_says_what_to_install(recording, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(InputError, match=r"^--to: rosbag needs rosbags: pip install 'rosbags>=0\.11'$"):
        export(recording, "rosbag", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
