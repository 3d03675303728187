"""Navigation of a fleet: what UAVs believe about their poses and velocities, in place of the truth."""

import math
from collections.abc import Callable

import numpy as np

from sim.scenario.scenario import Scenario
from sim.world.attitude import rotate
from tracking.geometry.camera import Pose, meet_plane
from tracking.geometry.visibility import TARGET_HEIGHT, at_target_height
from tracking.navigation import Navigation
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp
from tracking.numerics.matrices import apply
from tracking.numerics.normal import standard_normal


class NavigationErrors:
    """Errors of one UAV's navigation at the present scan; `advance` goes on to the next one."""

    def __init__(self, navigation: Navigation, rng: np.random.Generator) -> None:
        n = self._navigation = navigation
        self._rng = rng
        self._drifts = _list_deviations(n.horizontal_drift, n.vertical_drift, n.tilt_drift_deg, n.yaw_drift_deg)
        biases = _list_deviations(0.0, 0.0, n.tilt_bias_deg, n.yaw_bias_deg)
        self._biases, clock = biases * standard_normal(rng, 6), n.clock_deviation * standard_normal(rng, 1)[0]
        self.clock = float(clock if n.clock_offset is None else n.clock_offset)  # s
        self._drift = self._drifts * standard_normal(rng, 6)  # m and rad, of position and attitude
        self._draw_noise()

    def advance(self, elapsed: float) -> None:
        """Go on to the scan that is `elapsed` s after the present one."""
        times = self._navigation.position_time, self._navigation.attitude_time
        kept = np.repeat([exp(-elapsed / time) for time in times], 3)
        new = self._drifts * np.sqrt(1.0 - kept * kept)
        self._drift = kept * self._drift + new * standard_normal(self._rng, 6)
        self._draw_noise()

    def _draw_noise(self) -> None:
        n, drawn = self._navigation, standard_normal(self._rng, 5)
        self.velocity = n.velocity_noise * drawn[:2]  # (2,) m/s, of the believed velocity
        self._noise = _list_deviations(n.horizontal_noise, n.vertical_noise, 0.0, 0.0)
        self._noise[:3] *= drawn[2:]

    def mislead(self, pose: Pose, velocity: Array, spin: Array) -> Pose:
        """What is believed of a pose, given velocity (3,) m/s and, of what turns, angular velocity (3,) rad/s.

        Note: the pose at an offset of the clock is extrapolated to first order.
        """
        moved, turned = np.split(self._biases + self._drift + self._noise, 2)
        position = pose.position + moved + self.clock * velocity
        return Pose(position, rotate(pose.quaternion, turned + self.clock * spin, 1.0))


def make_navigation_errors(
    scenario: Scenario, chance: Callable[..., np.random.Generator]
) -> list[NavigationErrors | None]:
    """Errors of each UAV; None if its navigation is exact. `chance` makes the stream of a component and its index."""
    navigations = [uav.navigation_errors for uav in scenario.uavs]
    return [
        None if n == Navigation() else NavigationErrors(n, chance("navigation", i)) for i, n in enumerate(navigations)
    ]


def move_to_believed(points: Array, true: Pose, believed: Pose) -> Array:
    """Where people seen at points (N, 2) m by a camera at its true pose are with the believed one; NaN for nowhere."""
    rays = apply(believed.rotation, apply(true.rotation.T, at_target_height(points) - true.position))
    return meet_plane(believed, rays, TARGET_HEIGHT)


def _list_deviations(horizontal: float, vertical: float, tilt_deg: float, yaw_deg: float) -> Array:
    """Deviations (6,) of a position [m] and of turns about the three axes [rad]."""
    tilt = math.radians(tilt_deg)
    return np.array([horizontal, horizontal, vertical, tilt, tilt, math.radians(yaw_deg)])
