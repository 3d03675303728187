"""Names in an image."""

import numpy as np

from sim.views.drawing.labels import Labels
from sim.views.drawing.lettering import TextStyle
from sim.views.palette import INK, PANEL

NAME = TextStyle(13, INK, True, PANEL)


def test_names_that_are_not_needed_are_left_out_where_there_is_no_room():
    image = np.zeros((300, 500, 3), np.uint8)
    labels, mark = Labels(image, veil=False), np.array([250.0, 150.0])
    marks = np.stack(np.meshgrid(np.arange(200.0, 300, 12), np.arange(100.0, 200, 12)), axis=-1)
    labels.reserve(marks.reshape(-1, 2), 6.0)
    labels.put("person 1", mark, NAME, needed=False)
    assert not image.any()
    labels.put("person 1", mark, NAME)
    assert image.any()
    free = np.zeros((300, 500, 3), np.uint8)
    Labels(free, veil=False).put("person 1", mark, NAME, needed=False)
    assert free.any()
