"""Cameras of scenarios as they are sold: settings, packaged files, and calibrations."""

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct

from sim.installation import ASSETS
from sim.scenario.calibration_files import describe, read_calibration
from sim.scenario.text_files import find_toml_file, read_toml
from tracking.errors import InputError
from tracking.geometry.camera import Camera
from tracking.geometry.distortion import WIDEST, Distortion, distort, explain_fold, find_reach
from tracking.geometry.lens import Optics, plane_point
from tracking.numerics.trigonometry import arctan2, tan
from tracking.settings import read_settings

CAMERAS = {path.stem: path for path in sorted((ASSETS / "cameras").glob("*.toml"))}
_MOST = 10_000  # pixels along an edge
_LEAST = 16
_CENTRE = 0.5  # pixels, place of the centre of the first pixel; in calibrations it is 0

Pixels = Annotated[float, Meta(gt=0, le=1e5)]
Place = Annotated[float, Meta(ge=-1e5, le=1e5)]
Coefficients = Annotated[tuple[Annotated[float, Meta(ge=-1e4, le=1e4)], ...], Meta(max_length=8)]
Model = Literal["plumb_bob", "rational_polynomial", "equidistant"]
Angle = Annotated[float, Meta(ge=1, lt=170)]  # deg


class Belief(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What a fleet believes of a camera, as far as it differs from the truth."""

    focal: tuple[Pixels, Pixels] | None = None
    centre: tuple[Place, Place] | None = None
    distortion: Coefficients | None = None
    distortion_model: Model | None = None


class CameraSettings(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A camera by its calibration, as of OpenCV, or by an angle of view or the size of its sensor."""

    width: Annotated[int, Meta(ge=_LEAST, le=20_000)]  # pixels
    height: Annotated[int, Meta(ge=_LEAST, le=20_000)]  # pixels
    # deg, between the lines of sight through both ends of the middle row
    hfov_deg: Angle | None = None
    vfov_deg: Angle | None = None  # deg, through both ends of the middle column, instead of `hfov_deg`
    dfov_deg: Angle | None = None  # deg, through opposite corners, as data sheets often tell, instead of `hfov_deg`
    focal: tuple[Pixels, Pixels] | None = None  # pixels, `[fx, fy]`, instead of `hfov_deg`
    # mm, the true focal length, not one "equivalent to 35 mm"; with `sensor_width_mm` instead of `hfov_deg`
    focal_mm: Annotated[float, Meta(gt=0, le=1e4)] | None = None
    # mm, width of the part of the sensor that `width` pixels cover
    sensor_width_mm: Annotated[float, Meta(gt=0, le=1e3)] | None = None
    # pixels, principal point `[cx, cy]`, counted as in OpenCV: the centre of the first pixel is 0, 0; by default the
    # middle of the image
    centre: tuple[Place, Place] | None = None
    # k1, k2, p1, p2, k3, with `"rational_polynomial"` also k4, k5, k6, with `"equidistant"` k1, k2, k3, k4, as in
    # OpenCV; those left out are 0
    distortion: Coefficients = ()
    # `"plumb_bob"`, `"rational_polynomial"`, or `"equidistant"`: a fisheye
    distortion_model: Model = "plumb_bob"
    scale: Annotated[float, Meta(gt=0, le=1)] = 1.0  # size of delivered images as a share of the calibrated ones
    # s, rolling shutter: time from the exposure of the first row to that of the last; the middle row is exposed at the
    # time of the frame
    readout: Annotated[float, Meta(ge=0, le=1)] = 0.0
    # `focal`, `centre`, `distortion`, `distortion_model` as the fleet believes them, where they differ from the truth
    believed: Belief | None = None
    source: str = ""  # where the figures come from

    def __post_init__(self) -> None:
        if (self.focal, self.focal_mm, *_get_angles(self).values()).count(None) != 4:
            others = "vfov_deg, dfov_deg, or focal_mm with sensor_width_mm"
            raise ValueError(f"hfov_deg and focal: one of them is needed, and determines the other; or {others}")
        if (self.focal_mm is None) != (self.sensor_width_mm is None):
            raise ValueError("focal_mm and sensor_width_mm: both are needed, or neither")
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
    if belief.distortion_model and belief.distortion is None:
        raise ValueError(f"distortion_model: {belief.distortion_model!r} needs its own distortion")
    given = settings.distortion if belief.distortion is None else belief.distortion
    bend = Distortion.of(belief.distortion_model or settings.distortion_model, given)
    focal = belief.focal or settings.focal or (_find_focal(settings),) * 2
    cx, cy = belief.centre or settings.centre or (width / 2 - _CENTRE, height / 2 - _CENTRE)
    size = _scale_size(settings)
    across, down = size[0] / width, size[1] / height
    lengths = (focal[0] * across, focal[1] * down)
    centre = ((cx + _CENTRE) * across, (cy + _CENTRE) * down)
    return Camera.calibrated(*size, lengths, centre, bend)


def _get_angles(settings: CameraSettings) -> dict[str, float | None]:
    """Angles of view [deg] by the names of their keys."""
    return {name: getattr(settings, name) for name in ("hfov_deg", "vfov_deg", "dfov_deg")}


def _find_focal(settings: CameraSettings) -> float:
    """The focal length [pixel] with which an image spans the angle of view; ValueError if the lens folds before."""
    if settings.focal_mm and settings.sensor_width_mm:
        return settings.focal_mm * settings.width / settings.sensor_width_mm
    key, angle_deg = next((name, angle) for name, angle in _get_angles(settings).items() if angle is not None)
    bend, angle = Distortion.of(settings.distortion_model, settings.distortion), math.radians(angle_deg)
    width, height, reach = settings.width, settings.height, find_reach(bend)
    w, h = float(width), float(height)
    half, ends = {
        "hfov_deg": (width / 2, ((0.0, h / 2), (w, h / 2))),
        "vfov_deg": (height / 2, ((w / 2, 0.0), (w / 2, h))),
        "dfov_deg": (math.sqrt(w * w + h * h) / 2, ((0.0, 0.0), (w, h))),
    }[key]
    if settings.centre is None and bend.p1 == bend.p2 == 0.0:
        slope = tan(angle / 2)
        if slope * slope <= reach or reach == 0.0:
            return half / distort(bend, slope, 0.0)[0]
    else:
        cx, cy = settings.centre or (width / 2 - _CENTRE, height / 2 - _CENTRE)
        low, high, spans = 0.0, 1e7, math.nan
        for _ in range(100):  # a view beyond the reach of the lens is NaN, and too wide
            focal = (low + high) / 2
            optics = Optics(focal, focal, cx + _CENTRE, cy + _CENTRE, width, height, bend, reach)
            (a, b), (x, y) = (plane_point(optics, *end) for end in ends)
            across = math.sqrt((b - y) * (b - y) + (x - a) * (x - a) + (a * y - b * x) * (a * y - b * x))
            spans = arctan2(across, 1.0 + a * x + b * y)
            low, high = (low, focal) if spans <= angle else (focal, high)
        if math.isclose(spans, angle, rel_tol=1e-6):
            return focal
        if reach == 0.0:
            allowed = "expected one in the image, or focal in its place"
            raise ValueError(f"centre: {[cx, cy]} spans no {key} of {angle_deg:g}; {allowed}")
    if bend.equidistant and reach >= WIDEST * WIDEST:
        raise ValueError(f"{key}: {angle_deg:g} is not allowed; expected at most 151, as equidistant lenses show here")
    raise ValueError(explain_fold(bend))


def _scale_size(settings: CameraSettings) -> tuple[int, int]:
    return round(settings.scale * settings.width), round(settings.scale * settings.height)


def read_camera(name: str) -> CameraSettings:
    """A packaged camera, or that of a TOML file or calibration file; InputError if there is none.

    The name of a calibration file with several cameras ends with that of one, as in `camchain.yaml#cam1`.
    """
    file, _, camera = name.partition("#")
    path = Path(file)
    if path.suffix not in ("", ".toml"):
        data = read_calibration(path, camera)
    else:
        path = find_toml_file(name, CAMERAS, "camera")
        data = read_toml(path, "camera")
    try:
        return read_settings(data, CameraSettings)
    except InputError as error:
        raise InputError(f"camera: {path}: {error}") from error


def calibrate(
    size: tuple[int, int],
    matrix: Sequence[float],
    bend: Sequence[float],
    model: str,
    region: Sequence[int],
    binning: Sequence[int],
) -> CameraSettings:
    """The camera of ROS's CameraInfo, by its K (9,), D and so on; ValueError as from `describe`."""
    return read_settings(describe(size, matrix, bend, model, region, binning), CameraSettings)
