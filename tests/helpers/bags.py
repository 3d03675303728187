"""Bags of ROS 2 as a vehicle might write them, from recordings."""

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sim.sensing.cameras import camera_of

_HYPOTHESIS = "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
_DEFINITIONS = {
    "Point2D": "float64 x\nfloat64 y\n",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "ObjectHypothesis": "string class_id\nfloat64 score\n",
    "ObjectHypothesisWithPose": _HYPOTHESIS.replace("ObjectHypothesis hyp", "vision_msgs/ObjectHypothesis hyp"),
}
for _n in ("2D", "3D"):
    _DEFINITIONS[f"Detection{_n}"] = (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        f"vision_msgs/BoundingBox{_n} bbox\nstring id\n"
    )
    _DEFINITIONS[f"Detection{_n}Array"] = f"std_msgs/Header header\nvision_msgs/Detection{_n}[] detections\n"


class Bag:
    """A bag that is being written."""

    def __init__(self, path):
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        for name, text in _DEFINITIONS.items():
            self._store.register(get_types_from_msg(text, f"vision_msgs/msg/{name}"))
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self._topics = {}

    def __enter__(self):
        self._writer.open()
        return self

    def __exit__(self, *error):
        self._writer.close()

    def make(self, kind, *values):
        package, name = kind.split("/")
        return self._store.types[f"{package}/msg/{name}"](*values)

    def write(self, topic, time, message):
        kind = message.__msgtype__
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(self._topics[topic], round(time * 1e9), self._store.serialize_cdr(message, kind))

    def header(self, time, frame):
        nanoseconds = round(time * 1e9)
        return self.make("std_msgs/Header", self.make("builtin_interfaces/Time", *divmod(nanoseconds, 10**9)), frame)

    def pose(self, row):
        place, turn = self.make("geometry_msgs/Point", *row[:3]), self.make("geometry_msgs/Quaternion", *row[3:])
        return self.make("geometry_msgs/Pose", place, turn)

    def write_odometry(self, topic, time, row, child, parent="map"):
        nothing, zero = np.zeros(36), self.make("geometry_msgs/Vector3", 0.0, 0.0, 0.0)
        twist = self.make("geometry_msgs/TwistWithCovariance", self.make("geometry_msgs/Twist", zero, zero), nothing)
        pose = self.make("geometry_msgs/PoseWithCovariance", self.pose(row), nothing)
        self.write(topic, time, self.make("nav_msgs/Odometry", self.header(time, parent), child, pose, twist))

    def write_transform(self, topic, time, row, child, parent):
        place, turn = self.make("geometry_msgs/Vector3", *row[:3]), self.make("geometry_msgs/Quaternion", *row[3:])
        link = self.make("geometry_msgs/Transform", place, turn)
        stamped = self.make("geometry_msgs/TransformStamped", self.header(time, parent), child, link)
        self.write(topic, time, self.make("tf2_msgs/TFMessage", [stamped]))

    def write_camera(self, topic, frame, focal, width, height, distortion=()):
        k = np.array([focal, 0, width / 2, 0, focal, height / 2, 0, 0, 1.0])
        region = self.make("sensor_msgs/RegionOfInterest", 0, 0, 0, 0, False)
        bent = np.array(distortion, dtype=float)
        parts = (height, width, "plumb_bob", bent, k, np.eye(3).ravel(), np.zeros(12), 0, 0, region)
        self.write(topic, 0.0, self.make("sensor_msgs/CameraInfo", self.header(0.0, frame), *parts))

    def write_places(self, topic, time, places, covariances, frame="map"):
        """A Detection3DArray of places (N, 2) with covariances (N, 2, 2)."""
        found = []
        for (x, y), R in zip(places.tolist(), covariances, strict=True):
            pose, entries = self.pose([x, y, 0.0, 0.0, 0.0, 0.0, 1.0]), np.zeros((6, 6))
            entries[:2, :2] = R
            what = self.make("vision_msgs/ObjectHypothesis", "person", 1.0)
            known = self.make("geometry_msgs/PoseWithCovariance", pose, entries.ravel())
            results = [self.make("vision_msgs/ObjectHypothesisWithPose", what, known)]
            box = self.make("vision_msgs/BoundingBox3D", pose, self.make("geometry_msgs/Vector3", 0.5, 0.5, 1.7))
            found.append(self.make("vision_msgs/Detection3D", self.header(time, frame), results, box, ""))
        self.write(topic, time, self.make("vision_msgs/Detection3DArray", self.header(time, frame), found))

    def write_pixels(self, topic, time, pixels, frame):
        """A Detection2DArray of boxes around pixels (N, 2)."""
        found = []
        for u, v in pixels.tolist():
            centre = self.make("vision_msgs/Pose2D", self.make("vision_msgs/Point2D", u, v), 0.0)
            box = self.make("vision_msgs/BoundingBox2D", centre, 9.0, 9.0)
            found.append(self.make("vision_msgs/Detection2D", self.header(time, frame), [], box, ""))
        self.write(topic, time, self.make("vision_msgs/Detection2DArray", self.header(time, frame), found))


OPTICAL = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]  # pose of a camera's optical frame in that of a body that looks down


def write_bag(recording, path):
    """A bag with what the UAVs of a recording measured: odometry, cameras and places on the ground."""
    with Bag(path) as bag:
        for i, uav in enumerate(recording.setting.uavs):
            camera = camera_of(uav)
            bag.write_transform("/tf_static", 0.0, OPTICAL, f"uav{i}/camera", f"uav{i}/base_link")
            bag.write_camera(f"/uav{i}/camera_info", f"uav{i}/camera", camera.focal, camera.pixels, camera.pixels)
        for k, time in enumerate(recording.times.tolist()):
            for i in range(recording.poses.shape[1]):
                row = recording.cameras[k, i].tolist()
                bag.write_odometry(f"/uav{i}/odometry", time, row, f"uav{i}/base_link")
                if recording.frames_taken[k, i]:
                    scan = recording.scan_at(k, i)
                    bag.write_places(f"/uav{i}/detections", time, scan.measurements, scan.covariances)
