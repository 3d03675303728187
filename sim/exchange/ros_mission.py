"""A recorded mission as a bag of ROS 2."""

from contextlib import ExitStack
from itertools import product
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.bag import CAMERA, IN_IMAGE, ODOMETRY, ON_GROUND, OPTICAL, TRANSFORMS
from sim.exchange.ros_bag import Message, RosBag
from sim.exchange.ros_scene import LEVEL, UavScene, draw_forest, draw_people, head, stamp
from sim.facts.event import Event
from sim.facts.flight import Flight
from sim.facts.metrics.holding import FAR, HOLDS
from sim.facts.rerender import Rerenderer
from sim.facts.words import number_snapshot
from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot, find_reported_positions
from tracking.geometry.camera import Camera
from tracking.geometry.person import PERSON_SIZE, TARGET_HEIGHT
from tracking.metrics.gospa import gospa
from tracking.numerics.arrays import Array, Image

_MARKERS, _IMAGE = "visualization_msgs/msg/MarkerArray", "sensor_msgs/msg/CompressedImage"
_COMMAND, _NUMBER, _LOG = "geometry_msgs/msg/TwistStamped", "std_msgs/msg/Float64", "rcl_interfaces/msg/Log"
_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 90]
_INFO = 20  # level of messages of a log
_BODY = PERSON_SIZE * (np.array(list(product((0, 1), repeat=3))) - (0.5, 0.5, 0.0))  # (8, 3) m, corners about the place


def write_bag(recording: Recording, folder: Path, *, truth: bool) -> None:
    """Write the bag of a mission into a new folder; docs/how-to/tracking.md describes its topics.

    truth: False to leave out what UAVs do not know: people, true odometry, errors and events.
    """
    flight, scene = Flight(recording), UavScene(recording)
    events = list(flight.events) if truth else []
    odometry = {"odometry": _find_believed_bodies(recording)} | ({"odometry_true": recording.poses} if truth else {})
    with RosBag(folder) as bag, ExitStack() as stack:
        # A flight from elsewhere has images of its own, which a recording does not contain.
        again = stack.enter_context(Rerenderer(recording)) if recording.frames is None else None
        bag.write("/forest", _MARKERS, 0.0, draw_forest(recording), latched=True)
        for k, time in enumerate(recording.times.tolist()):
            while events and events[0].time <= time:
                _write_event(bag, events.pop(0))
            snapshot = number_snapshot(recording, k)
            _write_poses(bag, recording, k, odometry)
            for i, markers in enumerate(scene.draw(snapshot)):
                _write_camera(bag, snapshot, i, recording.setting.uavs[i].true_camera, first=k == 0)
                if again and snapshot.frames[i]:
                    _write_image(bag, time, i, again.image(k, i))
                _write_tracks(bag, snapshot, i)
                bag.write(f"/uav{i}/markers", _MARKERS, time, markers)
            if truth and recording.labelled:
                holds = [HOLDS[hold] for hold in flight.people.hold_states[k]]
                bag.write("/people", _MARKERS, time, draw_people(snapshot, holds))
                _write_errors(bag, snapshot)
        for event in events:
            _write_event(bag, event)


def _find_believed_bodies(recording: Recording) -> Array:
    """Poses (K, n, 7) of the bodies as UAVs believe them: moved and turned from the true ones as their cameras."""
    if recording.believed is None:
        return recording.poses
    own, true, believed = (rows.reshape(-1, 7) for rows in (recording.poses, recording.cameras, recording.believed))
    body, camera, told = (Rotation.from_quat(rows[:, 3:]) for rows in (own, true, believed))
    turned = told * camera.inv() * body
    return np.hstack([own[:, :3] + believed[:, :3] - true[:, :3], turned.as_quat()]).reshape(recording.poses.shape)


def _write_poses(bag: RosBag, recording: Recording, k: int, odometry: dict[str, Array]) -> None:
    """Transforms of bodies and cameras, odometry and commands.

    A camera's frame is one of the world, not of its body, as one on a gimbal keeps its attitude. odometry: poses
    (K, n, 7) of the bodies by names of topics, believed ones first.
    """
    time, cameras = float(recording.times[k]), recording.believed_cameras[k]
    header, links = head(time), list[Message]()
    turned = Rotation.from_quat(cameras[:, 3:]) * Rotation.from_quat(OPTICAL).inv()
    optical = np.hstack([cameras[:, :3], turned.as_quat()])
    for name, poses in odometry.items():
        moved = (poses[k] - poses[max(k - 1, 0)])[:, :3] * recording.setting.rates.sensing
        for i, (row, velocity) in enumerate(zip(poses[k], moved, strict=True)):
            told: Message = {
                "header": header,
                "child_frame_id": f"uav{i}/base_link",
                "pose": {"pose": (row[:3].tolist(), row[3:].tolist())},
                "twist": {"twist": {"linear": Rotation.from_quat(row[3:]).apply(velocity, inverse=True).tolist()}},
            }
            bag.write(f"/uav{i}/{name}", ODOMETRY, time, told)
    for i, (body, camera) in enumerate(zip(odometry["odometry"][k], optical, strict=True)):
        for frame, row in ((f"uav{i}/base_link", body), (_name_camera(i), camera)):
            links.append((header, frame, (row[:3].tolist(), row[3:].tolist())))
        command: Message = (header, {"linear": (*recording.commands[k, i].tolist(), 0.0)})
        bag.write(f"/uav{i}/command", _COMMAND, time, command)
    bag.write("/tf", TRANSFORMS, time, (links,))


