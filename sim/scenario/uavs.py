"""Settings of UAVs, with their cameras and failures, and of their radio network."""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
from msgspec import Meta, Struct

from sim.scenario.camera_settings import CameraSettings, make_camera, read_camera
from sim.scenario.quantities import Point, simplify_number
from tracking.errors import check_known, spell
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import AREA_FROM_ABOVE
from tracking.geometry.quaternions import pitch
from tracking.navigation import NAVIGATION, Navigation
from tracking.numerics.trigonometry import arctan2, cos, sin
from tracking.settings import DAY, Probability, Speed, Time

_WIDEST = 10_000  # m
_PIXELS = 128

Footprint = Annotated[float, Meta(ge=0.01, le=_WIDEST)]  # m
FieldOfView = Annotated[float, Meta(ge=1, lt=180)]  # deg
Pixels = Annotated[int, Meta(ge=16, le=10_000)]


class Uav(Struct, frozen=True, forbid_unknown_fields=True):
    """One quadrotor and its camera, with the whole view; `UavSettings` says what the fields mean."""

    start: Point  # m, `[x, y]`, the place above which the UAV hovers at the start
    footprint: Footprint = 20.0
    # quality factor of the UAV's measurements, [Li22] eq. (4); smaller is better
    alpha: Annotated[float, Meta(ge=1e-6, le=100)] = 0.1
    fov_deg: FieldOfView = 60.0
    pixels: Pixels = _PIXELS
    camera: CameraSettings | None = None
    max_speed: Speed = 5.0  # m/s, upper bound of commanded velocities
    # `"gimbal"`: the camera stays level with north up; `"body"`: it tilts and turns with the body
    mount: Literal["gimbal", "body"] = "gimbal"
    # Hz, frame rate of the camera, such as 2.5 or 0.5; its inverse is a multiple of the time between scans; 0 means
    # `rates.sensing` itself
    rate: Annotated[float, Meta(ge=0, le=1000)] = 0
    # deg, angle from nadir towards the front of the body, or to the east on a gimbal; the image must end below the
    # horizon. `footprint` is that of a camera that looks straight down
    tilt_deg: Annotated[float, Meta(ge=0, le=60)] = 0.0
    fails_at: Time | None = None  # s, time at which the UAV breaks down; by default never
    # m, the start is drawn by the seed within this distance of `start`, inside the area
    start_radius: Annotated[float, Meta(ge=0, le=30_000)] = 0.0
    # how well the UAV knows its pose: `"exact"`, `"rtk"`, `"gnss"`, `"consumer"`, or a table of the keys below
    navigation: str | Navigation = "exact"

    def __post_init__(self) -> None:
        if self.camera is not None:
            _check_camera(self.camera, self.fov_deg, self.pixels)
        if isinstance(self.navigation, str):
            check_known("navigation", self.navigation, NAVIGATION, " (or a table of figures)")
        camera = self.true_camera
        ahead = 180.0 * arctan2(float(camera.slopes(camera.outline)[:, 0].max()), 1.0) / math.pi
        if self.tilt_deg + ahead >= 90:
            limit = f"allowed with fov_deg {self.fov_deg:g} is less than {90 - ahead:g}"
            raise ValueError(f"tilt_deg {self.tilt_deg:g} lets the camera look at the horizon; {limit}")

    @property
    def altitude(self) -> float:
        """Height of the camera above ground [m], at which the field of view has the edge `footprint`."""
        return self.footprint / (2 * _compute_half_tangent(self.fov_deg))

    @property
    def navigation_errors(self) -> Navigation:
        """Figures of the errors of the UAV's navigation."""
        return NAVIGATION[self.navigation] if isinstance(self.navigation, str) else self.navigation

    @property
    def true_camera(self) -> Camera:
        """The camera as it is."""
        return self._make_camera(believed=False)

    @property
    def believed_camera(self) -> Camera:
        """The camera as the fleet believes it to be."""
        return self._make_camera(believed=True)

    def _make_camera(self, *, believed: bool) -> Camera:
        if self.camera is None:
            return Camera(math.radians(self.fov_deg), self.pixels)
        return make_camera(self.camera, believed=believed)

    def camera_pose(self, body: Pose) -> Pose:
        """Pose of the UAV's camera.

        A fixed camera turns with the body. A camera on a gimbal keeps the pose that it has on a level body that faces
        east. Without a mounting angle it then looks straight down with north up; the angle pitches it towards the
        body's x axis.
        """
        carrier = np.array([0.0, 0.0, 0.0, 1.0]) if self.mount == "gimbal" else body.quaternion
        return Pose(body.position, pitch(carrier, math.radians(self.tilt_deg)))

    @property
    def readout(self) -> float:
        """Time [s] from the exposure of the first row of an image to that of the last."""
        return 0.0 if self.camera is None else self.camera.readout

    @property
    def view_area(self) -> float:
        """Area [m²] of the ground in an image from straight above, without distortion."""
        width, height = self.true_camera.size
        return self.footprint * self.footprint * height / width

    @property
    def person_pixels(self) -> float:
        """Mean number of pixels that show a person straight below the camera."""
        edge = self.footprint / self.pixels
        return AREA_FROM_ABOVE / (edge * edge)


