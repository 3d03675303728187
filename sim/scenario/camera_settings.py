"""Cameras of scenarios as they are sold: settings, packaged files, and files of ROS."""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import yaml
from msgspec import Meta, Struct

from sim.installation import ASSETS
from sim.scenario.text_files import find_toml_file, read_text, read_toml
from tracking.errors import InputError
from tracking.geometry.camera import Camera
from tracking.geometry.distortion import Distortion, distort, find_reach
from tracking.geometry.lens import Optics, plane_point
from tracking.numerics.trigonometry import arctan2, tan
from tracking.settings import read_settings

CAMERAS = {path.stem: path for path in sorted((ASSETS / "cameras").glob("*.toml"))}
_MODELS = ("plumb_bob", "rational_polynomial")  # names of distortion models with the same first five coefficients
_MOST = 4096  # pixels along an edge
_LEAST = 16
_CENTRE = 0.5  # pixels, place of the centre of the first pixel; in calibrations it is 0

Pixels = Annotated[float, Meta(gt=0, le=1e5)]
Place = Annotated[float, Meta(ge=-1e5, le=1e5)]
Coefficients = Annotated[tuple[Annotated[float, Meta(ge=-1e4, le=1e4)], ...], Meta(max_length=5)]


class Belief(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What a fleet believes of a camera, as far as it differs from the truth."""

    focal: tuple[Pixels, Pixels] | None = None
    centre: tuple[Place, Place] | None = None
    distortion: Coefficients | None = None


class CameraSettings(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A camera by its calibration, as of OpenCV, or by its horizontal angle of view."""

    width: Annotated[int, Meta(ge=_LEAST, le=20_000)]  # pixels
    height: Annotated[int, Meta(ge=_LEAST, le=20_000)]  # pixels
    # deg, between the lines of sight through both ends of the middle row
    hfov_deg: Annotated[float, Meta(ge=1, lt=170)] | None = None
    focal: tuple[Pixels, Pixels] | None = None  # pixels, `[fx, fy]`, instead of `hfov_deg`
    # pixels, principal point `[cx, cy]`, counted as in OpenCV: the centre of the first pixel is 0, 0; by default the
    # middle of the image
    centre: tuple[Place, Place] | None = None
    distortion: Coefficients = ()  # k1, k2, p1, p2, k3, as in OpenCV; those left out are 0
    scale: Annotated[float, Meta(gt=0, le=1)] = 1.0  # size of delivered images as a share of the calibrated ones
    # s, rolling shutter: time from the exposure of the first row to that of the last; the middle row is exposed at the
    # time of the frame
    readout: Annotated[float, Meta(ge=0, le=1)] = 0.0
    # `focal`, `centre` and `distortion` as the fleet believes them, where they differ from the truth
    believed: Belief | None = None
    source: str = ""  # where the figures come from

    def __post_init__(self) -> None:
        if (self.focal is None) == (self.hfov_deg is None):
            raise ValueError("hfov_deg and focal: one of them is needed, and determines the other")
        for edge in _scale_size(self):
            if not _LEAST <= edge <= _MOST:
                raise ValueError(
                    f"scale: {self.scale:g} gives images of {edge} pixels; allowed are {_LEAST} to {_MOST}"
                )
        make_camera(self)
        try:
            make_camera(self, believed=True)
        except ValueError as error:
            raise ValueError(f"believed: {error}") from error


@lru_cache(256)
def make_camera(settings: CameraSettings, *, believed: bool = False) -> Camera:
    """The camera of settings, as it is or as the fleet believes it to be; ValueError if there is no such camera."""
    width, height = settings.width, settings.height
    belief = settings.believed if believed and settings.believed else Belief()
    given = settings.distortion if belief.distortion is None else belief.distortion
    bend = Distortion(*given)
    focal = belief.focal or settings.focal or (_find_focal(settings),) * 2
    cx, cy = belief.centre or settings.centre or (width / 2 - _CENTRE, height / 2 - _CENTRE)
    size = _scale_size(settings)
    across, down = size[0] / width, size[1] / height
    lengths = (focal[0] * across, focal[1] * down)
    centre = ((cx + _CENTRE) * across, (cy + _CENTRE) * down)
    return Camera.calibrated(*size, lengths, centre, bend)


def _find_focal(settings: CameraSettings) -> float:
    """The focal length [pixel] with which the middle row spans `hfov_deg`; ValueError if the lens folds before."""
    bend, angle = Distortion(*settings.distortion), math.radians(settings.hfov_deg or 0.0)
    width, height, reach = settings.width, settings.height, find_reach(bend)
    if settings.centre is None and bend.p1 == bend.p2 == 0.0:
        slope = tan(angle / 2)
        if slope * slope <= reach or reach == 0.0:
            return width / 2 / distort(bend, slope, 0.0)[0]
    else:
        cx, cy = settings.centre or (width / 2 - _CENTRE, height / 2 - _CENTRE)
        low, high, spans = 0.0, 1e7, math.nan
        for _ in range(100):  # a view beyond the reach of the lens is NaN, and too wide
            focal = (low + high) / 2
            optics = Optics(focal, focal, cx + _CENTRE, cy + _CENTRE, width, height, bend, reach)
            (a, b), (x, y) = (plane_point(optics, end, height / 2) for end in (0.0, float(width)))
            across = math.sqrt((b - y) * (b - y) + (x - a) * (x - a) + (a * y - b * x) * (a * y - b * x))
            spans = arctan2(across, 1.0 + a * x + b * y)
            low, high = (low, focal) if spans <= angle else (focal, high)
        if math.isclose(spans, angle, rel_tol=1e-6):
            return focal
        if reach == 0.0:
            allowed = "expected one in the image, or focal in its place"
            raise ValueError(f"centre: {[cx, cy]} spans no hfov_deg of {settings.hfov_deg:g}; {allowed}")
    raise ValueError(f"distortion: {list(settings.distortion)} folds the image over; expected less of it")


def _scale_size(settings: CameraSettings) -> tuple[int, int]:
    return round(settings.scale * settings.width), round(settings.scale * settings.height)


def read_camera(name: str) -> CameraSettings:
    """A packaged camera, or that of a TOML file or of ROS's camera_info in YAML; InputError if there is none."""
    if name.endswith((".yaml", ".yml")):
        path = Path(name)
        data = _read_camera_info(path)
    else:
        path = find_toml_file(name, CAMERAS, "camera")
        data = read_toml(path, "camera")
    try:
        return read_settings(data, CameraSettings)
    except InputError as error:
        raise InputError(f"camera: {path}: {error}") from error


def _read_camera_info(path: Path) -> dict[str, Any]:
    """The settings of a camera_info file, as camera_calibration writes it."""
    where = f"camera: {path}"
    try:
        found = yaml.safe_load(read_text(path, "camera"))
    except (yaml.YAMLError, RecursionError) as error:
        raise InputError(f"{where}: is no YAML: {' '.join(str(error).split())}") from error
    if not isinstance(found, Mapping):
        raise InputError(f"{where}: has no keys; expected those of a camera_info file")
    matrix = _read_numbers(found, "camera_matrix", where, 9)
    bend = _read_numbers(found, "distortion_coefficients", where, 0)
    try:
        size = found.get("image_width"), found.get("image_height")
        return _describe(size, matrix, bend, found.get("distortion_model"))
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def calibrate(size: tuple[int, int], matrix: Sequence[float], bend: Sequence[float], model: str) -> CameraSettings:
    """The camera of ROS's CameraInfo, by its K (9,), D and distortion model; ValueError if it is none."""
    return read_settings(_describe(size, matrix, bend, model), CameraSettings)


def _describe(
    size: tuple[object, object], matrix: Sequence[float], bend: Sequence[float], model: object
) -> dict[str, Any]:
    if model and model not in _MODELS:
        raise ValueError(f"distortion_model: {model!r} is not allowed; expected plumb_bob")
    if any(bend[5:]):
        raise ValueError(f"distortion_coefficients: {list(bend)} has more than k1, k2, p1, p2, k3")
    fx, skew, cx, _, fy, cy, *_ = matrix
    if not (fx > 0 and fy > 0 and skew == 0):
        wrong = f"{list(matrix)} is singular or skew"
        raise ValueError(f"camera_matrix: {wrong}; expected fx, 0, cx, 0, fy, cy, 0, 0, 1")
    found = {"focal": [fx, fy], "centre": [cx, cy], "distortion": list(bend[:5])}
    return {"width": size[0], "height": size[1], **found}


def _read_numbers(found: Mapping[str, Any], key: str, where: str, count: int) -> list[float]:
    """The numbers of a matrix; so many, if `count` is not 0."""
    table = found.get(key)
    data = table.get("data") if isinstance(table, Mapping) else table
    if not (isinstance(data, list) and all(isinstance(x, int | float) and math.isfinite(x) for x in data)):
        raise InputError(f"{where}: {key}: its data are not a list of finite numbers")
    if count and len(data) != count:
        raise InputError(f"{where}: {key}: its data are {len(data)} numbers; expected {count}")
    return [float(x) for x in data]