def _write_camera(bag: RosBag, snapshot: Snapshot, uav: int, camera: Camera, *, first: bool) -> None:
    """A frame's CameraInfo and detections; CameraInfo also if it is the first scan."""
    time, header = snapshot.time, head(snapshot.time, _name_camera(uav))
    o = camera.optics
    # As OpenCV has it, by which the centre of the first pixel is (0, 0).
    matrix = np.array([[o.fx, 0.0, o.cx - 0.5], [0.0, o.fy, o.cy - 0.5], [0.0, 0.0, 1.0]])
    info = {
        "header": header,
        "height": o.height,
        "width": o.width,
        "distortion_model": "plumb_bob",
        "d": np.array(o.distortion),
        "k": matrix.ravel(),
        "r": np.eye(3).ravel(),
        "p": np.hstack([matrix, np.zeros((3, 1))]).ravel(),
    }
    if first or snapshot.frames[uav]:
        bag.write(f"/uav{uav}/camera/camera_info", CAMERA, time, info, latched=True)
    if snapshot.frames[uav]:
        scan, pixels = snapshot.scans[uav], snapshot.pixels[uav]
        places = [_place(time, *pair) for pair in zip(scan.measurements, scan.covariances, strict=True)]
        bag.write(f"/uav{uav}/detections", ON_GROUND, time, (head(time), places))
        people = scan.measurements[: len(pixels), None]  # in ideal sensing there are no pixels
        corners = _BODY + np.concatenate([people, np.zeros((len(people), 1, 1))], axis=2)
        sizes = np.ptp(camera.project(scan.pose, corners.reshape(-1, 3))[0].reshape(-1, 8, 2), axis=1)
        boxes = [
            {"header": header, "bbox": ((pixel, 0.0), *size)}
            for pixel, size in zip(pixels.tolist(), sizes.tolist(), strict=True)
        ]
        bag.write(f"/uav{uav}/camera/detections", IN_IMAGE, time, (header, boxes))


def _write_image(bag: RosBag, time: float, uav: int, image: Image) -> None:
    made, content = cv2.imencode(".jpg", image[..., ::-1], _QUALITY)
    assert made
    message = (head(time, _name_camera(uav)), "jpeg", content)
    bag.write(f"/uav{uav}/camera/image/compressed", _IMAGE, time, message)


def _write_tracks(bag: RosBag, snapshot: Snapshot, uav: int) -> None:
    """A working UAV's tracks, with their existence as scores, and the bytes that it sent."""
    if uav in snapshot.working:
        held, time = snapshot.tracks[uav], snapshot.time
        tracks = [
            _place(time, t.belief.mean[:2], t.belief.covariance[:2, :2], score=t.existence, name=str(t.id))
            for t in held
        ]
        bag.write(f"/uav{uav}/tracks", ON_GROUND, time, (head(time), tracks))
        bag.write(f"/uav{uav}/bytes_sent", _NUMBER, time, (float(snapshot.bytes_sent[uav]),))


def _write_errors(bag: RosBag, snapshot: Snapshot) -> None:
    """OSPA and GOSPA [m] of each UAV that works, and their means."""
    people = snapshot.people[~np.isnan(snapshot.people[:, 0])]
    parts = {i: gospa(find_reported_positions(snapshot.tracks[i]), people, FAR) for i in snapshot.working}
    errors = {"ospa": {i: float(snapshot.ospa[i, 0]) for i in parts}, "gospa": {i: parts[i].distance for i in parts}}
    for name, own in errors.items():
        for i, error in own.items():
            bag.write(f"/uav{i}/{name}", _NUMBER, snapshot.time, (error,))
        if own:
            bag.write(f"/{name}", _NUMBER, snapshot.time, (sum(own.values()) / len(own),))


def _write_event(bag: RosBag, event: Event) -> None:
    log = {"stamp": stamp(event.time), "level": _INFO, "name": event.kind, "msg": event.sentence}
    bag.write("/events", _LOG, event.time, log)


def _place(time: float, mean: Array, covariance: Array, *, score: float = 1.0, name: str = "") -> Message:
    """A person on the ground, at a place (2,) m with a covariance (2, 2) m²."""
    entries, pose = np.zeros((6, 6)), ((*mean.tolist(), TARGET_HEIGHT), LEVEL)
    entries[:2, :2] = covariance
    return {
        "header": head(time),
        "results": [(("person", score), (pose, entries.ravel()))],
        "bbox": (pose, PERSON_SIZE),
        "id": name,
    }


def _name_camera(uav: int) -> str:
    """The frame of a UAV's camera: x to the right, y down, z ahead."""
    return f"uav{uav}/camera_optical_frame"
