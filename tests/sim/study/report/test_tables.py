"""Tables say what the answers are, wherever they are shown."""

import csv
import io
import re
from dataclasses import astuple
from html import unescape

import msgspec
import numpy as np
import pytest
from helpers.trials import failed, row, study
from rich.console import Console

from sim.study.analysis.answers import find_answers
from sim.study.analysis.groups import group_rows
from sim.study.analysis.intervals import Estimate
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.report.comparison import About
from sim.study.report.html_parts import make_bullet_list, make_titled_tables
from sim.study.report.sentences import list_shortfalls, write_notes, write_verdict
from sim.study.report.tables import format_csv, make_answer_tables
from sim.study.report.terminal import show
from tracking.errors import InputError

MEAN = find_shown_metric("ospa.mean_m")
ENDS = ("", "_low", "_high")  # of names of an estimate in table.csv


def shown(rows, width, baseline="sma-nbo", metrics=()):
    console = Console(width=width, file=io.StringIO(), highlight=False)
    show(rows, About("tried", baseline=baseline, metrics=metrics), on=console)
    return console.file.getvalue()


def everywhere(rows):
    """The texts of the terminal and of the page."""
    found = find_answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo")
    html = make_titled_tables(make_answer_tables(found, "sma-nbo"))
    return shown(rows, 120), html + unescape(make_bullet_list([*write_notes(found), *list_shortfalls(found)]))


@pytest.mark.parametrize("width", [80, 120, 140])
def test_the_terminal_shows_every_number_whole(width):
    text = shown(study(), width)
    assert max(map(len, text.splitlines())) <= width
    for answer in find_answers(group_rows(study(), "sma-nbo"), [MEAN], "sma-nbo"):
        pieces = [answer.planner]
        if answer.cell is not None:
            low, high = answer.mean.low, answer.mean.high
            pieces += [str(answer.maps), f"{answer.mean.value:.2f} [{low:.2f}, {high:.2f}]"]
        if answer.cell is not None and width >= 100:
            pieces.append(f"{answer.median.value:.2f} [{answer.median.low:.2f}, {answer.median.high:.2f}]")
        if answer.cell is not None and width >= 132:
            pieces += [f"{answer.tail.decile:.2f}", f"{answer.tail.worst:.2f} (seed {answer.tail.seed})"]
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


def test_terminal_and_page_fold_long_names_and_escape_markup():
    name = "lab.planners:Mine(style='[red]', horizon=5, optimizer=particle-swarm)"
    text = shown([row(name, 0), row("sma-nbo", 0)], 80)
    assert max(map(len, text.splitlines())) <= 80
    assert "[red]" in text and "+0.00" not in text and "-0.00" not in text  # equal
    rows = [row(p, s, (("net|work", "<b>"),)) for p in ("a|b:C", "sma-nbo") for s in (0, 1)]
    _, text = everywhere(rows)
    assert "a|b:C" in text and "<b>" not in text


def test_failed_trials_and_undefined_values_are_said_not_to_count():
    rows = [row("sma-nbo", s, metrics={"ospa.mean_m": 1.0}) for s in range(3)]
    rows += [row("greedy", 0), row("greedy", 1, metrics={"ospa.mean_m": np.nan}), failed("greedy", 2)]
    for text in everywhere(rows):
        assert "1/3" in text and "greedy: 1 of 3 trials failed and do not count" in text
        assert "greedy: OSPA mean is undefined in 1 of 2 trials" in text
        assert "greedy: 1 of 3 maps have a value of this planner and of the baseline" in text


@pytest.mark.parametrize("worlds", [[7.0] * 6, [7.0, 7.0, 8.0, 9.0, 10.0, 11.0], range(6), None])
def test_seeds_that_share_a_world_are_flights_and_no_maps(worlds):
    """Those of files, or of forests so thin that several have no tree; older rows do not say which world they flew."""
    rows = [
        row(p, s, metrics={"ospa.mean_m": 1.0 + i + 0.1 * s} | ({"world": float(worlds[s])} if worlds else {}))
        for i, p in enumerate(("sma-nbo", "greedy"))
        for s in range(6)
    ]
    alike = worlds is not None and len(set(worlds)) < 6
    answer = find_answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo")[-1]
    for text in everywhere(rows):
        assert bool(re.search(r"greedy\W.*6 flights\W", text)) == alike
        assert ("Flights, not maps: seeds share trees and people" in text) == alike
    told = write_verdict("greedy", "sma-nbo", MEAN, answer.difference, sample=answer.sample)
    assert f"of 6 {'flights' if alike else 'maps'} it won" in told


def test_flights_of_one_world_with_repeats_are_counted_by_seed():
    """Each seed counts once: two of them with two repeats are four flights, not two."""
    rows = [
        row(p, s, repeat=n, metrics={"ospa.mean_m": 1.0 + i + 0.1 * s + 0.03 * n, "world": 7.0})
        for i, p in enumerate(("sma-nbo", "greedy"))
        for s in range(2)
        for n in range(2)
    ]
    answer = find_answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo")[-1]
    assert (answer.maps, answer.trials) == (2, 4)
    for text in everywhere(rows):
        assert re.search(r"greedy\W.*2 seeds\W", text) and not re.search(r"\D[24] (flights|maps)\W", text)
        assert "Seeds, not maps: seeds share trees and people" in text
        assert "Each seed counts once, with the mean of its repeats." in text
    told = write_verdict("greedy", "sma-nbo", MEAN, answer.difference, sample=answer.sample)
    assert "2 seeds are too few" in told and "of 2 seeds it won" in told


