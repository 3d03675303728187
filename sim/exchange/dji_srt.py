"""Subtitles in which DJI's drones log their flight, in the dialects of many models."""

import csv
import math
import re
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from sim.exchange.csv_files import write_csv, write_table
from sim.exchange.values import DroneLog, find_angles
from sim.mission.recording import Recording
from sim.scenario.text_files import read_text
from tracking.errors import InputError, spell

_BLOCK = re.compile(r"(?m)^\s*\d+\s*\n(?=\s*\d+:\d\d:\d\d[,.]\d+\s*-->|\s*\d{4}[-.]\d)")
_CUE = re.compile(r"(\d+):(\d\d):(\d\d)[,.](\d{1,3})")
_DATE = re.compile(r"(\d{4})[-.](\d{1,2})[-.](\d{1,2}) (\d\d):(\d\d):(\d\d)(?:[.,](\d{1,3}))?")
_PAIR = re.compile(r"([A-Za-z]\w*)\s*:\s*(-?\d+\.?\d*)(?=[^\d.])")  # with a number that is not cut off
_GPS = re.compile(r"GPS\s*\(\s*(-?[\d.]+)\s*,\s*(-?[\d.]+)\s*,\s*-?[\d.]+\s*(M?)\s*\)")
_PITCH_ROLL_YAW = re.compile(r"G\.PRY\s*\(\s*(-?[\d.]+)\D*?,\s*(-?[\d.]+)\D*?,\s*(-?[\d.]+)\D*?\)")
_HEIGHT = re.compile(r"\bH\s+(-?[\d.]+)\s*m\b")
# Beginnings of the keys of a row: place, misspelt by some models; angles; heights above the start, and above the sea.
_KEYS = ("lat", "lon", r"(gb|gimbal)_yaw", r"(gb|gimbal)_pitch", r"(gb|gimbal)_roll")
_KEYS = (*_KEYS, "rel_alt|barometer|h[bs]$", "abs_alt|altitude")
_HUNDREDFOLD, _TENFOLD = 1000.0, 100.0  # least focal lengths, without a decimal point, of hundredths and tenths of mm


def read_srt(path: Path) -> DroneLog:
    """DJI's subtitles, with times of the video; a block that is broken, or has no fix, is left out."""
    text = read_text(path, "log").replace("\r\n", "\n")
    blocks = [block for block in _BLOCK.split(text)[1:] if block.strip()]
    rows, ends = [], [0.0]
    for block in blocks:
        cues = [3600 * int(h) + 60 * int(m) + int(s) + float(f"0.{f}") for h, m, s, f in _CUE.findall(block)]
        stamp = _read_date(block)
        values = _read_values(block)
        own = [next((n for name, n in values.items() if re.match(key, name)), math.nan) for key in _KEYS]
        if "-->" in block:
            ends.append(cues[1])
        time = cues[0] if "-->" in block else stamp
        if not math.isnan(time + own[0] + own[1]) and (own[0], own[1]) != (0.0, 0.0):
            rows.append([time, stamp - time, values.get("focal_len", math.nan), *own])
    if not rows:
        raise InputError(f"log: {path}: has no latitude and longitude; switch on video captions, or give poses.csv")
    times, epochs, focal, *columns = np.array(rows).T
    remarks = []
    if lost := len(blocks) - len(rows):
        remarks.append(f"log: {path}: left out: {lost} of {len(blocks)} blocks, broken or without a fix")
    if np.nanmax(focal, initial=0.0) > np.nanmin(focal, initial=math.inf):
        zoomed = f"the focal length is from {spell(np.nanmin(focal))} to {spell(np.nanmax(focal))} mm"
        remarks.append(f"log: {path}: {zoomed}; cameras.csv gives one camera for all frames")
    above = "sea" if np.isnan(columns[5]).all() else "start"
    filmed = len(ends) > 1
    return DroneLog(
        times=times if filmed else times - times[0],
        places=np.column_stack(columns[:2]),
        heights=columns[6 if above == "sea" else 5],
        attitudes=np.column_stack(columns[2:5]),
        above=above,
        epoch=float(np.nanmedian(epochs))
        if filmed and not np.isnan(epochs).all()
        else math.nan
        if filmed
        else times[0],
        film=(0.0, max(ends)) if filmed else None,
        focal=math.nan if np.isnan(focal).all() else float(np.nanmedian(focal)),
        remarks=tuple(remarks),
    )


def _read_date(block: str) -> float:
    """Time since 1970 [s] by the drone's clock, taken to be of UTC; NaN if there is none."""
    if not (found := _DATE.search(block)):
        return math.nan
    try:
        return datetime(*map(int, found.groups()[:6]), tzinfo=timezone.utc).timestamp() + float(f"0.{found[7] or 0}")
    except ValueError:
        return math.nan


def _read_values(block: str) -> dict[str, float]:
    """Numbers of a block by their keys in small letters; the focal length is in mm."""
    values = {}
    for name, text in _PAIR.findall(block):
        values[name.lower()] = value = float(text)
        if name == "focal_len" and "." not in text:
            values[name] = value / (100 if value >= _HUNDREDFOLD else 10 if value >= _TENFOLD else 1)
    if gps := _GPS.search(block):
        # With a height in M, as of Matrice, latitude is first.
        values["lat"], values["lon"] = (float(gps[n]) for n in ((1, 2) if gps[3] else (2, 1)))
    if height := _HEIGHT.search(block):
        values["rel_alt"] = float(height[1])
    if angles := _PITCH_ROLL_YAW.search(block):
        values |= zip(("gb_pitch", "gb_roll", "gb_yaw"), map(float, angles.groups()), strict=True)
    return values


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


def _spell_cue(time: float) -> str:
    whole, parts = divmod(round(1000 * time), 1000)
    return f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d},{parts:03d}"
