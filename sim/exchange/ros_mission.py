"""A recorded mission as a bag of ROS 2, with a layout of Foxglove for it."""

import json
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from sim.exchange import ros_bag as ros
from sim.exchange.csv_files import write_map_and_settings, write_truth
from sim.exchange.ros_flight import flip
from sim.exchange.ros_scene import LEVEL, WORLD, draw_forest, draw_map, draw_people, draw_uav, head, stamp
from sim.facts.event import Event
from sim.facts.flight import Flight
from sim.facts.metrics.holding import FAR
from sim.facts.rerender import Rerenderer
from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot, find_reported_positions
from sim.views.frames.frame_panels import encode_png
from sim.views.scene import SceneMaker
from tracking.errors import spell
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Camera
from tracking.geometry.person import PERSON_SIZE, TARGET_HEIGHT
from tracking.geometry.quaternions import rotation
from tracking.metrics.ospa import gospa
from tracking.numerics.arrays import Array, Image

_PERSON = ("person", 1.0)  # class and score
_INFO = 20  # level of messages of a log
_BODY = PERSON_SIZE * (np.array(list(product((0, 1), repeat=3))) - (0.5, 0.5, 0.0))  # (8, 3) m, corners about the place
_PLOTS = {"OSPA [m]": ros.ERRORS["ospa"], "GOSPA [m]": ros.ERRORS["gospa"], "Bytes sent": ros.BYTES_SENT}
_MOST = 4  # panels of the layout in a row or column


def _encode_jpeg(image: Image) -> bytes:
    return cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()


# What encodes an image (H, W, 3) RGB, by the name of the format in CompressedImage.
IMAGES: dict[str, Callable[[Image], bytes]] = {"jpeg": _encode_jpeg, "png": encode_png}


def write_rosbag(recording: Recording, folder: Path, *, truth: bool = True, images: str = "jpeg") -> None:
    """Write a bag, a layout of Foxglove for it, and what `track` needs besides: trees, settings and truth.

    truth: False to leave out what UAVs do not know: people, true odometry and calibration, errors and events. images:
    one of `IMAGES`.
    """
    _write_bag(recording, folder / "bag", images, truth=truth)
    layout = _make_layout(recording)
    (folder / "foxglove.json").write_text(json.dumps(layout, indent=1), encoding="utf-8")
    write_map_and_settings(recording, folder, truth=truth)
    if truth:
        write_truth(recording, folder, start=ros.START)


def tell_noise(recording: Recording) -> str:
    """How far detections on the ground are from where boxes show them; empty if no noise was added to them."""
    sensing = recording.setting.sensing
    if recording.frames is not None or sensing.mode == "ideal" or sensing.noise != "range_bearing":
        return ""
    away = list[float]()
    cells = zip(*(part.tolist() for part in recording.cells(recording.measurement_offsets)), strict=True)
    for (k, i), place, pixel in zip(cells, recording.measurements, recording.pixels, strict=True):
        camera = recording.setting.uavs[i].believed_camera
        shown = camera.ground_points(recording.believed_camera_at(k, i), pixel[None], TARGET_HEIGHT)[0]
        away.append(math.dist(place, shown))
    if not away:
        return ""
    noise = f"{spell(float(np.median(away)), 2)} m in the median, which boxes in images do not have"
    return f"detections on the ground have noise, as of sensing.noise, of {noise}"


def _write_bag(recording: Recording, folder: Path, images: str, *, truth: bool) -> None:
    flight = Flight(recording)
    scenes = SceneMaker(recording.setting, recording.track_numbers)
    events = list(flight.events) if truth else []
    odometry = {ros.BODY: recording.believed_bodies} | ({ros.TRUE_BODY: recording.poses} if truth else {})
    with ros.RosBag(folder) as bag, ExitStack() as stack:
        # A flight from elsewhere has images of its own, which a recording does not contain.
        again = stack.enter_context(Rerenderer(recording)) if recording.frames is None else None
        bag.write(ros.FOREST, 0.0, draw_forest(recording))
        for k, time in enumerate(recording.times.tolist()):
            _write_events(bag, [event for event in events if event.time <= time])
            events = [event for event in events if event.time > time]
            snapshot = recording.snapshot(k)
            scene = scenes.add(snapshot, flight.people.hold_states[k])
            bag.write(ros.FRAMES, time, (_list_frames(recording, k, odometry[ros.BODY][k]),))
            for i, uav in enumerate(scene.uavs):
                for topic, poses in odometry.items():
                    bag.write(topic, time, _describe_motion(recording, k, i, poses), i)
                bag.write(ros.COMMAND, time, (head(time), {"linear": (*recording.commands[k, i].tolist(), 0.0)}), i)
                camera = recording.setting.uavs[i].believed_camera
                if k == 0 or snapshot.frames_taken[i]:
                    bag.write(ros.CAMERA_INFO, time, _describe_camera(time, i, camera), i)
                if snapshot.frames_taken[i]:
                    _write_detections(bag, snapshot, i, camera)
                    if again:
                        content = np.frombuffer(IMAGES[images](again.image(k, i)), dtype=np.uint8)
                        bag.write(ros.IMAGES, time, (head(time, _name_camera(i)), images, content), i)
                if i in snapshot.working:
                    _write_tracks(bag, snapshot, i, recording.track_numbers)
                bag.write(ros.UAV_MARKERS, time, draw_uav(time, uav), i)
                if recording.new_maps[k, i]:
                    bag.write(ros.MAP, time, draw_map(time, uav, recording.believed_at(k, i)), i)
            if truth and recording.labelled:
                bag.write(ros.PEOPLE, time, draw_people(scene))
                _write_errors(bag, snapshot)
        _write_events(bag, events)