def test_a_difference_over_few_maps_is_not_left_to_its_interval():
    told = "Fewer than 6 are too few to tell planners apart, wherever the interval ends."
    for text in everywhere(study(seeds=5)):
        assert told in text
    assert told not in shown(study(seeds=6), 120)


def test_decisions_that_failed_have_a_column_where_there_are_any():
    shares = {"sma-nbo": [0.0, 0.0], "greedy": [1.0, 0.5]}
    rows = [row(p, s, metrics={"failed_decisions": v}) for p, own in shares.items() for s, v in enumerate(own)]
    for text in everywhere(rows):
        assert re.search(r"failed(\s|.*\n.*)decisions", text) and re.search(r"greedy\W.*75\.0 %", text)
    assert "75.0 %" not in shown(rows[:2], 120)
    found = find_answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo")
    (line,) = [
        line for line in csv.DictReader(io.StringIO(format_csv(found, "sma-nbo"))) if line["planner"] == "greedy"
    ]
    assert float(line["failed_decisions"]) == 0.75


def test_trials_in_which_a_planner_raised_are_said():
    faults = [2.0, 0.0, 7.0]
    rows = [row("sma-nbo", s, metrics={"ospa.mean_m": 1.0, "faults": many}) for s, many in enumerate(faults)]
    for text in everywhere(rows):
        assert "sma-nbo: faults in 2 of 3 trials" in text
    assert "faults in" not in shown(rows[1:2], 120)


def test_a_lone_planner_has_no_wins_failures_are_counted_and_unknown_metrics_refused():
    text = shown([row("sma-nbo", s) for s in range(3)], 80)
    assert "won" not in text.split("In brackets")[0] and re.search(r"sma-nbo +3 +1.00 *\n", text)
    assert "No brackets where fewer than 6 maps differ" in text
    text = shown([failed("sma-nbo", 0), failed("greedy", 0)], 80, metrics=["ospa.mean_m"])
    assert "0/1" in text and "–" in text and text.count("1 of 1 trials failed") == 2
    with pytest.raises(InputError, match="--metric"):
        shown(study(), 80, metrics=["opsa.mean_m"])


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


def test_stars_mark_what_survives_holms_correction_and_not_what_holds_alone():
    weak = [msgspec.structs.replace(r, planner="weak") for r in repeated(0.02) if r.planner == "greedy"]
    rows = [*repeated(3.0), *weak]
    found = find_answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo")
    strong, weak = (next(a.difference for a in found if a.planner == name) for name in ("greedy", "weak"))
    assert (strong.significant, strong.survives, weak.significant, weak.survives) == (True, True, False, False)
    for text in everywhere(rows):
        assert re.search(r"greedy\b.*\* \+3\.", text) and not re.search(r"weak\b.*\* [+-]", text)
        assert "* survives Holm's correction for all 2 differences shown (5 %)." in text
    few = shown([r for r in rows if r.seed < 6], 120)
    assert "No difference can survive Holm's correction for all 2 differences shown (5 %) on fewer than 7 maps." in few
    one_of_few = shown([r for r in rows if r.planner != "weak" or r.seed < 6], 120)  # the other has maps enough
    assert "* survives Holm's correction for all 2 differences shown (5 %)." in one_of_few
    assert "Holm" not in shown(repeated(), 120)
    assert "Holm" not in shown([*repeated(), row("alone", 99)], 120)  # no map in common: no second difference


def test_tables_say_where_intervals_hold_less_often_than_they_claim():
    told = "Intervals over fewer than 8 maps, and those of mean errors in metres, are right less often"
    assert told in shown(repeated(repeats=1), 120, metrics=["ospa.mean_m"])
    seeds = {"sma-nbo": range(10), "greedy": range(6, 16)}  # ten maps each, four pairs
    rows = [row(p, s, metrics={"ospa.share_under_1m": 0.05 * s}) for p, own in seeds.items() for s in own]
    assert told in shown(rows, 120) and told not in shown(rows[:10], 120)


@pytest.mark.parametrize("rows", [study(), repeated(), study(planners=("sma-nbo",))])
def test_the_csv_holds_every_number_in_full_and_nothing_where_there_is_none(rows):
    found = find_answers(group_rows(rows, "sma-nbo"), [MEAN], "sma-nbo")
    lines = list(csv.DictReader(io.StringIO(format_csv(found, "sma-nbo"))))
    factors = dict.fromkeys(name for row in rows for name, _ in row.factors)
    for line, answer in zip(lines, found, strict=True):
        cell, gap = answer.cell, answer.difference
        estimates = {"mean": answer.mean, "median": answer.median, "difference": gap.mean if gap else Estimate()}
        expected = {
            **{name: "all" if cell is None else dict(cell)[name] for name in factors},
            **{"planner": answer.planner, "metric": "ospa.mean_m", "baseline": "sma-nbo" if gap else ""},
            **{name: getattr(answer, name) for name in ("maps", "flown", "trials", "failed", "undefined")},
            "failed_decisions": "" if cell is None else 0.0,
            **{name: getattr(gap, name, "") for name in ("pairs", "unpaired", "won", "tied", "lost")},
            **{
                f"{name}{end}": value
                for name, e in estimates.items()
                for end, value in zip(ENDS, astuple(e), strict=True)
            },
            **{"bad_decile": answer.tail.decile, "worst": answer.tail.worst},
            "worst_seed": "" if answer.tail.seed is None else answer.tail.seed,
            **{"p": getattr(gap, "p_value", ""), "maps_needed": getattr(gap, "needed", "")},
            "holm": int(gap.survives) if gap else "",
        }
        assert line == {name: "" if value != value else str(value) for name, value in expected.items()}
