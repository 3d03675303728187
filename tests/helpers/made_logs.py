"""Logs of drones as their formats are documented, made of a few values, or of a recording."""

import csv
import math
import struct
import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.csv_files import write_csv, write_table

ULOG = {
    "vehicle_local_position": (
        "uint64_t timestamp;double ref_lat;double ref_lon;float x;float y;float z;bool xy_global;"
    ),
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t time_utc_usec;",
    "home_position": "uint64_t timestamp;float z;",
}
CODES = {"uint64_t": "Q", "double": "d", "float": "f", "bool": "?", "float[4]": "4f"}


def make_ulog(topics):
    """A ULog with rows of values by topic."""
    found = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    found += b"".join(message("F", f"{name}:{ULOG[name]}".encode()) for name in topics)
    for n, name in enumerate(topics):
        found += message("A", struct.pack("<BH", 0, n) + name.encode())
    for n, (name, rows) in enumerate(topics.items()):
        code = "<" + "".join(CODES[field.split()[0]] for field in ULOG[name].strip(";").split(";"))
        for row in rows:
            found += message("D", struct.pack("<H", n) + struct.pack(code, *row))
    return found


# Number, format and columns of messages of ArduPilot.
DATAFLASH = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "GPS": (1, "QBBIHBcLLe", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt"),
    "POS": (2, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "ATT": (3, "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "MNT": (4, "QBfffffff", "TimeUS,I,DesRoll,Roll,DesPitch,Pitch,DesYawB,YawB,YawE"),
}
PACKED = {"Q": "Q", "B": "B", "I": "I", "H": "H", "c": "h", "C": "H", "L": "i", "e": "i", "f": "f"}
SCALES = {"c": 100, "C": 100, "L": 10_000_000, "e": 100}


def make_dataflash(rows, *, text=False):
    """A log of ArduPilot with rows of a kind and its values, binary or as text."""
    kinds = [name for name in DATAFLASH if name == "FMT" or any(kind == name for kind, *_ in rows)]
    if text:
        lines = []
        for name in kinds:
            number, code, columns = DATAFLASH[name]
            size = 89 if name == "FMT" else 3 + struct.calcsize("<" + "".join(PACKED[c] for c in code))
            lines.append(f"FMT, {number}, {size}, {name}, {code}, {columns}")
        lines += [", ".join(map(str, row)) for row in rows]
        return ("\n".join(lines) + "\n").encode()
    found = b""
    for name in kinds:
        number, code, columns = DATAFLASH[name]
        size = 89 if name == "FMT" else 3 + struct.calcsize("<" + "".join(PACKED[c] for c in code))
        told = struct.pack("<BB4s16s64s", number, size, name.encode(), code.encode(), columns.encode())
        found += b"\xa3\x95\x80" + told
    for kind, *values in rows:
        number, code, _ = DATAFLASH[kind]
        scaled = [round(v * SCALES[c]) if c in SCALES else v for c, v in zip(code, values, strict=True)]
        found += b"\xa3\x95" + struct.pack("<B" + "".join(PACKED[c] for c in code), number, *scaled)
    return found


def find_angles(quaternions):
    """Yaw, pitch and roll (N, 3) deg of a gimbal, of attitudes (N, 4) of images; straight down, roll is zero."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of straight down
        first, second, third = Rotation.from_quat(quaternions).as_euler("ZXZ").T
    return np.asarray(np.degrees(np.column_stack([-first, second - math.pi / 2, -third])))


def write_srt_flight(recording, folder):
    """The files of a flight as `write_csv` has them, but with latitude and longitude, and subtitles for poses."""
    write_csv(recording, folder)
    (folder / "poses.csv").unlink()
    for uav in range(recording.uav_count):
        _write_srt(recording, uav, folder / f"uav{uav}.srt")
    for path in (folder / f"{name}.csv" for name in ("detections", "trees", "truth")):
        if path.exists():
            header, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
            first = header.index("x_m")
            placed = [row for row in rows if row[first]]
            places = np.array([row[first : first + 2] for row in placed], dtype=float).reshape(-1, 2)
            for row, place in zip(placed, recording.setting.geo.find_degrees(places).tolist(), strict=True):
                row[first : first + 2] = map(repr, place)
            write_table(path, [*header[:first], "latitude", "longitude", *header[first + 2 :]], rows)


def _write_srt(recording, uav, path):
    """Write where a UAV believes its camera to be, a block for each frame."""
    frames = np.flatnonzero(recording.frames_taken[:, uav])
    poses = recording.believed_cameras[frames, uav]
    degrees, angles = recording.setting.geo.find_degrees(poses[:, :2]), find_angles(poses[:, 3:]).round(5) + 0.0
    starts = recording.times[frames].tolist()
    ends = [*starts[1:], starts[-1] + 1 / recording.setting.rates.sensing] if starts else []
    blocks = [
        f"{n}\n{_spell_cue(start)} --> {_spell_cue(end)}\n"
        f"[latitude: {latitude:.9f}] [longitude: {longitude:.9f}] [rel_alt: {pose[2]:.4f}] "
        f"[gb_yaw: {yaw:.5f} gb_pitch: {pitch:.5f} gb_roll: {roll:.5f}]\n\n"
        for n, (start, end, pose, (latitude, longitude), (yaw, pitch, roll)) in enumerate(
            zip(starts, ends, poses, degrees, angles, strict=True), 1
        )
    ]
    path.write_text("".join(blocks), encoding="utf-8")


def _spell_cue(time):
    whole, parts = divmod(round(1000 * time), 1000)
    return f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d},{parts:03d}"
