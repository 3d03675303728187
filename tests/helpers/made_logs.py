"""Logs of drones as their formats are documented, made of a few values."""

import struct

ULOG = {
    "vehicle_local_position": (
        "uint64_t timestamp;double ref_lat;double ref_lon;float x;float y;float z;bool xy_global;"
    ),
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t time_utc_usec;",
    "home_position": "uint64_t timestamp;float z;",
    "gimbal_device_attitude_status": "uint64_t timestamp;float[4] q;uint16_t device_flags;",
}
CODES = {"uint64_t": "Q", "double": "d", "float": "f", "bool": "?", "uint16_t": "H", "float[4]": "4f"}


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
