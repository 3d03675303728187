"""Navigation of a fleet: what UAVs believe about their poses and velocities, in place of the truth."""

from collections import deque
from collections.abc import Callable

import numpy as np

from sim.scenario.scenario import Scenario
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import interpolate_poses, rotate
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
        self._past: deque[tuple[float, Array]] = deque()  # s, and poses (7,) of the body
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

    def stamp(self, time: float, body: Pose, velocity: Array, spin: Array) -> Pose:
        """The pose that belongs to the present scan by the UAV's clock, given that of the body; call it once a scan.

        time: of the scan [s]; velocity (3,) m/s and angular velocity (3,) rad/s of the body.

        Note: the future is not known, so poses of a clock that is ahead are extrapolated to first order. Those of a
        clock that is behind are of the body's past, linear between scans, and before the start as at the start.
        """
        if self.clock == 0.0:
            return body
        if self.clock > 0.0:
            return Pose(body.position + self.clock * velocity, rotate(body.quaternion, spin, self.clock))
        self._past.append((time, np.append(body.position, body.quaternion)))
        while len(self._past) > 1 and self._past[1][0] <= time + self.clock:
            self._past.popleft()
        times, poses = map(np.array, zip(*self._past, strict=True))
        (pose,) = interpolate_poses(times, poses, np.maximum([time + self.clock], times[0]))
        return Pose(pose[:3], pose[3:])

    def mislead(self, pose: Pose) -> Pose:
        """What is believed of a pose of the time that `stamp` takes."""
        moved, turned = np.split(self._biases + self._drift + self._noise, 2)
        return Pose(pose.position + moved, rotate(pose.quaternion, turned, 1.0))


def make_navigation_errors(
    scenario: Scenario, chance: Callable[..., np.random.Generator]
) -> list[NavigationErrors | None]:
    """Errors of each UAV; None if its navigation is exact. `chance` makes the stream of a component and its index."""
    navigations = [uav.navigation_errors for uav in scenario.uavs]
    return [
        None if n == Navigation() else NavigationErrors(n, chance("navigation", i)) for i, n in enumerate(navigations)
    ]
