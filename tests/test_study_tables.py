"""Tables say what the answers are, wherever they are shown."""

import csv
import io
import math
import re

import numpy as np
import pytest
from rich.console import Console
from trials import failed, row, study

from sim.errors import InputError
from sim.study.answers import answers
from sim.study.cells import grouped
from sim.study.measures import measure
from sim.study.tables import comma_separated, markdown, show

MEAN = measure("ospa.mean_m")


def shown(rows, width, baseline="sma-nbo", metrics=()):
    console = Console(width=width, file=io.StringIO(), highlight=False)
    show(rows, baseline, metrics, on=console)
    return console.file.getvalue()


@pytest.mark.parametrize("width", [80, 120])
def test_the_terminal_shows_every_number_whole(width):
    text = shown(study(), width)
    assert max(map(len, text.splitlines())) <= width
    for answer in answers(grouped(study(), "sma-nbo"), [MEAN], "sma-nbo"):
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
        else:
            pieces.append("baseline")
        line = r"\s+".join(map(re.escape, pieces))
        assert re.search(rf"^ *{line} *$", text, flags=re.M), line
    assert text.startswith("Everywhere: R = 5\n") and "λ = 15" in text and "all cells" in text


def test_long_names_fold_and_markup_is_text():
    name = "lab.planners:Mine(style='[red]', horizon=5, optimizer=particle-swarm)"
    text = shown([row(name, 0), row("sma-nbo", 0)], 80)
    assert max(map(len, text.splitlines())) <= 80
    assert "[red]" in text and "+0.00" not in text and "-0.00" not in text  # equal


def test_what_does_not_count_is_said():
    rows = [row("sma-nbo", s, metrics={"ospa.mean_m": 1.0}) for s in range(3)]
    rows += [row("greedy", 0), row("greedy", 1, metrics={"ospa.mean_m": np.nan}), failed("greedy", 2)]
    for text in (shown(rows, 120), markdown(answers(grouped(rows, "sma-nbo"), [MEAN], "sma-nbo"), "sma-nbo")):
        assert "1/3" in text
        assert "greedy: 1 of 3 trials failed and do not count" in text
        assert "greedy: OSPA mean is undefined on 1 of 2 maps" in text
        assert "greedy: 1 of 3 maps have a pair with the baseline's" in text


def test_one_planner_alone_is_not_compared():
    text = shown([row("sma-nbo", s) for s in range(3)], 80)
    assert "won" not in text.split("In brackets")[0] and "1.00 [1.00, 1.00]" in text


def test_a_study_in_which_all_failed_still_has_a_table():
    text = shown([failed("sma-nbo", 0), failed("greedy", 0)], 80, metrics=["ospa.mean_m"])
    assert "0/1" in text and "–" in text and text.count("1 of 1 trials failed") == 2


def test_an_unknown_metric_is_an_input_error():
    with pytest.raises(InputError, match="--metric"):
        shown(study(), 80, metrics=["opsa.mean_m"])


def test_the_csv_holds_the_numbers_in_full():
    found = answers(grouped(study(), "sma-nbo"), [MEAN], "sma-nbo")
    lines = list(csv.DictReader(io.StringIO(comma_separated(found, "sma-nbo"))))
    assert len(lines) == len(found) == 3 * 2 + 2
    for line, answer in zip(lines, found, strict=True):
        assert (line["planner"], line["metric"]) == (answer.planner, "ospa.mean_m")
        assert line["lambda"] == ("all" if answer.cell is None else dict(answer.cell)["lambda"])
        for name in ("mean", "median"):
            estimate = getattr(answer, name)
            for column, value in (
                (name, estimate.value),
                (f"{name}_low", estimate.low),
                (f"{name}_high", estimate.high),
            ):
                assert line[column] == ("" if math.isnan(value) else repr(value))
        gap = answer.difference
        assert line["difference"] == ("" if gap is None else repr(gap.mean.value))
        assert line["won"] == ("" if gap is None else str(gap.won))


def test_markdown_tables_are_regular_and_escaped():
    rows = [row(p, s, (("net|work", "<b>"),)) for p in ("a|b:C", "sma-nbo") for s in (0, 1)]
    text = markdown(answers(grouped(rows, "sma-nbo"), [MEAN], "sma-nbo"), "sma-nbo")
    table = [line for line in text.splitlines() if line.startswith("|")]
    assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table}) == 1
    assert r"a\|b:C" in text and "<b>" not in text
