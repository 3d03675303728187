"""Remarks on people who are too small in the images, and on clutter in which they are lost."""

import pytest

from sim.scenario.loading import load_scenario
from sim.scenario.remarks import find_remarks
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from tracking.detection.silhouette import make_silhouette

WHERE = "where a person's own would be"
SLOW = "take a second or more each to render; faster with"
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
        (["uavs.1.pixels=2048"], [f"uavs: images of 2048 × 2048 pixels of UAV 1 {SLOW} --set uavs.1.pixels=554"]),
        (
            ["uavs.2.camera={width = 4000, height = 3000, hfov_deg = 60}"],
            [f"uavs: images of 4000 × 3000 pixels of UAV 2 {SLOW} --set uavs.2.camera.scale=0.16"],
        ),
        (["uavs.2.camera={width = 4000, height = 3000, hfov_deg = 60, scale = 0.16}"], []),
        (
            ["uavs.*.pixels=2048"],
            [f"uavs: images of 2048 × 2048 pixels of UAVs 0, 1 and 2 {SLOW} --set uavs.*.pixels=554"],
        ),
        (
            ["uavs.0.pixels=1662", "uavs.2.pixels=1662"],
            [
                f"uavs: images of 1662 × 1662 pixels of UAVs 0 and 2 {SLOW}"
                " --set uavs.0.pixels=554 --set uavs.2.pixels=554"
            ],
        ),
        (["uavs.1.pixels=2048", "sensing.mode=ideal"], []),
    ],
)
def test_images_that_are_too_small_or_too_large_are_told_of_before_the_flight(changes, remarks):
    assert find_remarks(load_scenario("forest", changes)) == remarks


@pytest.mark.parametrize(
    ("changes", "doubted"),
    [
        (["tracking.clutter_density=0.5"], "0.5 per m2 means 0.28"),
        (["tracking.clutter_density=0.05"], None),
        (["tracking.clutter_density=0.5", "sensing.noise=camera"], None),
    ],
)
def test_clutter_in_which_people_are_lost_is_remarked_on(changes, doubted):
    found = find_remarks(load_scenario("forest", changes))
    expected = (
        []
        if doubted is None
        else [f"tracking.clutter_density: {doubted} false detections {WHERE}; few tracks or none will begin"]
    )
    assert found == expected


def test_the_usual_cameras_show_people():
    assert min(uav.person_pixels for uav in Scenario().uavs) > 5


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (["believed.leaf_area=2"], ["believed.leaf_area: not used, as crowns are opaque; set trees.leaf_area_density"]),
        (["believed.leaf_area=2", "trees.leaf_area_density=1"], []),
        (["believed.leaf_area=2", "trees.file=park"], []),
    ],
)
def test_a_believed_density_of_leaves_needs_leaves(changes, told):
    assert find_remarks(load_scenario("forest", changes)) == told


def test_a_share_of_unknown_trees_needs_known_ones():
    none_known = ["believed.trees_missing=1", "believed.trees_unknown=0.5"]
    told = "believed.trees_unknown: not used, as it is a share beside known trees, and none is known"
    assert find_remarks(load_scenario("forest", none_known)) == [told]
    assert find_remarks(load_scenario("forest", [*none_known, "believed.trees_invented=0.2"])) == []
