"""docs/canopy.py: shares of people that show, and the page's table of them."""

import math
import sys

import pytest
from helpers.pages import DOCS

sys.path.append(str(DOCS))
import canopy


def test_fewer_people_show_under_denser_crowns_and_most_do_in_the_open():
    thin, dense = (canopy.view_people(density, 12) for density in (0.1, math.inf))
    for rows in (thin, dense):
        assert len(rows) == 96 and 0 <= rows[:, 1].min() and rows[:, 1].max() <= 1
        assert 0.1 < rows[:, 0].mean() < 0.5  # crowns cover about a quarter of the area
        assert (rows[rows[:, 0] == 0, 1] > 0).mean() > 0.85  # an opaque crown hides people beside it, too
    shown = [(rows[rows[:, 0] > 0, 1] > 0).mean() for rows in (thin, dense)]
    assert shown[0] > 0.95 and shown[1] < 0.5


@pytest.mark.slow
def test_the_page_has_what_the_command_prints(capsys):
    canopy.main()
    assert capsys.readouterr().out in (DOCS / "results" / "canopy.md").read_text()
