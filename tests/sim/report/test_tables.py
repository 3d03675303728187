"""Tables say what the answers are, wherever they are shown."""

import csv
import io
import math
import re

import msgspec
import numpy as np
import pytest
from helpers.trials import failed, row, study
from rich.console import Console

from sim.analysis.answers import answers
from sim.analysis.coverage import ERRORS, SHARES
from sim.analysis.groups import group_rows
from sim.analysis.metric_choice import metric_shown
from sim.report.formats import comma_separated, markdown
from sim.report.report import About
from sim.report.terminal import show
from tracking.errors import InputError

MEAN = metric_shown("ospa.mean_m")


def shown(rows, width, baseline="sma-nbo", metrics=()):
    console = Console(width=width, file=io.StringIO(), highlight=False)
    show(rows, About("tried", baseline=baseline, metrics=metrics), on=console)
    return console.file.getvalue()


def everywhere(rows):
    """The texts of the terminal and of Markdown."""
    return shown(rows, 120), markdown(answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo"), "sma-nbo")


@pytest.mark.parametrize("width", [80, 120])
def test_the_terminal_shows_every_number_whole(width):
    text = shown(study(), width)
    assert max(map(len, text.splitlines())) <= width
    for answer in answers(group_rows(study(), "sma-nbo"), [MEAN], "sma-nbo"):
        pieces = [answer.planner]
        if answer.cell is not None:
            low, high = answer.mean.low, answer.mean.high
            pieces += [str(answer.maps), f"{answer.mean.value:.2f} [{low:.2f}, {high:.2f}]"]
        if answer.cell is not None and width >= 100:
            pieces.append(f"{answer.median.value:.2f} [{answer.median.low:.2f}, {answer.median.high:.2f}]")
        if answer.cell is None:
            pieces.append("2 cells")
        if gap := answer.difference:
            pieces += [f"{gap.mean.value:+.2f} [{gap.mean.low:+.2f}, {gap.mean.high:+.2f}]"]
            pieces += [f"{gap.won}, {gap.tied}, {gap.lost}"]
            pieces += [f"{gap.needed:.0f}"] if width >= 100 else []
        else:
            pieces.append("baseline")
        line = r"\s+".join(map(re.escape, pieces))
        assert re.search(rf"^ *{line} *$", text, flags=re.M), line
    assert ("Maps needed: " in text) == (width >= 100)
    assert text.startswith("Everywhere: R = 5\n") and "λ = 15" in text and "all cells" in text


@pytest.mark.parametrize("width", [80, 120])
def test_long_titles_of_cells_do_not_break_intervals(width):
    cells = [(("radio range", reach), ("wind", wind)) for reach in ("near", "far") for wind in ("calm", "in gusts")]
    planners = {"greedy": 2.0, "hover": 1.8}
    found = [
        row(p, k, cell, {"ospa.mean_m": 8.0 + rate * k})
        for p, rate in planners.items()
        for cell in cells
        for k in range(4)
    ]
    text = shown(found, width, "greedy", ["ospa.mean_m"])
    assert max(map(len, text.splitlines())) <= width
    assert len(re.findall(r" hover +4 .*\d\] +-0\.30 \[-0\.\d\d, [+-]0\.\d\d\] +\d, \d, \d ", text)) == len(cells)


def test_terminal_and_markdown_fold_long_names_and_escape_markup():
    name = "lab.planners:Mine(style='[red]', horizon=5, optimizer=particle-swarm)"
    text = shown([row(name, 0), row("sma-nbo", 0)], 80)
    assert max(map(len, text.splitlines())) <= 80
    assert "[red]" in text and "+0.00" not in text and "-0.00" not in text  # equal
    rows = [row(p, s, (("net|work", "<b>"),)) for p in ("a|b:C", "sma-nbo") for s in (0, 1)]
    _, text = everywhere(rows)
    table = [line for line in text.splitlines() if line.startswith("|")]
    assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table}) == 1
    assert r"a\|b:C" in text and "<b>" not in text


