"""Sequences of MOTChallenge: detections and people of each frame, in images or on the ground; and our tracks."""

import configparser
import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from sim.exchange.csv_files import write_table
from sim.exchange.values import (
    CameraFrames,
    Columns,
    LoggedDetection,
    LoggedFrame,
    list_measurements,
    list_rows,
    list_tracks,
    list_truth,
)
from sim.mission.recording import Recording
from sim.scenario.csv_tables import TableRow, read_csv
from sim.scenario.quantities import parse_number
from sim.scenario.text_files import read_text
from tracking.errors import InputError, one_line, spell
from tracking.numerics.arrays import Flags, Indices

_COLUMNS = ("frame", "id", "left", "top", "width", "height", "confidence", "x", "y", "z")
# Names of classes by number, which may be in column x: of detectors, which alone count from 0, and of data sets.
_DETECTORS = {"0": "person"}
_MOTCHALLENGE = (
    *("", "pedestrian", "person on vehicle", "car", "bicycle", "motorbike", "non-motorised vehicle"),
    *("static person", "distractor", "occluder", "occluder on the ground", "full occluder", "reflection", "crowd"),
)
_VISDRONE = (
    *("ignored region", "pedestrian", "people", "bicycle", "car", "van", "truck", "tricycle", "awning-tricycle"),
    *("bus", "motor", "others"),
)
_MOST = 10_000_000  # frames
_FLAGS = {-1, 0, 1, 2}  # of VisDrone's truncation and occlusion


def find_sequences(folder: Path) -> dict[int, Path]:
    """The folders of sequences by UAV: the folder itself, or uav0, uav1 and so on in it; empty if there are none."""
    if (folder / "det" / "det.txt").exists():
        return {0: folder}
    found = sorted(path.parent.parent for path in folder.glob("uav*/det/det.txt"))
    return {int(path.name[3:]): path for path in found if path.name[3:].isdigit()}


def read_sequences(folder: Path) -> dict[int, CameraFrames]:
    """Frames of the sequence of each UAV."""
    return {uav: read_sequence(path) for uav, path in find_sequences(folder).items()}


def read_sequence(folder: Path) -> CameraFrames:
    """Frames of a sequence with `det/det.txt`, `seqinfo.ini` and maybe `gt/gt.txt`, the first at 0 s.

    Frames count from 1, and each up to the last, also without a row, was taken; rows after `seqLength` are left out. A
    row is a box in the image, whose middle is the person's, or with a box of -1 a place x, y on the ground. In place
    of x, y, z there may be classes, as `_find_classes` says. In `gt.txt` confidences of zero are left out. InputError
    says what to change.
    """
    info = folder / "seqinfo.ini"
    parser = configparser.ConfigParser()
    try:
        parser.read_string(read_text(info, "seqinfo"))
        facts = {key: parse_number(text) for key, text in parser["Sequence"].items()}
    except (configparser.Error, KeyError) as error:
        raise InputError(f"seqinfo: {info}: has no readable table [Sequence]: {one_line(error)}") from error
    rate = facts.get("framerate", 0.0)
    if not rate > 0:
        raise InputError(f"seqinfo: {info}: frameRate is missing; expected the number of frames in a second")
    found, names = _read_rows(folder / "det" / "det.txt", "detections")
    truth = folder / "gt" / "gt.txt"
    people, names_in_truth = _read_rows(truth, "truth") if truth.exists() else ({}, {})
    for key in ("seqlength", "imwidth", "imheight"):
        if not 0 <= facts.get(key, 0) <= _MOST:
            raise InputError(f"seqinfo: {info}: {key} is no number from 0 to {_MOST}")
    last = int(facts.get("seqlength", 0)) or max([*found, *people], default=0)
    if last == 0:
        raise InputError(f"detections: {folder / 'det' / 'det.txt'}: holds no frame")
    counts = {name: sum(len(own[k]) for k in own if k > last) for name, own in (("det", found), ("gt", people))}
    late = " and ".join(f"{count} of {name}.txt" for name, count in counts.items() if count)
    after = f"seqinfo: {info}: left out: rows after frame {last}, which is seqLength: {late}"
    if found and min(found) > last:
        raise InputError(f"{after}; so no detection is left")
    size = (int(facts["imwidth"]), int(facts["imheight"])) if {"imwidth", "imheight"} <= {*facts} else None

    def make_frame(number: int, detections: list[LoggedDetection]) -> LoggedFrame:
        return LoggedFrame((number - 1) / rate, f"detections: {folder}, frame {number}", detections)

    return CameraFrames(
        frames=[make_frame(number, found.get(number, [])) for number in range(1, last + 1)],
        people=[make_frame(number, people[number]) for number in sorted(people) if number <= last],
        size=size,
        categories=names_in_truth | names,
        remarks=(after,) if late else (),
    )


