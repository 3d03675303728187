"""Wide tables of a study: what stands where, and what each mean is compared with."""

import itertools

import numpy as np
import pytest
from helpers.trials import failed, row, study

from sim.analysis.groups import drop_constant_factors, group_rows
from sim.analysis.intervals import means
from sim.report.wide_table import drop_start, main, set_side_by_side

SHARE = "ospa.share_under_1m"


def parsed(text):
    lines = [[part.strip() for part in line.strip("|").split("|")] for line in text.splitlines()]
    assert set(lines[1]) == {"---"} and len({len(line) for line in lines}) == 1
    return lines[0], {tuple(line[:-1]) if len(lines[0]) == 2 else line[0]: line[1:] for line in lines[2:]}


def shares(rows, **where):
    """The shares of the trials of a planner or with levels of factors."""
    return np.array(
        [r.metrics[SHARE] for r in rows if where.items() <= {"planner": r.planner, **dict(r.factors)}.items()]
    )


def shown(values, *, signed=False):
    (estimate,) = means(values[:, None])
    sign = "+" if signed else ""
    low, high = estimate.low, min(estimate.high, 1.0)  # a share has no more
    return f"{100 * estimate.value:{sign}.1f} [{100 * low:{sign}.1f}, {100 * high:{sign}.1f}]"


def test_planners_side_by_side_are_compared_with_the_first_or_baseline():
    rows = study(planners=("a", "b"))
    head, lines = parsed(set_side_by_side(rows, "planner"))
    assert head == ["λ", "a", "b"] and list(lines) == ["15", "75"]
    for density in ("15", "75"):
        a, b = (shares(rows, planner=name, **{"lambda": density}) for name in ("a", "b"))
        assert lines[density] == [shown(a), f"{100 * b.mean():.1f}: {shown(b - a, signed=True)}"]
    rows = study(planners=("a(x=1)", "b"))
    head, lines = parsed(set_side_by_side(rows, "planner", baseline="b"))
    assert head == ["λ", "b", "a(x=1)"]
    a, b = (shares(rows, planner=name, **{"lambda": "15"}) for name in ("a(x=1)", "b"))
    assert lines["15"] == [shown(b), f"{100 * a.mean():.1f}: {shown(a - b, signed=True)}"]
    assert set_side_by_side(rows, "planner", baseline="a") == set_side_by_side(rows, "planner")


def test_levels_one_below_the_other_are_compared_with_the_line_before():
    steps = ("1-paper", "2-known", "10-default")
    rows = [
        row("sma-nbo", seed, (("lambda", density), ("step", step)), {SHARE: rng})
        for density in ("15", "75")
        for k, step in enumerate(steps)
        for seed, rng in enumerate(np.random.default_rng((k, int(density))).uniform(size=8).tolist())
    ]
    head, lines = parsed(set_side_by_side(rows, "lambda", "above"))
    assert head == ["step", "λ = 15", "λ = 75"] and tuple(lines) == steps
    values = {step: [shares(rows, step=step, **{"lambda": density}) for density in ("15", "75")] for step in steps}
    assert lines[steps[0]] == [shown(v) for v in values[steps[0]]]
    for before, step in itertools.pairwise(steps):
        pairs = zip(values[step], values[before], strict=True)
        assert lines[step] == [f"{100 * v.mean():.1f}: {shown(v - w, signed=True)}" for v, w in pairs]


def test_what_is_not_comparable_not_flown_or_failed_is_left_out():
    rows = [
        row("a", seed, (("lambda", density), ("step", step)), {SHARE: 0.1 * seed})
        for density in ("15", "75")
        for step in ("1", "2")
        for seed in range(3)
    ]
    text = set_side_by_side(rows, "planner", "above").splitlines()[2:]
    assert [":" in line for line in text] == [False, True, False, True]
    rows = [row("a", s, (("H", h),), {SHARE: 0.5 + 0.1 * s}) for h in ("1", "3") for s in range(3)]
    rows += [row("b", 0, (("H", "3"),), {SHARE: 0.9}), failed("b", 1, (("H", "3"),))]
    _head, lines = parsed(set_side_by_side(rows, "planner"))
    assert lines["1"][1] == "-" and lines["3"][1] == "90.0: +40.0"


def test_trials_flown_without_a_factor_stand_beside_the_others():
    rows = [row("a", s, (("H", h),), {SHARE: 0.5}) for h in ("1", "3") for s in range(3)]
    rows += [row("a", s, (), {SHARE: 0.25}) for s in range(3)]
    _, lines = parsed(set_side_by_side(rows, "planner"))
    assert list(lines) == [("-",), ("1",), ("3",)] and lines["-",] == ["25.0 [25.0, 25.0]"]
    head, _ = parsed(set_side_by_side(rows, "H"))
    assert head == ["H = 1", "H = 3", "H = -"]
    few = [r for r in rows if r.factors != (("H", "3"),)]  # one value, and none: no value of all
    assert {group.cell for group in drop_constant_factors(group_rows(few))} == {(), (("H", "1"),)}


def test_names_are_escaped_as_in_other_tables():
    assert set_side_by_side([row("lab:Mine(style='a|b')", 0, (), {SHARE: 0.5})], "planner").startswith(
        r"| lab:Mine(style='a\|b') |"
    )


def test_the_start_of_a_mission_can_be_left_out():
    ospa = np.array([50.0, 50.0, 0.5, 2.0, 0.5, 0.5], dtype=np.float32)
    rows = [row("a", 0, (), {SHARE: 0.5}, ospa=ospa), failed("a", 1)]
    assert drop_start(rows, 0) == rows
    later = drop_start(rows, 2)
    assert later[0].metrics[SHARE] == 0.75 and later[1] is rows[1] and rows[0].metrics[SHARE] == 0.5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"columns": "lamda"}, "--columns: 'lamda' is unknown; allowed are lambda, planner; did you mean lambda?"),
        ({"less": "right"}, "--less: 'right' is unknown; allowed are left, above"),
        ({"columns": "planner", "baseline": "c"}, "--baseline: 'c' is not one of the study's planners"),
        ({"first": 10, "metric": "ospa.mean_m"}, "--from-scan: counts ospa.share_under_1m alone, not ospa.mean_m"),
        ({}, "there is no store of a study"),
    ],
)
def test_wrong_options_of_a_wide_table_are_named(tmp_path, options, words):
    with pytest.raises(ValueError) as caught:
        if "columns" in options:
            set_side_by_side(study(), **options)
        else:
            main(tmp_path, **{"columns": "planner", "less": "left", "first": 0, "metric": SHARE, **options})
    assert words in str(caught.value) and "\n" not in str(caught.value)