def test_failed_trials_and_undefined_values_are_said_not_to_count():
    rows = [row("sma-nbo", s, metrics={"ospa.mean_m": 1.0}) for s in range(3)]
    rows += [row("greedy", 0), row("greedy", 1, metrics={"ospa.mean_m": np.nan}), failed("greedy", 2)]
    for text in everywhere(rows):
        assert "1/3" in text and "greedy: 1 of 3 trials failed and do not count" in text
        assert "greedy: OSPA mean is undefined in 1 of 2 trials" in text
        assert "greedy: 1 of 3 maps have a value of this planner and of the baseline" in text


def test_trials_in_which_a_planner_raised_are_said():
    faults = [2.0, 0.0, 7.0]
    rows = [row("sma-nbo", s, metrics={"ospa.mean_m": 1.0, "faults": many}) for s, many in enumerate(faults)]
    for text in everywhere(rows):
        assert "sma-nbo: faults in 2 of 3 trials" in text
    assert "faults in" not in shown(rows[1:2], 120)


def test_a_lone_planner_has_no_wins_failures_are_counted_and_unknown_metrics_refused():
    text = shown([row("sma-nbo", s) for s in range(3)], 80)
    assert "won" not in text.split("In brackets")[0] and "1.00 [1.00, 1.00]" in text
    text = shown([failed("sma-nbo", 0), failed("greedy", 0)], 80, metrics=["ospa.mean_m"])
    assert "0/1" in text and "–" in text and text.count("1 of 1 trials failed") == 2
    with pytest.raises(InputError, match="--metric"):
        shown(study(), 80, metrics=["opsa.mean_m"])


def test_the_csv_holds_the_numbers_in_full():
    found = answers(group_rows(study(), "sma-nbo"), [MEAN], "sma-nbo")
    lines = list(csv.DictReader(io.StringIO(comma_separated(found, "sma-nbo"))))
    assert len(lines) == len(found) == 3 * 2 + 2
    for line, answer in zip(lines, found, strict=True):
        assert (line["planner"], line["metric"]) == (answer.planner, "ospa.mean_m")
        assert line["lambda"] == ("all" if answer.cell is None else dict(answer.cell)["lambda"])
        for name in ("mean", "median"):
            estimate = getattr(answer, name)
            for end in ("value", "low", "high"):
                value = getattr(estimate, end)
                assert line[f"{name}_{end}".removesuffix("_value")] == ("" if math.isnan(value) else repr(value))
        gap = answer.difference
        assert line["difference"] == ("" if gap is None else repr(gap.mean.value))
        assert line["won"] == ("" if gap is None else str(gap.won))


def repeated(gap=1.0, seeds=8, repeats=3):
    """Two planners that differ by about `gap`, maps apart by about 1 and repeats by a tenth of it."""
    rng = np.random.default_rng(2)
    maps, noise = rng.normal(5, 1, seeds), rng.normal(0, 0.1, (2, seeds, repeats))
    return [
        row(planner, seed, metrics={"ospa.mean_m": float(maps[seed] + gap * i + noise[i, seed, r])}, repeat=r)
        for i, planner in enumerate(("sma-nbo", "greedy"))
        for seed in range(seeds)
        for r in range(repeats)
    ]


@pytest.mark.parametrize("width", [80, 120])
def test_spreads_between_and_within_maps_are_shown_where_maps_are_repeated(width):
    text = shown(repeated(), width, metrics=["ospa.mean_m"])
    assert max(map(len, text.splitlines())) <= width
    base, other = answers(group_rows(repeated(), "sma-nbo"), [MEAN], "sma-nbo")
    gap = other.difference
    assert 0.5 < base.spread.between < 2 and 0.05 < base.spread.within < 0.2 and 0.05 < gap.spread.within < 0.3
    own = [f"{value:.2f}" for value in (other.spread.between, other.spread.within)]
    shared = [f"{gap.spread.between:.2f}", f"{gap.spread.within:.2f}", f"{gap.needed:.0f}"]
    table = text[text.index("OSPA mean [m]: spread") :]
    assert re.search(r"^ *" + r" +".join(map(re.escape, ["greedy", *own, *shared])) + r" *$", table, flags=re.M)
    own = f"{base.spread.between:.2f} +{base.spread.within:.2f}"
    assert re.search(rf"^ *sma-nbo +{own} +baseline *$", table, flags=re.M)
    assert "Each map counts once, with the mean of its repeats." in text
    assert "spread" not in shown(repeated(repeats=1), width).lower()
    assert "spread**" in markdown([base, other], "sma-nbo")


