"""Calibrations of cameras in files of ROS, OpenCV, Kalibr and COLMAP, told by their content."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

from sim.scenario.text_files import read_text
from tracking.errors import InputError, check_known
from tracking.geometry.distortion import MODELS

_EXPECTED = "expected a calibration of ROS, OpenCV, Kalibr or COLMAP"
_NOT_READ = {  # by lines of their texts, and what to give in their place
    r"#\s*3D point list": ("COLMAP's points3D.txt", "give cameras.txt"),
    r"#\s*Image list|\d+( +[-+.\deE]+){7} +\d+ +.*[A-Za-z]": ("COLMAP's images.txt", "give cameras.txt"),
    r"\s*accelerometer_noise_density": ("Kalibr's file of an IMU", "give the camchain"),
    r"\s*target_type": ("Kalibr's calibration target", "give the camchain"),
    r'.*"projection_type"': ("OpenSfM's or OpenDroneMap's cameras.json", _EXPECTED),
    r".*Pix4D": ("Pix4D's calibration", _EXPECTED),
    r"\s*<calibration>": ("Metashape's calibration", "export it in the format OpenCV"),
}
# Names of keys without capitals and all but letters and digits, of which the first in a file counts.
_WIDTH, _HEIGHT = ("imagewidth", "width", "camerawidth"), ("imageheight", "height", "cameraheight")
_SIZE = ("resolution", "cameraresolution", "imagesize", "imageresolution")
_MATRIX = ("cameramatrix", "k", "intrinsics", "intrinsicmatrix", "intrinsic", "mtx", "m")
_BEND = (
    *("distortioncoefficients", "distortioncoeffs", "distcoeffs", "distcoeff", "distortion", "dist", "d"),
    *("distortionparameters", "distortioncoefficient"),
)
_MODEL = ("distortionmodel", "cameramodel", "modeltype", "type", "distortiontype")
_APART = ("roi", "header")  # tables whose keys have other meanings
# Other names of models of distortion, spelt as keys are; pinhole alone says nothing of it.
_POLYNOMIAL = ("plumbbob", "rationalpolynomial", "radtan", "radialtangential", "brown", "brownconrady", "none", "")
_EQUIDISTANT = ("equidistant", "equi", "fisheye", "opencvfisheye", "kannalabrandt", "kannalabrandt8")
_PINHOLE = ("pinhole", "perspective")
_COLMAP = {  # its models, by their parameters
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
}
_COLMAP_LINE = re.compile(r"^[ \t]*(\d+)[ \t]+([A-Z][A-Z_]+)[ \t]+(\d+)[ \t]+(\d+)((?:[ \t]+[-+.\deE]+)+)[ \t]*$", re.M)
_INI_ENTRY = re.compile(r"^(width|height|camera matrix|distortion)[ \t]*\n((?:[-+.\deE \t]+\n)+)", re.M)
Fields = dict[str, Any]  # of a camera, by keys as those above


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """A reader of YAML with the matrices of OpenCV."""


_Loader.add_multi_constructor("tag:yaml.org,2002:opencv-", lambda reader, _, node: reader.construct_mapping(node, True))


def read_calibration(path: Path, name: str) -> dict[str, Any]:
    """Settings of a camera from a calibration file; InputError says what is wrong.

    name: of a camera of a file with several, such as `cam1`; empty for the only one.
    """
    where = f"camera: {path}"
    if path.suffix == ".bin":
        raise InputError(f"{where}: is binary; give cameras.txt, as colmap model_converter --output_type TXT writes it")
    text = read_text(path, "camera")
    for line, (what, instead) in _NOT_READ.items():
        if re.search(f"(?m)^{line}", text):
            raise InputError(f"{where}: this is {what}; {instead}")
    cameras = _list_cameras(text, where)
    if not cameras:
        raise InputError(f"{where}: has no camera_matrix; {_EXPECTED}")
    if not name and len(cameras) > 1:
        first = f"{path.name}#{next(iter(cameras))}"
        raise InputError(f"{where}: has the cameras {', '.join(cameras)}; name one, such as {first}")
    if name:
        check_known(f"{where}#", name, cameras)
    try:
        return _read_fields(cameras[name] if name else next(iter(cameras.values())))
    except (ValueError, TypeError, AttributeError) as error:
        raise InputError(f"{where}: {error}") from error


def describe(
    size: tuple[Any, Any],  # numbers, or None
    matrix: Sequence[float],
    bend: Sequence[float],
    model: object,
    region: Sequence[int] = (0, 0, 0, 0),
    binning: Sequence[int] = (1, 1),
) -> dict[str, Any]:
    """Settings of a camera by its camera matrix (9,), coefficients and distortion model; ValueError if it is none.

    Images have the region (x, y, width, height) of a calibrated image, all of it if these are 0, with squares of
    `binning` pixels as one.
    """
    fx, skew, cx, _, fy, cy, *_ = matrix
    if not (fx > 0 and fy > 0 and skew == 0):
        wrong = f"{list(matrix)} is singular or skew" if any(matrix) else "is all 0, so that nobody calibrated it"
        raise ValueError(f"camera_matrix: {wrong}; expected fx, 0, cx, 0, fy, cy, 0, 0, 1")
    if None in size:
        raise ValueError("has no size of images; add image_width and image_height to it")
    width, height = size
    x, y, across, down = region
    if any(region[2:]) or any(b > 1 for b in binning):
        across, down = across or width, down or height
        right, below = (max(1, b) for b in binning)
        if x + across > width or y + down > height:
            roi = f"roi of {across} × {down} pixels from ({x}, {y})"
            raise ValueError(f"{roi} is not in the image of {width} × {height}")
        # The matrix counts from the centre of the first pixel, which is in the middle of the squares that are one.
        cx, cy = (cx - x - (right - 1) / 2) / right, (cy - y - (below - 1) / 2) / below
        fx, fy, width, height = fx / right, fy / below, across // right, down // below
    return {"width": width, "height": height, "focal": [fx, fy], "centre": [cx, cy], **_name_model(bend, model)}


def _name_model(bend: Sequence[float], model: object) -> dict[str, Any]:
    spelt = _spell(str(model or ""))
    if spelt in _EQUIDISTANT:
        count, found = MODELS["equidistant"], {"distortion_model": "equidistant"}
    elif spelt in _POLYNOMIAL:
        rational = any(bend[MODELS["plumb_bob"] : MODELS["rational_polynomial"]])
        found = {"distortion_model": "rational_polynomial"} if rational else {}
        count = MODELS[found.get("distortion_model", "plumb_bob")]
    else:
        raise ValueError(f"distortion_model: {model!r} is not allowed; expected {', '.join(MODELS)}")
    if any(bend[count:]):
        known = "k1, k2, k3, k4" if spelt in _EQUIDISTANT else "k1, k2, p1, p2, k3, k4, k5, k6"
        raise ValueError(f"distortion_coefficients: {list(bend)} has more than {known}")
    return {"distortion": list(bend[:count]), **found}


def _spell(key: str) -> str:
    return re.sub("[^a-z0-9]", "", key.lower())


def _list_cameras(text: str, where: str) -> dict[str, Fields]:
    """The cameras of a file by their names, which is empty for the only one."""
    if text.lstrip().startswith("<"):
        return _find_cameras(_read_xml(text, where))
    if lines := _COLMAP_LINE.findall(text):
        return {name: _read_colmap(*line) for name, *line in lines}
    if "[image]" in text:
        sections = re.split(r"(?m)^\[image\]", text)[1:]
        names = [re.findall(r"(?m)^\[(.+)\]", section)[:1] for section in sections]
        tables = [{_spell(key): numbers.split() for key, numbers in _INI_ENTRY.findall(f"{s}\n")} for s in sections]
        return {name[0] if name else "": table for name, table in zip(names, tables, strict=True)}
    try:  # of a text with several documents, such as messages, the first one
        documents = yaml.load_all(re.sub(r"\A\s*%YAML.*", "", text), _Loader)
        found = next(filter(None, documents), None)
    except (yaml.YAMLError, RecursionError) as error:
        raise InputError(f"{where}: is no YAML: {' '.join(str(error).split())}") from error
    if not isinstance(found, Mapping):
        raise InputError(f"{where}: has no keys; expected those of a camera_info file")
    return _find_cameras(found)


def _read_xml(text: str, where: str) -> Fields:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError(f"{where}: is no XML: {error}") from error
    if root.tag != "opencv_storage":
        raise InputError(f"{where}: is XML of <{root.tag}>; expected <opencv_storage>, as OpenCV writes it")
    return {child.tag: _read_element(child) for child in root}


def _read_element(element: ElementTree.Element) -> object:
    if len(element):
        return {child.tag: _read_element(child) for child in element}
    text = (element.text or "").strip().strip('"')
    return text.split() if " " in text or "\n" in text else text


def _read_colmap(model: str, width: str, height: str, parameters: str) -> Fields:
    """A line of COLMAP, whose pixels count from the corner of the first one."""
    names, numbers = _COLMAP.get(model, "").split(), list(map(float, parameters.split()))
    named: Fields = {"width": width, "height": height, "distortionmodel": "fisheye" if "FISHEYE" in model else ""}
    if len(names) != len(numbers):
        return {**named, "k": [1.0, 1.0, 0.0, 0.0], "distortionmodel": f"COLMAP's {model} of {len(numbers)} parameters"}
    named |= zip(names, numbers, strict=True)
    return {**named, "cx": named["cx"] - 0.5, "cy": named["cy"] - 0.5}


def _find_cameras(found: Mapping[Any, Any]) -> dict[str, Fields]:
    """The camera whose fields a table has, or those of its tables, or those whose keys end with 1 and 2."""
    fields: Fields = {}
    cameras: dict[str, Fields] = {}
    for key, value in found.items():
        own = _spell(re.sub(r"^Camera\.", "", str(key)))
        if not isinstance(value, Mapping) or "data" in value or own in _APART:
            fields.setdefault(own, value)
            continue
        inner = _find_cameras(value).get("", {}) or {_spell(str(k)): v for k, v in value.items()}
        if _has_matrix(inner) and _find(inner, (*_WIDTH, *_SIZE)) is not None:
            cameras[str(key)] = inner
        else:
            fields = {**inner, **fields}
    if _has_matrix(fields):
        return {"": fields}
    pair = {n: {**fields, **{key[:-1]: v for key, v in fields.items() if key[-1:] == n}} for n in "12"}
    return cameras or {n: own for n, own in pair.items() if _has_matrix(own)}


def _has_matrix(fields: Fields) -> bool:
    return isinstance(_find(fields, _MATRIX), Mapping | list) or bool({"f", "fx"} & {*fields})


def _find(fields: Fields, names: Iterable[str]) -> Any:  # noqa: ANN401 - whatever a file has there
    return next((fields[name] for name in names if fields.get(name) is not None), None)


def _read_fields(fields: Fields) -> dict[str, Any]:
    matrix = _find(fields, _MATRIX)
    numbers = _read_numbers(matrix, "camera_matrix") if isinstance(matrix, Mapping | list) else []
    if not numbers:
        keys = ("fx" if "fx" in fields else "f", "cx", "fy" if "fy" in fields else "f", "cy")
        fx, cx, fy, cy = (_read_numbers([fields.get(key)], key)[0] for key in keys)
        numbers = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    if len(numbers) == 4:  # of Kalibr
        fx, fy, cx, cy = numbers
        numbers = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    if len(numbers) != 9:
        raise ValueError(f"camera_matrix: its data are {len(numbers)} numbers; expected 9")
    models = [fields[key] for key in _MODEL if fields.get(key) and _spell(str(fields[key])) not in _PINHOLE]
    unknown = [model for model in models if _spell(str(model)) not in (*_POLYNOMIAL, *_EQUIDISTANT)]
    model = "fisheye" if str(fields.get("fisheyemodel", 0)) not in ("0", "False") else (unknown or models or [""])[0]
    bend = _find(fields, _BEND)
    if bend is None:
        order = "k1 k2 k3 k4" if _spell(str(model)) in _EQUIDISTANT else "k1 k2 p1 p2 k3 k4 k5 k6"
        bend = [fields.get(key, 0.0) for key in order.split()]
    size = _find(fields, _SIZE) or [_find(fields, _WIDTH), _find(fields, _HEIGHT)]
    width, height = (None if edge is None else _read_whole(edge) for edge in size)
    roi, binning = fields.get("roi") or {}, (fields.get("binningx") or 1, fields.get("binningy") or 1)
    region = [int(roi.get(key, 0)) for key in ("x_offset", "y_offset", "width", "height")]
    return describe((width, height), numbers, _read_numbers(bend, "distortion_coefficients"), model, region, binning)


def _read_whole(edge: object) -> float:
    """A number of pixels, as a whole one if it is; settings refuse others."""
    number = _read_numbers([edge], "image_width and image_height")[0]
    return int(number) if number == int(number) else number


def _read_numbers(table: object, key: str) -> list[float]:
    """The numbers of a matrix, row by row."""
    data = table.get("data") if isinstance(table, Mapping) else table
    rows = data if isinstance(data, list) else [data]
    try:
        found = [float(x) for x in chain.from_iterable(row if isinstance(row, list) else [row] for row in rows)]
    except (TypeError, ValueError):
        found = [math.nan]
    if not all(map(math.isfinite, found)):
        raise ValueError(f"{key}: its data are not a list of finite numbers")
    return found
