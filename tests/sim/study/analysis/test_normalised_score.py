"""Normalised scores are those that a count by hand gives, and their intervals hold."""

import math

import msgspec
import numpy as np
import pytest
from helpers.trials import failed, row

from sim.study.analysis.groups import group_rows
from sim.study.analysis.intervals import estimate_means
from sim.study.analysis.labels import find_baseline, label_planners, parse_labels
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.analysis.normalised_score import compute_scores, find_score_ends
from sim.study.analysis.normalised_score import score_planners as scored_study
from sim.study.definition import ScoreScale
from tracking.errors import InputError

GOSPA, SHARE = find_shown_metric("gospa.mean_m"), find_shown_metric("ospa.share_under_1m")
SCORED = ScoreScale(floor="hover", bound="sma-nbo")
VIEW = ("view", "unlimited")


def flown(planner, values, factors=(), name="gospa.mean_m"):
    return [row(planner, seed, factors, {name: value}) for seed, value in enumerate(values)]


def scored(rows, metric=GOSPA):
    return compute_scores(group_rows(rows, "hover"), metric, find_score_ends(rows, SCORED))


def cell(own, floor=(8.0, 10.0, 12.0), bound=(2.0, 2.0, 2.0), factors=(), name="gospa.mean_m"):
    rows = flown("hover", floor, factors, name) + flown("sma-nbo", own, factors, name)
    return rows + flown("sma-nbo", bound, (*factors, VIEW), name)


def test_a_score_is_the_share_of_the_way_from_floor_to_bound():
    (score,) = scored(cell((6.0, 6.0, 6.0)))
    assert score.planner == "sma-nbo" and score.cell == () and score.maps == 3
    assert score.mean.value == pytest.approx((10 - 6) / (10 - 2))
    residuals = np.array([2.0, 4.0, 6.0]) - 0.5 * np.array([6.0, 8.0, 10.0])
    assert score.mean == estimate_means((0.5 + residuals / 8)[:, None])[0]
    (ends,) = scored(cell((8.0, 10.0, 12.0)))
    assert ends.mean.value == 0 and math.isnan(ends.mean.low)
    (ends,) = scored(cell((2.0, 2.0, 2.0)))
    assert ends.mean.value == 1 and math.isnan(ends.mean.low)
    (worse,) = scored(cell((10.0, 12.0, 14.0)))
    assert worse.mean.value == pytest.approx(-0.25)
    (higher,) = scored(cell((0.5, 0.7), (0.2, 0.2), (1.0, 1.0), name=SHARE.name), SHARE)
    assert higher.mean.value == pytest.approx(0.5)


def test_a_score_on_a_metric_of_the_users_has_its_direction(tmp_path, monkeypatch):
    text = "from sim.facts.metrics.metric import Metric\n\n"
    text += 'FOUND = Metric("found", better="higher", name="ownscore:FOUND")\n'
    (tmp_path / "ownscore.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    rows = cell((0.5, 0.7), (0.2, 0.2), (1.0, 1.0), name="ownscore:FOUND")
    found = scored_study(rows, group_rows(rows, "hover"), msgspec.structs.replace(SCORED, metric="ownscore:FOUND"))
    assert [score.mean.value for score in found.scores] == [pytest.approx(0.5)]


def test_maps_without_floor_or_bound_do_not_count_nor_do_cells_without_room():
    rows = [*cell((6.0, 6.0, 6.0))[:-1], failed("sma-nbo", 2, (VIEW,))]
    (score,) = scored(rows)
    assert score.maps == 2 and score.mean.value == pytest.approx((9 - 6) / (9 - 2))
    assert scored(cell((6.0, 6.0, 6.0), bound=(20.0, 20.0, 20.0))) == []
    equal = (0.5, 0.5), (0.5, 0.5), (0.5, 0.5)
    assert scored(cell(*equal)) == scored(cell(*equal, name=SHARE.name), SHARE) == []


def test_the_mean_over_cells_is_by_seed_and_of_planners_in_all_of_them():
    worlds = [cell(own, factors=(("scenario", w),)) for w, own in (("a", (6.0, 6.0, 6.0)), ("b", (4.0, 8.0, 2.0)))]
    rows = [*worlds[0], *worlds[1], *flown("greedy", (3.0, 3.0, 3.0), (("scenario", "a"),))]
    found = {(s.cell, s.planner): s.mean for s in scored(rows)}
    one, other = (found[(("scenario", w),), "sma-nbo"].value for w in "ab")
    assert found[None, "sma-nbo"].value == pytest.approx((one + other) / 2) and (None, "greedy") not in found
    third = cell((6.0, 6.0, 6.0), factors=(("scenario", "c"),))
    some = [r for world in "ab" for r in flown("greedy", (3.0, 3.0, 3.0), (("scenario", world),))]
    assert {s.planner for s in scored([*worlds[0], *worlds[1], *third, *some]) if s.cell is None} == {"sma-nbo"}


def test_intervals_hold_the_score_of_many_maps():
    rng, held = np.random.default_rng(1), []
    for _ in range(300):
        floor = rng.gamma(4.0, 2.0, 12)
        bound = 0.3 * floor
        own = floor + rng.uniform(0.2, 1.0, 12) * (bound - floor)
        (score,) = scored(cell(own.tolist(), floor.tolist(), bound.tolist()))
        held.append(score.mean.low <= 0.6 <= score.mean.high)
    assert 0.91 < np.mean(held) < 0.99


def test_ends_are_found_where_options_follow_the_cell_and_by_their_own_labels():
    rows = []
    for h in "13":
        factors, planner = (("H", h),), f"sma-nbo(horizon={h})"
        rows += flown("hover", (8.0,), factors) + flown(planner, (2.0,), (*factors, VIEW))
    ends = "hover", "sma-nbo(view=unlimited), upper bound"
    assert find_score_ends(rows, SCORED) == ends and find_baseline(rows, ends[1]) == ends[1]
    given = parse_labels(rows, ["best=sma-nbo(view=unlimited)"])
    assert set(label_planners(rows, given).values()) == {"hover", "best, upper bound"}
    for named in ("best", "sma-nbo(horizon=3, view=unlimited)"):
        assert find_baseline(rows, named, given) == "best, upper bound"
    assert find_score_ends(rows, SCORED, given) == ("hover", "best, upper bound")


def test_the_bound_is_shown_as_one_and_is_no_cell_of_its_own():
    rows = cell((6.0, 6.0, 6.0))
    labels = set(label_planners(rows).values())
    assert labels == {"hover", "sma-nbo", "sma-nbo(view=unlimited), upper bound"}
    assert {group.cell for group in group_rows(rows)} == {()}
    with pytest.raises(InputError, match=r"'sma-nbo\(view=unlimited\)' is not one of the study's planners"):
        find_score_ends(rows[:6], SCORED)
