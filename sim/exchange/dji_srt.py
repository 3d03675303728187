"""Subtitles in which DJI's drones log their flight, in the dialects of many models."""

import csv
import math
import re
from collections.abc import Mapping
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from sim.exchange.csv_files import write_csv, write_table
from sim.exchange.values import DroneLog, find_angles
from sim.mission.recording import Recording
from sim.scenario.text_files import read_text
from tracking.errors import InputError, spell
from tracking.numerics.arrays import Array

_BLOCK = re.compile(r"(?m)^\s*\d+\s*\n(?=\s*\d+:\d\d:\d\d[,.]\d+\s*-->|\s*\d{4}[-.]\d)")
_CUE = re.compile(r"(\d+):(\d\d):(\d\d)[,.](\d{1,3})\s*-->\s*(\d+):(\d\d):(\d\d)[,.](\d{1,3})")
_DATE = re.compile(r"(\d{4})[-.](\d{1,2})[-.](\d{1,2}) (\d\d):(\d\d):(\d\d)(?:[.,](\d{1,3}))?")
_PAIR = re.compile(r"([A-Za-z][A-Za-z_.0-9]*)\s*:\s*(-?\d+\.?\d*)(?=[^\d.])")  # a number that is not cut off
_GPS = re.compile(r"GPS\s*\(\s*(-?[\d.]+)\s*,\s*(-?[\d.]+)\s*,\s*-?[\d.]+\s*(M?)\s*\)")
_PITCH_ROLL_YAW = re.compile(r"G\.PRY\s*\(\s*(-?[\d.]+)\D*?,\s*(-?[\d.]+)\D*?,\s*(-?[\d.]+)\D*?\)")
_HEIGHT = re.compile(r"\bH\s+(-?[\d.]+)\s*m\b")
_ABOVE_START = ("rel_alt", "barometer", "hb", "hs")
_ABOVE_SEA = ("abs_alt", "altitude")
_ANGLES = (("gb_yaw", "gimbal_yaw"), ("gb_pitch", "gimbal_pitch"), ("gb_roll", "gimbal_roll"))
_HUNDREDFOLD, _TENFOLD = 1000.0, 100.0  # least focal lengths, without a decimal point, of hundredths and tenths of mm


def read_srt(path: Path) -> DroneLog:
    """DJI's subtitles, with times of the video; a block that is broken, or has no fix, is left out."""
    text = read_text(path, "log").replace("\r\n", "\n")
    blocks = [block for block in _BLOCK.split(text)[1:] if block.strip()]
    rows, heights, focal, epochs, ends = [], [], list[float](), list[float](), list[float]()
    for block in blocks:
        time, stamp = _read_times(block, ends)
        values = {name.lower(): number for name, number in _PAIR.findall(block)}
        place = _read_place(block, values)
        if math.isnan(time + place[0] + place[1]):
            continue
        epochs += [stamp - time] * (not math.isnan(stamp))
        rows.append([time, *place, *_read_angles(block, values)])
        heights.append(_read_heights(block, values))
        focal += [_read_focal(text) for name, text in values.items() if name == "focal_len"]
    if not rows:
        raise InputError(f"log: {path}: has no latitude and longitude; switch on video captions, or give poses.csv")
    table, levels = np.array(rows), np.array(heights)
    column = 0 if np.isfinite(levels[:, 0]).any() else 1
    remarks = []
    if lost := len(blocks) - len(rows):
        remarks.append(f"log: {path}: left out: {lost} of {len(blocks)} blocks, broken or without a fix")
    if focal and max(focal) > min(focal):
        zoomed = f"the focal length is from {spell(min(focal))} to {spell(max(focal))} mm"
        remarks.append(f"log: {path}: {zoomed}; cameras.csv gives one camera for all frames")
    return DroneLog(
        times=table[:, 0],
        places=table[:, 1:3],
        heights=levels[:, column],
        attitudes=table[:, 3:],
        above=("start", "sea")[column],
        epoch=float(np.median(epochs)) if epochs else math.nan,
        film=(0.0, max(ends)) if ends else None,
        focal=float(np.median(focal)) if focal else math.nan,
        remarks=tuple(remarks),
    )


