"""Names in an image."""

import numpy as np
import pytest

from sim.views.drawing.labels import Labels
from sim.views.drawing.lettering import TextStyle, measure_width
from sim.views.drawing.palette import INK, PANEL

NAME = TextStyle(13, INK, True, PANEL)
OWN = np.array([200.0, 100.0, 320.0, 180.0])  # left, top, right, bottom of a view


def name_of(view, others):
    """Rows and columns of the name of a view in an image of 300 x 500 pixels."""
    image = np.zeros((300, 500, 3), np.uint8)
    labels = Labels(image, veil=False)
    labels.put_outside("UAV 0", view, NAME, others=np.reshape(others, (-1, 4)))
    rows, columns = np.nonzero(image.any(axis=2))
    assert len(rows) > 50
    return rows, columns


@pytest.mark.parametrize("across", [-1, 1])
@pytest.mark.parametrize("down", [-1, 1])
def test_the_name_of_a_view_does_not_stand_in_another_view(across, down):
    others = [OWN + (40.0 * across, 40.0 * down) * 2, OWN + (40.0 * across, 0.0) * 2]
    rows, columns = name_of(OWN, others)
    for left, top, right, bottom in [OWN, *others]:
        assert not np.any((rows > top) & (rows < bottom) & (columns > left) & (columns < right))


def common(one, other):
    across, down = (min(one[i + 2], other[i + 2]) - max(one[i], other[i]) for i in (0, 1))
    return max(across, 0.0) * max(down, 0.0)


@pytest.mark.parametrize("crowd", [0, 10, 60, 300])
def test_names_stand_where_trying_every_place_finds_that_they_cover_least(monkeypatch, crowd):
    written = []
    monkeypatch.setattr("sim.views.drawing.labels.write", lambda image, text, at, style: written.append(at))
    rng = np.random.default_rng(crowd)
    labels = Labels(np.zeros((300, 500, 3), np.uint8), veil=False)
    marks = rng.uniform([0, 0], [500, 300], (crowd, 2))
    labels.reserve(marks, 8.0)
    taken = [(x - 8, y - 8, x + 8, y + 8) for x, y in marks.tolist()]
    sides = [(1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1)]
    for n in range(20):
        at, wide, high = rng.uniform([-20, -20], [520, 320]), measure_width(f"person {n}", NAME), NAME.size + 4.0
        tried = []
        for away in (11.0, 27.0, 47.0, 72.0):
            for dx, dy in sides:
                x, y = at[0] + dx * (away + wide / 2), at[1] + dy * (away + high / 2)
                box = (x - wide / 2, y - high / 2, x + wide / 2, y + high / 2)
                beyond = common(box, box) - common(box, (0.0, 0.0, 500.0, 300.0))
                tried.append((10 * (3 * beyond + sum(common(box, other) for other in taken)) + away, box))
        best = min(tried, key=lambda choice: choice[0])[1]
        labels.put(f"person {n}", at, NAME, gap=11.0)
        assert written[-1] == pytest.approx((best[0], (best[1] + best[3]) / 2), abs=1e-9), n
        taken.append(best)


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
