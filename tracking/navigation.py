"""Errors of a UAV's navigation: what its camera's pose is believed to be, in place of what it is."""

import math
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp
from tracking.settings import DAY

_Metres = Annotated[float, Meta(ge=0, le=1000)]
_Degrees = Annotated[float, Meta(ge=0, le=45)]
POSITION_TIME = 300.0  # s, time constant of the drift of a position
ATTITUDE_TIME = 60.0  # s, time constant of the drift of tilt and yaw


class Navigation(Struct, frozen=True, forbid_unknown_fields=True):
    """Standard deviations of the errors along each axis: noise is new at each scan, a bias is drawn once.

    A drift is a first-order Gauss-Markov process.
    """

    horizontal_noise: _Metres = 0.0  # m, of the position to the east and to the north
    vertical_noise: _Metres = 0.0  # m, of the altitude
    horizontal_drift: _Metres = 0.0  # m, of the position
    vertical_drift: _Metres = 0.0  # m, of the altitude
    velocity_noise: Annotated[float, Meta(ge=0, le=10)] = 0.0  # m/s, which the control of velocities follows
    tilt_bias_deg: _Degrees = 0.0  # deg, about the axes to the east and to the north
    tilt_drift_deg: _Degrees = 0.0  # deg, about the same axes
    yaw_bias_deg: _Degrees = 0.0  # deg, of the heading
    yaw_drift_deg: _Degrees = 0.0  # deg, of the heading
    # s, deviation of the clock offset, which is drawn once: a pose with this offset is of so much later than its image
    clock_deviation: Annotated[float, Meta(ge=0, le=DAY)] = 0.0

    @property
    def noises(self) -> Array:
        """Deviations (6,) of the noise of a position [m] and of turns about the axes of the world [rad]."""
        return np.array([self.horizontal_noise, self.horizontal_noise, self.vertical_noise, 0.0, 0.0, 0.0])

    @property
    def biases(self) -> Array:
        """Deviations (6,) of the biases, in the same order."""
        return self._list_deviations(0.0, 0.0, self.tilt_bias_deg, self.yaw_bias_deg)

    @property
    def drifts(self) -> Array:
        """Deviations (6,) of the drifts."""
        return self._list_deviations(
            self.horizontal_drift, self.vertical_drift, self.tilt_drift_deg, self.yaw_drift_deg
        )

    @staticmethod
    def kept(elapsed: float) -> Array:
        """Correlation (6,) of the drifts with those `elapsed` s before."""
        return np.repeat([exp(-elapsed / time) for time in (POSITION_TIME, ATTITUDE_TIME)], 3)

    @staticmethod
    def _list_deviations(horizontal: float, vertical: float, tilt_deg: float, yaw_deg: float) -> Array:
        tilt = math.radians(tilt_deg)
        return np.array([horizontal, horizontal, vertical, tilt, tilt, math.radians(yaw_deg)])


# RTK: 1 cm + 1 ppm horizontally and 1.5 cm + 1 ppm vertically, and headings from two antennas, as data sheets of
# such UAVs state. GNSS: the 1.5 to 2 m CEP of data sheets of single-frequency receivers, with a drift of minutes, as in
# [Beard12]; a calibrated compass. Consumer: 294 forest flights of the BAMBI project, whose logged positions err by 0.1
# to 1.3 m, gimbals' yaws differ by 5.8 degrees in the median, and times of frames cost 1.9 m.
NAVIGATION = {
    "exact": Navigation(),
    "rtk": Navigation(
        horizontal_noise=0.01,
        vertical_noise=0.015,
        horizontal_drift=0.01,
        vertical_drift=0.02,
        velocity_noise=0.03,
        tilt_bias_deg=0.1,
        tilt_drift_deg=0.05,
        yaw_bias_deg=0.3,
        yaw_drift_deg=0.1,
        clock_deviation=0.002,
    ),
    "gnss": Navigation(
        horizontal_noise=0.05,
        vertical_noise=0.1,
        horizontal_drift=1.5,
        vertical_drift=2.0,
        velocity_noise=0.05,
        tilt_bias_deg=0.3,
        tilt_drift_deg=0.1,
        yaw_bias_deg=2.0,
        yaw_drift_deg=0.5,
        clock_deviation=0.02,
    ),
    "consumer": Navigation(
        horizontal_noise=0.05,
        vertical_noise=0.1,
        horizontal_drift=0.5,
        vertical_drift=1.0,
        velocity_noise=0.1,
        tilt_bias_deg=0.5,
        tilt_drift_deg=0.2,
        yaw_bias_deg=5.0,
        yaw_drift_deg=1.0,
        clock_deviation=0.1,
    ),
}