class UavSettings(Uav, frozen=True, forbid_unknown_fields=True):
    """A UAV as a file gives it: what is None follows from the rest."""

    # m, edge of the square field of view on the ground; two of `footprint`, `fov_deg` and `altitude` determine the
    # third; by default 20
    footprint: Footprint | None = None  # type: ignore[assignment]
    fov_deg: FieldOfView | None = None  # type: ignore[assignment]  # deg, full angle of the field of view; by default 60
    pixels: Pixels | None = None  # type: ignore[assignment]  # pixels along each edge of the image; by default 128
    # a [camera](#cameras) in place of `fov_deg` and `pixels`; `footprint` is then the width of its view
    camera: CameraSettings | str | None = None  # type: ignore[assignment]
    # m above ground, instead of `footprint` or `fov_deg`
    altitude: Annotated[float, Meta(gt=0, le=10_000)] | None = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Check nothing: `complete` does."""

    def complete(self) -> Uav:
        """The UAV with all of its view; ValueError if what is given contradicts itself."""
        camera = read_camera(self.camera) if isinstance(self.camera, str) else self.camera
        fov_deg, pixels = self.fov_deg, self.pixels
        if camera is not None:
            of_camera = measure_view(camera)
            fov_deg = of_camera.fov_deg if fov_deg is None else fov_deg
            pixels = of_camera.pixels if pixels is None else pixels
            _check_camera(camera, fov_deg, pixels)
        footprint, fov_deg = _complete_view(self.footprint, fov_deg, self.altitude)
        view = {"footprint": footprint, "fov_deg": fov_deg, "pixels": pixels or _PIXELS, "camera": camera}
        given = {name: getattr(self, name) for name in Uav.__struct_fields__}
        return Uav(**{**given, **view, "rate": simplify_number(self.rate)})


class CameraView(NamedTuple):
    """What a camera decides of a UAV's view."""

    fov_deg: float  # deg, between the ends of the middle row
    pixels: int  # along the middle row


def measure_view(settings: CameraSettings) -> CameraView:
    """The angle of view and the width of a camera's images."""
    camera = make_camera(settings)
    width, _ = camera.size
    return CameraView(measure_angle(camera, width), width)


def measure_angle(camera: Camera, pixels: int) -> float:
    """The angle of view [deg] over so many pixels in the middle of a camera's images, along a row."""
    width, _ = camera.size
    ends = np.array([[(width - pixels) / 2, camera.optics.cy], [(width + pixels) / 2, camera.optics.cy]])
    left, right = camera.slopes(camera.shown(ends))[:, 0].tolist()
    return 360.0 * arctan2((right - left) / 2, 1.0) / math.pi


def _check_camera(camera: CameraSettings, fov_deg: float, pixels: int) -> None:
    """ValueError if angle of view and pixels are not those of the camera."""
    view = measure_view(camera)
    if not math.isclose(fov_deg, view.fov_deg, rel_tol=1e-9):
        raise ValueError(f"fov_deg {fov_deg:g} is not that of the camera, {view.fov_deg:g}; leave it out")
    if pixels != view.pixels:
        raise ValueError(f"pixels {pixels} is not the width of the camera's images, {view.pixels}; leave it out")


def _complete_view(footprint: float | None, fov_deg: float | None, altitude: float | None) -> tuple[float, float]:
    """Footprint [m] and angle of view [deg], given two of them and the altitude, or fewer; ValueError if given three.

    The altitude follows from them: `Uav.altitude`.
    """
    if footprint is not None and altitude is not None:
        if fov_deg is not None:
            raise ValueError("footprint, fov_deg and altitude are given; two of them determine the third")
        fov_deg = 360.0 * arctan2(footprint / 2, altitude) / math.pi
        if fov_deg < 1.0:
            means = f"means a fov_deg of {spell(fov_deg, 3)}; allowed are 1 or more"
            raise ValueError(f"altitude {altitude:g} m with footprint {footprint:g} m {means}")
    fov_deg = 60.0 if fov_deg is None else fov_deg
    if footprint is None:
        footprint = 20.0 if altitude is None else 2 * altitude * _compute_half_tangent(fov_deg)
        if footprint > _WIDEST:
            means = f"means a footprint of {spell(footprint, 3)} m; at most {_WIDEST} m are allowed"
            raise ValueError(f"altitude {altitude:g} m with fov_deg {fov_deg:g} {means}")
    return footprint, fov_deg


