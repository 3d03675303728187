"""Settings of a UAV: its start, its camera and its failure."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta, Struct

from sim.scenario.bounds import Footprint, Point, Speed, Time


class Uav(Struct, frozen=True, forbid_unknown_fields=True):
    """One quadrotor and its camera."""

    start: Point  # m, place above which it hovers at the start, `[x, y]`
    # m, edge of the square field of view on the ground; with `fov_deg` it gives the altitude
    footprint: Footprint = 20.0
    # quality factor of its measurements, [Li22] eq. (4); smaller is better
    alpha: Annotated[float, Meta(ge=1e-6, le=100)] = 0.1
    fov_deg: Annotated[float, Meta(ge=1, lt=180)] = 60.0  # deg, full angle of the field of view
    pixels: Annotated[int, Meta(ge=16, le=4096)] = 128  # pixels along each edge of the image
    max_speed: Speed = 5.0  # m/s, upper bound of commanded velocities
    # `"gimbal"`: the camera stays level with north up; `"body"`: it tilts and turns with the body
    mount: Literal["gimbal", "body"] = "gimbal"
    # Hz, of the camera, a divisor of `rates.sensing`; 0: `rates.sensing` itself
    rate: Annotated[int, Meta(ge=0, le=1000)] = 0
    # deg, mounting angle off nadir, towards the body's front, which is east at yaw 0; a gimbal keeps the camera so,
    # looking east. The image must end below the horizon. `footprint` and the covariance that planners expect with
    # `sensing.noise = "camera"` stay those of the camera looking down; the covariance of detections does not
    tilt_deg: Annotated[float, Meta(ge=0, le=60)] = 0.0
    fails_at: Time | None = None  # s, time of its breakdown; never if not given

    def __post_init__(self) -> None:
        if self.tilt_deg + self.fov_deg / 2 >= 90:
            limit = f"allowed with fov_deg {self.fov_deg:g} is less than {90 - self.fov_deg / 2:g}"
            raise ValueError(f"tilt_deg {self.tilt_deg:g} lets the camera look at the horizon; {limit}")

    @property
    def altitude(self) -> float:
        """Height of the camera above ground at which the footprint has its edge [m]."""
        return self.footprint / (2 * _tangent(math.radians(self.fov_deg) / 2))


DEFAULT_FLEET = (
    Uav(start=(-28.0, -14.0), footprint=20.0, alpha=0.10),
    Uav(start=(-28.0, 0.0), footprint=25.0, alpha=0.15),
    Uav(start=(-28.0, 14.0), footprint=22.0, alpha=0.12),
)


def _tangent(angle: float) -> float:
    """Tangent of an angle in (0, π / 2) [rad], by Lambert's continued fraction.

    That of `tracking.numerics.trigonometry` would have every command wait for the compiler, and the C library's depends
    on the processor.
    """
    fraction = 0.0
    for k in range(59, 0, -2):
        fraction = angle * angle / (k - fraction)
    return fraction / angle