def _read_times(block: str, ends: list[float]) -> tuple[float, float]:
    """Time of the video [s], and that of the drone's clock since 1970, taken to be of UTC; NaN if there is none.

    The end of the block is appended to `ends`. Without a time of the video, it is the drone's.
    """
    stamp = math.nan
    if found := _DATE.search(block):
        year, month, day, hour, minute, second = map(int, found.groups()[:6])
        try:
            whole = datetime(year, month, day, hour, minute, second, tzinfo=timezone.utc)
        except ValueError:
            return math.nan, math.nan
        stamp = whole.timestamp() + float(f"0.{found[7] or 0}")
    if not (cue := _CUE.search(block)):
        return stamp, stamp
    begin, end = (
        3600 * int(h) + 60 * int(m) + int(s) + float(f"0.{f}") for h, m, s, f in (cue.groups()[:4], cue.groups()[4:])
    )
    ends.append(end)
    return begin, stamp


def _read_place(block: str, values: Mapping[str, str]) -> tuple[float, float]:
    """Latitude and longitude [deg]; NaN without a fix. Keys are misspelt in places."""
    if found := _GPS.search(block):
        first, second = float(found[1]), float(found[2])
        return (first, second) if found[3] else (second, first)  # with a height in M, as of Matrice, latitude is first
    parts = [next((float(n) for name, n in values.items() if name.startswith(key)), math.nan) for key in ("lat", "lon")]
    return (math.nan, math.nan) if parts == [0.0, 0.0] else (parts[0], parts[1])


def _read_heights(block: str, values: Mapping[str, str]) -> list[float]:
    """Heights [m] above the start and above the sea; NaN for those that are missing."""
    found = [
        next((float(values[name]) for name in names if name in values), math.nan)
        for names in (_ABOVE_START, _ABOVE_SEA)
    ]
    if own := _HEIGHT.search(block):
        found[0] = float(own[1])
    return found


def _read_angles(block: str, values: Mapping[str, str]) -> list[float]:
    """Yaw, pitch and roll [deg] of the gimbal; NaN for those that are missing."""
    if found := _PITCH_ROLL_YAW.search(block):
        return [float(found[3]), float(found[1]), float(found[2])]
    return [next((float(values[name]) for name in names if name in values), math.nan) for names in _ANGLES]


def _read_focal(text: str) -> float:
    """A focal length [mm], which models write in mm with a point, else in tenths or hundredths."""
    value = float(text)
    if "." in text:
        return value
    return value / 100 if value >= _HUNDREDFOLD else value / 10 if value >= _TENFOLD else value


def write_srt_flight(recording: Recording, folder: Path) -> None:
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


def _write_srt(recording: Recording, uav: int, path: Path) -> None:
    """Write where a UAV believes its camera to be, a block for each frame."""
    frames = np.flatnonzero(recording.frames_taken[:, uav])
    poses: Array = recording.believed_cameras[frames, uav]
    degrees, angles = recording.setting.geo.find_degrees(poses[:, :2]), find_angles(poses[:, 3:]).round(5) + 0.0
    blocks = []
    for n, k in enumerate(frames.tolist()):
        start = recording.times[k]
        end = recording.times[frames[n + 1]] if n + 1 < len(frames) else start + 1 / recording.setting.rates.sensing
        (latitude, longitude), (yaw, pitch, roll) = degrees[n], angles[n]
        blocks.append(
            f"{n + 1}\n{_spell_cue(start)} --> {_spell_cue(end)}\n"
            f"[latitude: {latitude:.9f}] [longitude: {longitude:.9f}] [rel_alt: {poses[n, 2]:.4f}] "
            f"[gb_yaw: {yaw:.5f} gb_pitch: {pitch:.5f} gb_roll: {roll:.5f}]\n\n"
        )
    path.write_text("".join(blocks), encoding="utf-8")


def _spell_cue(time: float) -> str:
    whole, parts = divmod(round(1000 * time), 1000)
    return f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d},{parts:03d}"