def test_stars_mark_what_survives_holms_correction_and_not_what_holds_alone():
    weak = [msgspec.structs.replace(r, planner="weak") for r in repeated(0.02) if r.planner == "greedy"]
    rows = [*repeated(3.0), *weak]
    found = answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo")
    strong, weak = (next(a.difference for a in found if a.planner == name) for name in ("greedy", "weak"))
    assert (strong.significant, strong.survives, weak.significant, weak.survives) == (True, True, False, False)
    for text in (shown(rows, 120), markdown(found, "sma-nbo").replace("\\*", "*")):
        assert re.search(r"greedy .*\* \+3\.", text) and not re.search(r"weak .*\* [+-]", text)
        assert "* survives Holm's correction for all 2 differences shown (5 %)." in text
    few = shown([r for r in rows if r.seed < 6], 120)
    assert "No difference can survive Holm's correction for all 2 differences shown (5 %) on fewer than 7 maps." in few
    one_of_few = shown([r for r in rows if r.planner != "weak" or r.seed < 6], 120)  # the other has maps enough
    assert "* survives Holm's correction for all 2 differences shown (5 %)." in one_of_few
    assert "Holm" not in shown(repeated(), 120)
    assert "Holm" not in shown([*repeated(), row("alone", 99)], 120)  # no map in common: no second difference
    rows = [row("base", s, metrics={"ospa.mean_m": 1.0}) for s in range(10)]
    around = np.linspace(-1.0, 1.0, 10)
    for k in range(6):  # the first is a difference of 0.8 standard deviations, the others are none
        shift = 0.8 * (k == 0) * around.std(ddof=1)
        rows += [row(f"p{k}", s, metrics={"ospa.mean_m": 1.0 + shift + v}) for s, v in enumerate(around)]
    found = answers(group_rows(rows, "base"), [MEAN], "base")
    first = next(a.difference for a in found if a.planner == "p0")
    assert first.significant and not first.survives and 0.05 / 6 < first.p_value < 0.05


def test_tables_say_what_intervals_of_so_many_maps_or_pairs_cover():
    eight = shown(repeated(repeats=1), 120)
    usual, least = ERRORS[MEAN.name][8]
    assert f"Intervals of mean errors over 8 maps are right in {usual} % of cases, at worst in {least} %." in eight
    shares = [row(p, s, metrics={"ospa.share_under_1m": 0.1 * s}) for p in ("sma-nbo", "greedy") for s in range(8)]
    assert "are right in" not in shown(shares, 120)
    few = [r for r in shares if r.seed < 5]
    assert f"Intervals over only 5 maps are right in {SHARES[5]} % of cases." in shown(few, 120)
    assert f"Intervals over only 4 maps are right in {SHARES[3]} %" in shown(few[:4] + few[5:9], 120)
    name = "ospa.share_under_1m"
    seeds = {"sma-nbo": range(10), "greedy": range(6, 16)}  # four pairs
    rows = [row(planner, s, metrics={name: 0.05 * s}) for planner, own in seeds.items() for s in own]
    assert f"Intervals over only 4 maps are right in {SHARES[3]} % of cases." in shown(rows, 120, metrics=[name])
    rows = [row("sma-nbo", s, metrics={"contacts": float(s)}) for s in range(3)]
    assert "how often intervals are right for: contacts." in shown(rows, 120, metrics=["contacts"])


def test_the_csv_holds_spreads_chances_and_maps_needed():
    found = answers(group_rows(repeated(), "sma-nbo"), [MEAN], "sma-nbo")
    base, other = csv.DictReader(io.StringIO(comma_separated(found, "sma-nbo")))
    gap = found[1].difference
    assert (other["maps"], other["flown"], other["trials"], base["holm"], other["holm"]) == ("8", "8", "24", "", "1")
    assert (other["p"], other["maps_needed"]) == (repr(gap.p_value), repr(gap.needed))
    assert other["difference_between_maps"] == repr(gap.spread.between)
    assert base["within_maps"] == repr(found[0].spread.within) and base["difference_within_maps"] == ""
