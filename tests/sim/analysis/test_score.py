"""Places between floor and bound are those that a count by hand gives, and their intervals hold."""

import numpy as np
import pytest
from helpers.trials import failed, row

from sim.analysis.cells import grouped
from sim.analysis.intervals import means
from sim.analysis.metric_choice import metric_shown
from sim.analysis.planner_labels import planner_labels
from sim.analysis.score import ends_of, places
from sim.study.study import ScoreScale
from tracking.plugins.registry import InputError

GOSPA, SHARE = metric_shown("gospa.mean_m"), metric_shown("ospa.share_under_1m")
SCORED = ScoreScale(floor="hover", bound="sma-nbo")
VIEW = ("view", "unlimited")


def flown(planner, values, factors=(), name="gospa.mean_m"):
    return [row(planner, seed, factors, {name: value}) for seed, value in enumerate(values)]


def placed(rows, metric=GOSPA):
    return places(grouped(rows, "hover"), metric, *ends_of(rows, SCORED))


def cell(own, floor=(8.0, 10.0, 12.0), bound=(2.0, 2.0, 2.0), factors=(), name="gospa.mean_m"):
    rows = flown("hover", floor, factors, name) + flown("sma-nbo", own, factors, name)
    return rows + flown("sma-nbo", bound, (*factors, VIEW), name)


def test_a_place_is_the_share_of_the_way_from_floor_to_bound():
    (place,) = placed(cell((6.0, 6.0, 6.0)))
    assert place.planner == "sma-nbo" and place.cell == () and place.maps == 3
    assert place.score.value == pytest.approx((10 - 6) / (10 - 2))
    residuals = np.array([2.0, 4.0, 6.0]) - 0.5 * np.array([6.0, 8.0, 10.0])
    assert place.score == means((0.5 + residuals / 8)[:, None])[0]
    (ends,) = placed(cell((8.0, 10.0, 12.0)))
    assert ends.score.value == 0 and ends.score.low == ends.score.high == 0
    (ends,) = placed(cell((2.0, 2.0, 2.0)))
    assert ends.score.value == 1 == ends.score.low == ends.score.high
    (worse,) = placed(cell((10.0, 12.0, 14.0)))
    assert worse.score.value == pytest.approx(-0.25)
    (higher,) = placed(cell((0.5, 0.7), (0.2, 0.2), (1.0, 1.0), name=SHARE.name), SHARE)
    assert higher.score.value == pytest.approx(0.5)


def test_maps_without_floor_or_bound_do_not_count_nor_do_cells_without_room():
    rows = [*cell((6.0, 6.0, 6.0))[:-1], failed("sma-nbo", 2, (VIEW,))]
    (place,) = placed(rows)
    assert place.maps == 2 and place.score.value == pytest.approx((9 - 6) / (9 - 2))
    assert placed(cell((6.0, 6.0, 6.0), bound=(20.0, 20.0, 20.0))) == []


def test_the_mean_over_cells_is_by_seed_and_of_planners_in_all_of_them():
    worlds = [cell(own, factors=(("scenario", w),)) for w, own in (("a", (6.0, 6.0, 6.0)), ("b", (4.0, 8.0, 2.0)))]
    rows = [*worlds[0], *worlds[1], *flown("greedy", (3.0, 3.0, 3.0), (("scenario", "a"),))]
    found = {(p.cell, p.planner): p.score for p in placed(rows)}
    one, other = (found[(("scenario", w),), "sma-nbo"].value for w in "ab")
    assert found[None, "sma-nbo"].value == pytest.approx((one + other) / 2) and (None, "greedy") not in found


def test_intervals_hold_the_place_of_many_maps():
    rng, held = np.random.default_rng(1), []
    for _ in range(300):
        floor = rng.gamma(4.0, 2.0, 12)
        bound = 0.3 * floor
        own = floor + rng.uniform(0.2, 1.0, 12) * (bound - floor)
        (place,) = placed(cell(own.tolist(), floor.tolist(), bound.tolist()))
        held.append(place.score.low <= 0.6 <= place.score.high)
    assert 0.91 < np.mean(held) < 0.99


def test_the_bound_is_shown_as_one_and_is_no_cell_of_its_own():
    rows = cell((6.0, 6.0, 6.0))
    labels = set(planner_labels(rows).values())
    assert labels == {"hover", "sma-nbo", "sma-nbo(view=unlimited), upper bound"}
    assert {group.cell for group in grouped(rows)} == {()}
    with pytest.raises(InputError, match=r"'sma-nbo\(view=unlimited\)' is none of the study's planners"):
        ends_of(rows[:6], SCORED)