def _compute_half_tangent(angle_deg: float) -> float:
    """Tangent of half an angle."""
    angle = math.radians(angle_deg)
    return sin(angle) / (1.0 + cos(angle))


DEFAULT_FLEET = (
    Uav(start=(-28.0, -14.0), footprint=20.0, alpha=0.10),
    Uav(start=(-28.0, 0.0), footprint=25.0, alpha=0.15),
    Uav(start=(-28.0, 14.0), footprint=22.0, alpha=0.12),
)


Index = Annotated[int, Meta(ge=0)]
UavPair = tuple[Index, Index]


class Cut(Struct, frozen=True, forbid_unknown_fields=True):
    """Links that are down for a while."""

    links: Annotated[tuple[UavPair, ...], Meta(min_length=1)]  # links that are down, as pairs of UAVs
    start: Time = 0.0  # s, time from which the links are down
    end: Annotated[float, Meta(le=DAY)] | None = None  # s, time from which the links are up again; by default never

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.start:
            raise ValueError(f"end {self.end:g} must be after start {self.start:g}")


class Network(Struct, frozen=True, forbid_unknown_fields=True):
    """Radio network: links, rounds of consensus per scan, fusion rule and losses."""

    # rounds of consensus per scan; in a network that takes time, number of links over which a scan is passed on
    rounds: Annotated[int, Meta(ge=0, le=1000)] = 5
    # m, distance beyond which no message arrives, with or without a link
    range: Annotated[float, Meta(gt=0, le=1e6)] = 1000.0
    # `"hcmci"`: hybrid consensus on measurements and information, which adds up the information of all UAVs, as
    # planners expect; `"kla"`: weighted average of information, as in the paper
    fusion: str = "hcmci"
    # probability that a message is lost, drawn by seed and repeat for each round and direction
    loss: Probability = 0.0
    links: tuple[UavPair, ...] = ()  # the links as pairs of UAVs: `[[0, 1], [1, 2]]`; if empty, all UAVs are linked
    # links that are down for a while: `[{links = [[0, 2], [1, 2]], start = 10, end = 20}]`
    cuts: Annotated[tuple[Cut, ...], Meta(max_length=1000)] = ()
    # s, time from a decision until its plan is flown, a multiple of the time between scans; until then UAVs fly on as
    # before, or hover at the start
    plan_delay: Time = 0.0
    # s, from the end of sending a message to its arrival. With `delay`, `jitter` or `rate` the network takes time: UAVs
    # send scans rather than tracks
    delay: Time = 0.0
    jitter: Time = 0.0  # s, largest further delay, drawn evenly by seed and repeat for each message and receiver
    # bytes/s, at which each UAV sends its messages, one after the other; by default at once
    rate: Annotated[float, Meta(gt=0, le=1e12)] | None = None
    # s, for which UAVs wait for scans, and messages for being sent; by default 1 s more than twice `delay` and `jitter`
    hold: Annotated[float, Meta(gt=0, le=DAY)] | None = None

    @property
    def takes_time(self) -> bool:
        """True if messages arrive later than they are sent."""
        return self.delay > 0.0 or self.jitter > 0.0 or self.rate is not None

    @property
    def longest_wait(self) -> float:
        """Time for which UAVs wait for scans, and messages for being sent [s]."""
        return 2.0 * (self.delay + self.jitter) + 1.0 if self.hold is None else self.hold

    def check(self, uavs: int) -> None:
        """ValueError if a link does not join two different UAVs of a fleet of this size, or is listed twice."""
        _check_links("network.links", self.links, uavs)
        known = {tuple(sorted(link)) for link in self.links}
        for i, cut in enumerate(self.cuts):
            where = f"network.cuts.{i}.links"
            _check_links(where, cut.links, uavs)
            for link in cut.links:
                if known and tuple(sorted(link)) not in known:
                    allowed = ", ".join(str(list(pair)) for pair in self.links)
                    raise ValueError(f"{where}: {list(link)} is not in network.links; allowed are {allowed}")


def _check_links(where: str, links: Sequence[UavPair], uavs: int) -> None:
    seen: set[tuple[int, ...]] = set()
    for link in links:
        pair = tuple(sorted(link))
        if pair[1] >= uavs:
            raise ValueError(f"{where}: {list(link)} names UAV {pair[1]}; allowed are 0 to {uavs - 1}")
        if pair[0] == pair[1]:
            raise ValueError(f"{where}: {list(link)} links UAV {pair[0]} to itself; allowed are pairs of two UAVs")
        if pair in seen:
            raise ValueError(f"{where}: {list(link)} is there twice; allowed is each pair once")
        seen.add(pair)