def _list_frames(recording: Recording, k: int, bodies: Array) -> list[ros.RosMessage]:
    """Transforms of bodies, at poses (n, 7), and of cameras at scan k.

    A camera's frame is one of the world, not of its body, as one on a gimbal keeps its attitude.
    """
    cameras = recording.believed_cameras[k]
    optical = np.hstack([cameras[:, :3], flip(-cameras[:, 3:])])
    links = list[ros.RosMessage]()
    for i, (body, camera) in enumerate(zip(bodies, optical, strict=True)):
        for frame, row in ((_name_body(i), body), (_name_camera(i), camera)):
            links.append((head(float(recording.times[k])), frame, (row[:3].tolist(), row[3:].tolist())))
    return links


def _describe_motion(recording: Recording, k: int, uav: int, bodies: Array) -> ros.RosMessage:
    """Odometry at scan k, by poses (K, n, 7) of the bodies, with the mean velocity since the scan before."""
    row = bodies[k, uav]
    velocity = (row - bodies[max(k - 1, 0), uav])[:3] * recording.setting.rates.sensing
    return {
        "header": head(float(recording.times[k])),
        "child_frame_id": _name_body(uav),
        "pose": {"pose": (row[:3].tolist(), row[3:].tolist())},
        "twist": {"twist": {"linear": (rotation(row[3:]).T @ velocity).tolist()}},
    }


def _describe_camera(time: float, uav: int, camera: Camera) -> ros.RosMessage:
    """A CameraInfo as OpenCV has it, by which the centre of the first pixel is (0, 0)."""
    o = camera.optics
    matrix = np.array([[o.fx, 0.0, o.cx - 0.5], [0.0, o.fy, o.cy - 0.5], [0.0, 0.0, 1.0]])
    return {
        "header": head(time, _name_camera(uav)),
        "height": o.height,
        "width": o.width,
        "distortion_model": o.distortion.model,
        "d": np.array(o.distortion.coefficients),
        "k": matrix.ravel(),
        "r": np.eye(3).ravel(),
        "p": np.hstack([matrix, np.zeros((3, 1))]).ravel(),
    }


def _write_detections(bag: ros.RosBag, snapshot: Snapshot, uav: int, camera: Camera) -> None:
    """A frame's detections as places and, if it has pixels, as boxes of a person's size around them."""
    time = snapshot.time
    scan = snapshot.scans[uav]
    pixels = snapshot.pixels[uav]
    places = [_place(time, Gaussian(z, R)) for z, R in zip(scan.measurements, scan.covariances, strict=True)]
    bag.write(ros.DETECTIONS, time, (head(time), places), uav)
    people = scan.measurements[: len(pixels), None]  # in ideal sensing there are no pixels
    corners = _BODY + np.concatenate([people, np.zeros((len(people), 1, 1))], axis=2)
    sizes = np.ptp(camera.project(scan.pose, corners.reshape(-1, 3))[0].reshape(-1, 8, 2), axis=1)
    header = head(time, _name_camera(uav))
    boxes = [
        {"header": header, "results": [{"hypothesis": _PERSON}], "bbox": ((pixel, 0.0), *size)}
        for pixel, size in zip(pixels.tolist(), sizes.tolist(), strict=True)
    ]
    bag.write(ros.IMAGE_DETECTIONS, time, (header, boxes), uav)


def _write_tracks(bag: ros.RosBag, snapshot: Snapshot, uav: int, numbers: Mapping[int, int]) -> None:
    """A UAV's tracks, with their existence as scores, and the bytes that it sent."""
    time = snapshot.time
    tracks = [_place(time, t.belief, t.existence, str(numbers[t.id])) for t in snapshot.tracks[uav]]
    bag.write(ros.TRACKS, time, (head(time), tracks), uav)
    bag.write(ros.BYTES_SENT, time, (float(snapshot.bytes_sent[uav]),), uav)


