"""A metric from outside the package: one file, and every place that shows metrics has it."""

import io
import json
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.pages import DOCS, blocks
from helpers.studies import Serial
from helpers.summaries import hand_made, shown, summary
from helpers.trials import row
from rich.console import Console

from sim.facts.metrics.catalogue import METRICS, evaluate, find_metric
from sim.facts.metrics.metric import Outcome
from sim.study.report.comparison import About
from sim.study.report.terminal import show
from sim.study.store import read_rows

FILE = """
import numpy as np

from sim.facts.metrics.metric import Metric


def farthest(outcome):
    return np.abs(outcome.recording.poses[:, :, :2]).max()


FARTHEST = Metric("farthest from the middle", farthest, "km", better="higher", scale=1e-3)
BROKEN = Metric("broken", lambda outcome: 1 / 0)


def moved(outcome):
    outcome.recording.poses[..., 0] += 100.0
    outcome.scores[0].gospa[:] = 0.0
    return outcome.recording.poses[0, 0, 0]


MOVED = Metric("moved", moved)
NONE = Metric("of nothing", lambda outcome: None)
NUMBER = 3
MORE = Metric("more is better", farthest, better="more")
ODD = Metric("how [/b]", lambda outcome: np.float64("nan"), "[/i]")
ENDLESS = Metric("endless [/b]", lambda outcome: np.inf)
"""


@pytest.fixture(autouse=True)
def mine(tmp_path, monkeypatch):
    """A module of metrics in the current folder."""
    (tmp_path / "mine.py").write_text(FILE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mine", raising=False)


def test_a_file_adds_a_metric_to_summary_and_table_of_runs(call, tmp_path, monkeypatch):
    found = summary(hand_made(), asked=["mine:FARTHEST", "mine:NONE"])
    told = {"label": "farthest from the middle", "unit": "km", "value": 0.0}
    assert found["metrics"] == {"mine:FARTHEST": told, "mine:NONE": {"label": "of nothing", "unit": "", "value": None}}
    assert "farthest from the middle" in shown(found) and "0.00 km" in shown(found)
    words = ["run", "--planner", "hover", "--duration", "1", "--set", "sensing.mode=ideal", "--no-video"]
    code, out, err = call(*words, "--metric", "mine:FARTHEST", "--out", "r")
    assert (code, err) == (0, "") and "farthest from the middle" in out
    value = json.loads((tmp_path / "r" / "summary.json").read_text())["metrics"]["mine:FARTHEST"]["value"]
    assert 0.02 < value < 0.1


def test_the_metric_of_the_page_is_the_way_that_uavs_flew(tmp_path, monkeypatch):
    page = (DOCS / "how-to" / "plugins.md").read_text("utf-8")
    (tmp_path / "mymetrics.py").write_text([code for language, code in blocks(page) if language == "py"][1])
    monkeypatch.delitem(sys.modules, "mymetrics", raising=False)
    poses = np.zeros((3, 2, 7))
    poses[1:, 0, :3], poses[:, 1, 0] = (3.0, 0.0, 4.0), (0.0, 1.0, 0.0)  # 5 m and 2 m
    outcome = SimpleNamespace(recording=SimpleNamespace(poses=poses))
    assert "--metric mymetrics:DISTANCE" in page and find_metric("mymetrics:DISTANCE").compute(outcome) == 3.5


def test_a_study_has_the_metric_in_rows_tables_and_report(compare, tmp_path):
    executor = Serial()
    words = ["--planner", "hover", "--seeds", "0", "--duration", "1", "--set", "sensing.mode=ideal"]
    assert compare(*words, executor=executor)[0] == 0
    code, out, _ = compare(*words, "--metric", "mine:FARTHEST", executor=executor)
    assert code == 0 and "middle [km]" in out
    assert len(executor.flown) == 2  # again, for the metric that the first flight lacked
    (row,) = read_rows(tmp_path / "runs" / "compare")
    assert 20 < row.metrics["mine:FARTHEST"] < 100
    assert "farthest from the middle [km]" in (tmp_path / "runs" / "compare" / "report.html").read_text()
    assert "mine:FARTHEST" in (tmp_path / "runs" / "compare" / "table.csv").read_text()


def test_a_metric_that_changes_the_outcome_changes_nothing_for_others():
    plain, found = summary(hand_made()), summary(hand_made(), asked=["mine:MOVED", "mine:FARTHEST"])
    assert found["metrics"]["mine:MOVED"]["value"] == 100.0 and found["metrics"]["mine:FARTHEST"]["value"] == 0.0
    assert (found["recording_sha256"], found["gospa"]) == (plain["recording_sha256"], plain["gospa"])


def test_a_metric_that_raises_is_undefined_and_a_fault():
    found = summary(hand_made(), asked=["mine:BROKEN"])
    assert found["metrics"]["mine:BROKEN"]["value"] is None
    (fault,) = found["faults"]
    assert fault["message"].startswith("metric mine:BROKEN: ZeroDivisionError") and math.isfinite(fault["time"])
    row = evaluate(Outcome(hand_made()), ["mine:BROKEN", "mine:FARTHEST"])
    assert row["mine:BROKEN"] is None and row["faults"] == 1  # of which tables of a study warn


def test_values_that_are_not_finite_are_null_and_labels_are_no_markup():
    found = summary(hand_made(), asked=["mine:ODD", "mine:ENDLESS"])
    assert [told["value"] for told in found["metrics"].values()] == [None, None]
    json.dumps(found, allow_nan=False)
    text = shown({**found, "planner": "mine:Mine(style='[/red]')"})
    assert "how [/b]" in text and "mine:Mine(style='[/red]')" in text
    rows = [row("a", seed, metrics={"mine:ODD": seed / 7}) for seed in range(3)]
    out = io.StringIO()
    show(rows, About("tried", metrics=("mine:ODD",)), on=Console(file=out, width=100))
    assert "how [/b] [[/i]]" in out.getvalue()


@pytest.mark.parametrize(
    ("command", "name", "words"),
    [
        ("compare", "mine:NUMBER", "cannot be imported: 'NUMBER' of mine is of type int, not a class or function"),
        ("compare", "mine:farthest", "is not a metric; expected a sim.facts.metrics.metric.Metric"),
        ("compare", "mine:MORE", "mine:MORE: better: 'more' is unknown; allowed are lower, higher, neither"),
        ("compare", "ospa.maen_m", "did you mean ospa.mean_m?"),
    ],
)
def test_what_is_no_metric_is_refused_in_one_line(refused, command, name, words, monkeypatch):
    assert words in refused(command, "--metric", name)


def test_intervals_of_the_metrics_of_the_catalogue_end_at_zero():
    assert {known.least for known in METRICS.values()} == {0.0}
