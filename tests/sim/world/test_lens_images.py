"""Straight images in which those through lenses lie."""

import numpy as np
import pytest

from planning.baselines import Hover
from sim.mission.mission import Mission
from sim.scenario.loading import load_scenario
from sim.world.lens_images import cut_rows, straighten
from tracking.geometry.camera import Camera
from tracking.geometry.distortion import Distortion

LENSES = {
    "plumb_bob": Distortion.of("plumb_bob", (-0.2, 0.03, 0.001, -0.002)),
    "rational": Distortion.of("rational_polynomial", (0.4, -0.3, 0.001, -0.002, 0.1, 0.6, -0.2, 0.05)),
    "fisheye": Distortion.of("equidistant", (0.05, -0.02)),
}


@pytest.mark.parametrize("name", [*LENSES, "circle"])
def test_each_pixel_is_the_sample_of_the_straight_image_in_its_direction(name):
    lens, focal = LENSES.get(name, Distortion.of("equidistant", ())), 40.0 if name == "circle" else 110.0
    camera = Camera.calibrated(160, 120, (focal, focal + 1), (78.0, 63.0), lens)
    whole = straighten(camera)
    assert whole.dark.any() == (name == "circle")
    for view, top in ((whole, 0), (cut_rows(whole, 40, 70), 40)):
        rows, columns = np.nonzero(~view.dark)
        slopes = camera.slopes(np.column_stack([columns + 0.5, rows + top + 0.5]))
        assert np.isfinite(slopes).all()
        np.testing.assert_allclose(view.straight.slopes(view.places[:, rows, columns].T + 0.5), slopes, atol=1e-9)
        width, height = view.straight.size
        i, j = np.divmod(view.sources[rows, columns], width)
        assert i.min() >= 0 and i.max() < height
        np.testing.assert_array_equal(np.column_stack([j, i]), np.floor(view.places[:, rows, columns].T + 0.5))


def test_an_image_is_dark_beyond_the_circle_of_a_fisheye():
    camera = "{width = 80, height = 64, focal = [26, 26], distortion_model = 'equidistant'}"
    fleet = f"uavs=[{{start=[0,0], footprint=150, camera={camera}}}]"
    mission = Mission(load_scenario("forest", ["duration=0.2", fleet]), Hover())
    next(iter(mission.fly()))
    dark = straighten(mission.scenario.uavs[0].true_camera).dark
    assert 0.1 < dark.mean() < 0.6
    assert not mission.images[0][dark].any() and mission.images[0][~dark].any(axis=1).all()