def _read_rows(path: Path, field: str) -> tuple[dict[int, list[LoggedDetection]], dict[str, str]]:
    """Rows of a text file by frame, and the names of their classes by number."""
    found: defaultdict[int, list[LoggedDetection]] = defaultdict(list)
    seen: dict[tuple[str, str, str], int] = {}
    text = read_text(path, field)
    if not text.strip():
        return found, {}
    count = text.lstrip().partition("\n")[0].count(",") + 1
    if not 7 <= count <= 10:
        raise InputError(f"{field}: {path}, line 1: has {count} entries; expected 7 to 10, as {','.join(_COLUMNS)}")
    rows = list(read_csv(path, field, _COLUMNS[:count], nameless=True))
    names = _find_classes(rows)
    for row in rows:
        confidence = row.number("confidence")
        if field == "truth" and not confidence:
            continue
        frame, person = row.number("frame"), row.text("id")
        if not 1 <= frame <= _MOST or frame != int(frame):
            raise row.error("frame", f"{spell(frame)} is not allowed; frames count from 1, to {_MOST} at most")
        number = "" if names is None else f"{row.number('x'):.0f}"
        category = "" if number == "-1" else (names or {}).get(number, number)
        key = (f"{frame:.0f}", person, category)
        if field == "truth" and (line := seen.setdefault(key, row.line)) != row.line:
            raise row.error("id", f"{person} has another row of this frame in line {line}")
        score = math.nan if confidence == -1 else confidence
        detection = LoggedDetection(person=person, category=category, score=score)
        found[int(frame)].append(_place(detection, row, classed=names is not None))
    return found, names or {}


def _find_classes(rows: Sequence[TableRow]) -> dict[str, str] | None:
    """Names of classes by number, as far as known, if column x is that of the class of a box; None if it is not.

    Ten columns end with VisDrone's class and flags, or a place, or -1; eight or nine end with MOTChallenge's class.
    """
    width, x, y, z = ({parse_number(row.values.get(name, "-1")) for row in rows} for name in ("width", "x", "y", "z"))
    if max(width) <= 0 or not all(number.is_integer() for number in x) or min(x) < -1 or max(x) < 0:
        return None
    whole, flags = "z" in rows[0].values, y | z
    if whole and not (flags <= _FLAGS and (max(x) > 0 or flags == {-1})):
        return None
    if 0 in x and (flags == {-1} or not whole):
        return _DETECTORS
    names = _VISDRONE if whole else _MOTCHALLENGE
    return {str(number): name for number, name in enumerate(names)} if max(x) < len(names) else {}


def _place(detection: LoggedDetection, row: TableRow, *, classed: bool) -> LoggedDetection:
    """A detection with the middle of its box in the image, whose first pixel has the coordinates 1, or on the ground.

    It gets neither if the box has no size. classed: whether there is a class in place of x, y, z.
    """
    left, top, width, height = (row.number(name) for name in _COLUMNS[2:6])
    if width > 0 and height > 0:
        return detection._replace(pixel=(left - 1 + width / 2, top - 1 + height / 2))
    place = [row.number(name) for name in _COLUMNS[7:] if name in row.values and not classed]
    if len(place) > 1 and place != [-1, -1, -1]:
        return detection._replace(place=(place[0], place[1]))
    if (width, height) == (-1, -1):
        raise row.error("width", "a box of -1 × -1 pixels is none, and there is no place x, y on the ground")
    return detection


def write_mot(recording: Recording, folder: Path) -> None:
    """Files in MOTChallenge's 3-D text format: a sequence for each UAV, boxes -1, positions on the ground in m."""
    truth = list_truth(recording)
    found = list_measurements(recording)
    tracks = list_tracks(recording)
    for uav, settings in enumerate(recording.setting.uavs):
        sequence = folder / f"uav{uav}"
        write_table(sequence / "gt" / "gt.txt", (), _list_rows(truth, truth["person"] + 1))
        seen = found["uav"] == uav
        write_table(sequence / "det" / "det.txt", (), _list_rows(found, np.full(len(seen), -1), seen))
        reported = (tracks["uav"] == uav) & tracks["reported"]
        write_table(folder / "tracks" / f"uav{uav}.txt", (), _list_rows(tracks, tracks["id"] + 1, reported))
        width, height = settings.true_camera.size
        facts = [f"name=uav{uav}", "imDir=img1", f"frameRate={recording.setting.rates.sensing}"]
        facts += [f"seqLength={len(recording.times)}", f"imWidth={width}", f"imHeight={height}", "imExt=.png"]
        (sequence / "seqinfo.ini").write_text("\n".join(["[Sequence]", *facts]) + "\n", encoding="utf-8")


def _list_rows(table: Columns, ids: Indices, where: Flags | None = None) -> Iterator[list[float]]:
    """Rows of frame (from 1), id (from 1, or -1), box -1, confidence 1, position on the ground."""
    for k, id_, x, y in list_rows({**table, "id": ids}, ("scan", "id", "x", "y"), where):
        yield [k + 1, id_, -1, -1, -1, -1, 1, x, y, 0]
