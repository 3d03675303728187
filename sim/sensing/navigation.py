"""Navigation of a fleet: what UAVs believe about their poses and velocities, in place of the truth."""

from collections.abc import Callable

import numpy as np

from sim.scenario.scenario import Scenario
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import rotate
from tracking.navigation import Navigation
from tracking.numerics.arrays import Array
from tracking.numerics.normal import standard_normal


class NavigationErrors:
    """Errors of one UAV's navigation at the present scan; `advance` goes on to the next one."""

    def __init__(self, navigation: Navigation, rng: np.random.Generator) -> None:
        self._navigation = navigation
        self._rng = rng
        self._biases = navigation.biases * standard_normal(rng, 6)
        self.clock = float(navigation.clock_deviation * standard_normal(rng, 1)[0])  # s
        self._drift = navigation.drifts * standard_normal(rng, 6)  # m and rad, of position and attitude
        self._draw_noise()

    def advance(self, elapsed: float) -> None:
        """Go on to the scan that is `elapsed` s after the present one."""
        kept = self._navigation.kept(elapsed)
        new = self._navigation.drifts * np.sqrt(1.0 - kept * kept)
        self._drift = kept * self._drift + new * standard_normal(self._rng, 6)
        self._draw_noise()

    def _draw_noise(self) -> None:
        drawn = standard_normal(self._rng, 5)
        self.velocity = self._navigation.velocity_noise * drawn[:2]  # (2,) m/s, of the believed velocity
        self._noise = self._navigation.noises
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
