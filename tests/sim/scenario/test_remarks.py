"""Remarks on people who are too small in the images."""

import pytest

from sim.scenario.loading import load
from sim.scenario.remarks import find_remarks
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from tracking.detection.silhouette import make_silhouette

SELDOM = "which will seldom or never see one; a smaller footprint or more pixels show people"


@pytest.mark.parametrize(("footprint", "pixels"), [(20.0, 128), (60.0, 64), (9000.0, 128)])
def test_a_person_straight_below_covers_the_pixels_of_the_mean_silhouette(footprint, pixels):
    uav = Uav(start=(0.0, 0.0), footprint=footprint, pixels=pixels)
    whole = make_silhouette(0.0, uav.altitude).area / (footprint / pixels) ** 2
    assert uav.person_pixels == pytest.approx(whole, rel=0.05)


@pytest.mark.parametrize(
    ("changes", "remarks"),
    [
        (["uavs.1.footprint=80"], [f"uavs: a person covers 0.69 pixels of the image of UAV 1, {SELDOM}"]),
        (
            ["uavs.0.footprint=9000", "uavs.1.pixels=16", "uavs.2.footprint=9000"],
            [
                f"uavs: a person covers less than 0.01 pixels of the image of UAVs 0 and 2, {SELDOM}",
                f"uavs: a person covers 0.11 pixels of the image of UAV 1, {SELDOM}",
            ],
        ),
        (["uavs.1.footprint=80", "sensing.mode=ideal"], []),
        (["uavs.1.footprint=60"], []),
    ],
)
def test_a_person_smaller_than_a_pixel_is_told_of_before_the_flight(changes, remarks):
    assert find_remarks(load("forest", changes)) == remarks


def test_the_usual_cameras_show_people():
    assert min(uav.person_pixels for uav in Scenario().uavs) > 5
