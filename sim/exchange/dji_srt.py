"""Subtitles in which DJI's drones log their flight, in the dialects of many models."""

import math
import re
from datetime import datetime
from pathlib import Path

import numpy as np

from sim.exchange.values import DroneLog
from sim.scenario.text_files import read_text
from tracking.errors import InputError, spell
from tracking.numerics.arrays import Array

_BLOCK = re.compile(r"(?m)^\s*\d+\s*\n(?=\s*\d+:\d\d:\d\d[,.]\d+\s*-->|\s*\d{4}[-.]\d)")
_CUE = re.compile(r"(\d+):(\d\d):(\d\d)[,.](\d{1,3})")
_DATE = re.compile(r"(\d{4})[-.](\d{1,2})[-.](\d{1,2}) (\d\d):(\d\d):(\d\d)(?:[.,](\d{1,3}))?")
_PAIR = re.compile(r"([A-Za-z]\w*)\s*:\s*(-?\d+\.?\d*)(?=[^\d.])")  # with a number that is not cut off
_GPS = re.compile(r"GPS\s*\(\s*(-?[\d.]+)\s*,\s*(-?[\d.]+)\s*,\s*-?[\d.]+\s*(M?)\s*\)")
_PITCH_ROLL_YAW = re.compile(r"G\.PRY\s*\(\s*(-?[\d.]+)\D*?,\s*(-?[\d.]+)\D*?,\s*(-?[\d.]+)\D*?\)")
_HEIGHT = re.compile(r"\bH\s+(-?[\d.]+)\s*m\b")
# Beginnings of the keys of a row: place, misspelt by some models; angles; heights above the start, and above the sea.
_KEYS = (
    *("lat", "lon", "(gb|gimbal)_yaw", "(gb|gimbal)_pitch", "(gb|gimbal)_roll"),
    *("rel_alt|barometer|h[bs]$", "abs_alt|altitude"),
)
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
        if "-->" in block and len(cues) < 2:
            continue
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
        path=path,
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
        focal=_find_median(focal),
        remarks=tuple(remarks),
    )


def _find_median(values: Array) -> float:
    return math.nan if np.isnan(values).all() else float(np.nanmedian(values))


def _read_date(block: str) -> float:
    """Time since 1970 [s] by the drone's clock, taken to be of UTC; NaN if there is none."""
    if not (found := _DATE.search(block)):
        return math.nan
    try:
        whole = datetime.strptime(" ".join(found.groups()[:6]) + " +0000", "%Y %m %d %H %M %S %z")
        return whole.timestamp() + float(f"0.{found[7] or 0}")
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
