"""A fleet that believes in a wrong calibration puts people where that camera would have seen them."""

import numpy as np
import pytest

from planning.baselines import Hover
from sim.mission.mission import Mission
from sim.scenario.loading import load_scenario

LENS = "width = 320, height = 240, hfov_deg = 60, distortion = [-0.25, 0.05]"
SETTINGS = [
    *("duration=3", "trees.density=0", "sensing.noise=camera", "area.width=50", "area.height=40"),
    *("people.count=12", 'people.walks=["waypoints"]', "people.paths=[]"),
]


def errors(mode: str, belief: str) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 2) m of detected people relative to the camera, and errors (N, 2) m of what is measured there."""
    camera = f"{{{LENS}, believed = {{{belief}}}}}"
    fleet = f"uavs=[{{start=[0,0], footprint=30, camera={camera}}}]"
    places, found = [], []
    scenario = load_scenario("forest", [*SETTINGS, f"sensing.mode={mode}", fleet])
    for snapshot in Mission(scenario, Hover(), 0).fly():
        scan, eye = snapshot.scans[0], snapshot.cameras[0].position[:2]
        people = snapshot.people[~np.isnan(snapshot.people[:, 0])]
        for z in scan.measurements:
            near = people[np.argmin(np.linalg.norm(people - z, axis=1))]
            places.append(near - eye)
            found.append(z - near)
    return np.array(places), np.array(found)


@pytest.mark.parametrize("mode", ["camera", "ideal"])
def test_distortion_that_is_ignored_moves_people_outwards_and_a_known_one_does_not(mode):
    for belief, biased in (("", False), ("distortion = []", True)):
        places, found = errors(mode, belief)
        r = np.linalg.norm(places, axis=1)
        outer = (r > 8.0) & (np.linalg.norm(found, axis=1) < 3.0)
        assert outer.sum() > 20
        along = np.sum(found * places, axis=1)[outer] / r[outer]
        # With k1 = -0.25 a point at the slope x appears at x (1 - 0.25 x^2): at 10 m of 26 m by 0.4 m nearer.
        assert (np.median(along) < -0.2) == biased
        assert biased or abs(np.median(along)) < 0.05
