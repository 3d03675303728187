"""Names in an image."""

import numpy as np
import pytest

from sim.drawing.labels import OUTSIDE, Labels, track_name
from sim.drawing.lettering import TextStyle
from sim.drawing.palette import INK, PANEL
from tracking.filter.kalman import Gaussian
from tracking.track import Track


@pytest.mark.parametrize("crowd", [0, 5, 40])
def test_the_name_of_a_view_lies_above_or_left_of_its_corner(crowd):
    image = np.zeros((200, 400, 3), np.uint8)
    labels, corner, rng = Labels(image, veil=False), np.array([200.0, 100.0]), np.random.default_rng(crowd)
    for place in rng.uniform([150, 50], [260, 130], (crowd, 2)):
        labels.reserve(place, 8.0)
    labels.put("UAV 0", corner, TextStyle(13, INK, True, PANEL), gap=1.0, sides=OUTSIDE)
    rows, columns = np.nonzero(image.any(axis=2))
    assert len(rows) > 50 and not np.any((rows > corner[1] + 1) & (columns > corner[0] + 1))


def test_names_of_tracks_that_are_not_reported_have_a_question_mark():
    belief = Gaussian(np.zeros(4), np.eye(4))
    assert [track_name(Track(3, belief, r)) for r in (1.0, 0.51, 0.5, 0.01)] == ["3", "3", "3?", "3?"]