def _write_errors(bag: ros.RosBag, snapshot: Snapshot) -> None:
    """OSPA and GOSPA [m] of each UAV that works, and their means."""
    people = snapshot.people[~np.isnan(snapshot.people[:, 0])]
    tracked = {i: find_reported_positions(snapshot.tracks[i]) for i in snapshot.working}
    errors = {
        "ospa": {i: float(snapshot.ospa[i, 0]) for i in tracked},
        "gospa": {i: gospa(places, people, FAR).distance for i, places in tracked.items()},
    }
    for name, own in errors.items():
        for i, error in own.items():
            bag.write(ros.ERRORS[name], snapshot.time, (error,), i)
        if own:
            bag.write(ros.FLEET_ERRORS[name], snapshot.time, (sum(own.values()) / len(own),))


def _write_events(bag: ros.RosBag, events: Iterable[Event]) -> None:
    for event in events:
        log = {"stamp": stamp(event.time), "level": _INFO, "name": event.kind, "msg": event.sentence}
        bag.write(ros.EVENTS, event.time, log)


def _place(time: float, belief: Gaussian, score: float = _PERSON[1], name: str = "") -> ros.RosMessage:
    """A person on the ground, by a belief of the place [m] and maybe more, of a track's number as name."""
    pose = ((*belief.mean[:2].tolist(), TARGET_HEIGHT), LEVEL)
    entries = np.zeros((6, 6))
    entries[:2, :2] = belief.covariance[:2, :2]
    return {
        "header": head(time),
        "results": [((_PERSON[0], score), (pose, entries.ravel()))],
        "bbox": (pose, PERSON_SIZE),
        "id": name,
    }


def _name_body(uav: int) -> str:
    """The frame of a UAV's body."""
    return f"uav{uav}/base_link"


def _name_camera(uav: int) -> str:
    """The frame of a UAV's camera: x to the right, y down, z ahead."""
    return f"uav{uav}/camera_optical_frame"


def _make_layout(recording: Recording) -> dict[str, Any]:
    """Scene, with the map of UAV 0 if UAVs make maps, cameras, errors and events in Foxglove."""
    uavs, width = recording.uav_count, recording.setting.area.width
    markers = [ros.UAV_MARKERS.name.format(i) for i in range(uavs)]
    maps = [ros.MAP.name.format(0)] * (recording.maps is not None)
    panels: dict[str, Any] = {
        "3D!scene": {
            "cameraState": {"distance": width, "perspective": True, "phi": 50, "thetaOffset": 0},
            "followMode": "follow-none",
            "followTf": WORLD,
            "scene": {"transforms": {"showLabel": False, "axisSize": 1}},
            "topics": {topic: {"visible": True} for topic in (ros.FOREST.name, ros.PEOPLE.name, *markers, *maps)},
        },
        "RosOut!events": {"topicToRender": ros.EVENTS.name, "minLogLevel": 1, "searchTerms": []},
    }
    images = [f"Image!uav{i}" for i in range(uavs)]
    for i, name in enumerate(images):
        topics = {"imageTopic": ros.IMAGES.name.format(i), "calibrationTopic": ros.CAMERA_INFO.name.format(i)}
        panels[name] = {
            "foxglovePanelTitle": f"Camera of uav{i}",
            "imageMode": topics,
            "topics": {markers[i]: {"visible": True, "namespaces": {"view": {"visible": False}}}},
        }
    plots = {f"Plot!{topic.name.split('/')[-1]}": (title, topic.name) for title, topic in _PLOTS.items()}
    for name, (title, topic) in plots.items():
        lines = [{"value": f"{topic.format(i)}.data", "label": f"uav{i}", "enabled": True} for i in range(uavs)]
        panels[name] = {"foxglovePanelTitle": title, "paths": lines, "showLegend": True}
    below = _arrange(["RosOut!events", *plots], "row")
    left = {"direction": "column", "first": "3D!scene", "second": below, "splitPercentage": 70}
    layout = {"direction": "row", "first": left, "second": _arrange(images, "column"), "splitPercentage": 75}
    return {"configById": panels, "globalVariables": {}, "userNodes": {}, "layout": layout}


def _arrange(panels: list[str], direction: str) -> Any:  # noqa: ANN401 - a panel, or a split of panels
    """Panels of equal sizes in a row or column, in two of them if there are many."""
    if len(panels) == 1:
        return panels[0]
    if len(panels) > _MOST:
        half = len(panels) // 2
        across = {"row": "column", "column": "row"}[direction]
        return {
            "direction": across,
            "first": _arrange(panels[:half], direction),
            "second": _arrange(panels[half:], direction),
        }
    rest = _arrange(panels[1:], direction)
    return {"direction": direction, "first": panels[0], "second": rest, "splitPercentage": 100 / len(panels)}
