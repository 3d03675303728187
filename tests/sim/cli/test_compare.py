"""`understory compare`: what it says, what it leaves, and how it ends."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.studies import Serial, sql

import understory
from sim.mission.archive import load_recording
from sim.study.store import Store, StoreError, read_rows

FLAGS = ["--duration", "1", "--set", "sensing.mode=ideal"]
INVENTED = {"no planner": []}  # nothing is flown, rows are drawn by chance
FILE = """
study = { name = "mine", planners = ["hover", "greedy"], seeds = "0" }
factors.L.3.trees.density = 3
factors.L.5.trees.density = 5
"""
LONG = ("sma-nbo(horizon=3, evaluations=640, beta=0.2)", "sma-nbo(horizon=5, evaluations=640, beta=0.2)")


def test_a_study_file_is_flown_once_and_shown_by_cell(compare, tmp_path):
    (tmp_path / "mine.toml").write_text(FILE)
    code, out, err = compare("mine.toml", *FLAGS, "--seeds", "0-1", executor=Serial(INVENTED))
    assert (code, err) == (0, "")
    table = out[: out.index("OSPA mean")].splitlines()
    cells = [line.split()[:2] for line in table if line.split()[:1] in (["hover"], ["greedy"], ["L"])]
    assert cells == [["L", "="], ["hover", "2"], ["greedy", "2"]] * 2 + [["greedy", "2"]]
    assert "Results in runs/mine" in out and len(read_rows(tmp_path / "runs" / "mine")) == 8
    executor = Serial(INVENTED)
    assert compare("mine.toml", *FLAGS, "--seeds", "0-2", executor=executor)[0] == 0
    assert executor.flown == [("hover", 2), ("greedy", 2)] * 2
    executor = Serial(INVENTED)
    compare("mine.toml", *FLAGS, "--redo", executor=executor)
    assert len(executor.flown) == 4


def test_more_repeats_are_flown_on_the_same_maps_and_shown(compare, tmp_path):
    options = ["--planner", "hover", "--planner", "greedy", "--seeds", "0-1", *FLAGS, "--metric", "ospa.mean_m"]
    code, out, _ = compare(*options)
    assert code == 0 and "repeats" not in out
    executor = Serial()
    code, out, _ = compare(*options, "--repeats", "2", executor=executor)
    assert code == 0 and executor.flown == [("hover", 0), ("greedy", 0), ("hover", 1), ("greedy", 1)]
    assert "Each map counts once, with the mean of its repeats." in out
    rows = read_rows(tmp_path / "runs" / "compare")
    assert sorted((r.seed, r.repeat) for r in rows if r.planner == "hover") == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert len({r.ospa.tobytes() for r in rows}) == 8
    page = (tmp_path / "runs" / "compare" / "report.html").read_text()
    assert "--repeat 1 --set" in page and "2 maps are too few to tell greedy and hover apart" in page


def test_long_planners_are_told_apart_by_what_differs_or_by_labels(compare, tmp_path):
    options = ["--planner", LONG[0], "--planner", LONG[1], "--seeds", "0-1", *FLAGS]
    code, out, _ = compare(*options, executor=Serial(INVENTED))
    assert code == 0 and f"sma-nbo(horizon=5) is {LONG[1]}\n" in out
    table = out[: out.index("OSPA mean")].splitlines()
    assert [line.split()[0] for line in table if " 2 " in line] == ["sma-nbo(horizon=3)", "sma-nbo(horizon=5)"]
    labels = ["--label", f"far={LONG[1]}", "--label", f"near = {LONG[0]}"]
    code, out, _ = compare(*options, *labels, "--baseline", "far")
    assert code == 0 and "minus far" in out
    assert f"far is {LONG[1]}\nnear is {LONG[0]}\n" in out and out.count("sma-nbo") == 2  # nowhere else
    files = tmp_path / "runs" / "compare"
    assert [line.split(",")[0] for line in (files / "table.csv").read_text().splitlines()[1:3]] == ["near", "far"]
    page = (files / "report.html").read_text()
    assert "near and far cannot be told apart" in page and f"--planner &#x27;{LONG[1]}&#x27;" in page


def test_a_scenario_name_or_file_is_compared_by_flags(compare, tmp_path):
    (tmp_path / "grove.toml").write_text("duration = 1.0\ntrees.density = 3\nsensing.mode = 'ideal'\n")
    code, out, _ = compare("grove.toml", "--planner", "hover", "--seeds", "4", "--keep", "recordings")
    assert code == 0 and "Results in runs/compare" in out
    (row,) = read_rows(tmp_path / "runs" / "compare")
    assert (row.scenario, row.factors, row.planner, row.seed) == ("grove.toml", (), "hover", 4)
    (path,) = (tmp_path / "runs" / "compare" / "recordings").iterdir()
    recording = load_recording(path)
    assert (recording.planner, recording.seed, len(recording.times)) == ("hover", 4, 6)
    assert sql(tmp_path / "runs" / "compare", "SELECT key FROM trials") == [(path.stem,)]


def test_failures_and_ctrl_c_are_told_by_the_exit_code_and_keep_the_rest(compare, tmp_path, capsys):
    executor = Serial({"hover": ["ValueError: no"] * 4})
    options = ["--planner", "hover", "--planner", "greedy", "--seeds", "0-1"]
    code, out, err = compare(*options, *FLAGS, executor=executor)
    assert code == 1 and "flies again what failed" in out
    assert err == "understory: 2 of 4 trials failed, hover, seed 0: ValueError: no\n"
    assert sorted(row.status for row in read_rows(tmp_path / "runs" / "compare")) == ["done"] * 2 + ["failed"] * 2
    executor = Serial({"hover": [None, None, OSError("gone"), KeyboardInterrupt]})  # when the third is tried again
    code, _, err = compare("--planner", "hover", "--seeds", "0-2", *FLAGS, "--out", "s", executor=executor)
    assert code == 1
    assert err == "understory: interrupted; 2 of 3 trials are kept in s, the same command flies the rest\n"
    assert len(read_rows(tmp_path / "s")) == 2
    executor = Serial({"hover": [None, OSError("gone"), KeyboardInterrupt]})
    options = ["--planner", "hover", "--seeds", "0-1", *FLAGS, "--out", "s", "--redo"]
    rest = "in s 2 are there; without --redo, the same command flies what is missing"
    told = f"understory: interrupted; 1 of 2 trials were flown now, {rest}\n"
    assert compare(*options, executor=executor)[::2] == (1, told)


def test_a_full_disk_is_told_by_the_exit_code_and_loses_nothing(compare, tmp_path, monkeypatch):
    options = ["--planner", "hover", "--planner", "greedy", "--seeds", "0-1", *FLAGS, "--out", "full[x]"]
    add, full = Store.add, StoreError("study.sqlite: database or disk is full")

    def added(store, task, row):
        if len(read_rows(store.path)) == 3:
            raise full
        add(store, task, row)

    monkeypatch.setattr(Store, "add", added)
    code, _, err = compare(*options, executor=Serial(INVENTED))
    end = "full; 3 of 4 trials are kept in full[x], the same command flies the rest"
    assert (code, err) == (1, f"understory: study.sqlite: database or disk is {end}\n")
    monkeypatch.setattr(Store, "add", add)

    def failing(*arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("pathlib.Path.write_bytes", failing)
        executor = Serial(INVENTED)
        code, _, err = compare(*options, executor=executor)
    told = "report: full[x] cannot be written: No space left on device; all 4 trials are kept in full[x]"
    assert (code, err) == (1, f"understory: {told}, the same command writes the report\n") and len(executor.flown) == 1
    executor = Serial()
    code, out, err = compare(*options, executor=executor)
    assert (code, err, executor.flown) == (0, "", []) and "Results in full[x] (report.html)." in out


def test_what_ends_before_the_first_trial_is_one_line_and_says_that_nothing_was_flown(compare):
    class Lost(Serial):
        def __enter__(self):
            raise StoreError("no room")

    code, _, err = compare("--planner", "hover", *FLAGS, "--out", "s", executor=Lost())
    assert (code, err) == (1, "understory: no room; no trial was flown, s is unchanged\n")


def test_what_was_flown_otherwise_is_flown_again_or_kept_apart(compare, tmp_path):
    options = ["--planner", "hover", "--seeds", "0", *FLAGS, "--out", "s"]
    for extra, flown in (([], 1), (["--keep", "recordings"], 1), (["--keep", "recordings"], 0)):
        executor = Serial()
        assert compare(*options, *extra, executor=executor)[0] == 0 and len(executor.flown) == flown
    assert len(list((tmp_path / "s" / "recordings").iterdir())) == len(read_rows(tmp_path / "s")) == 1
    options = ["--planner", "hover", "--seeds", "0", *FLAGS]
    compare(*options)
    sql(tmp_path / "runs" / "compare", "UPDATE trials SET version = '0.0.9', key = 'x'")
    executor = Serial()
    code, _, err = compare(*options, executor=executor)
    assert code == 0 and len(executor.flown) == 1
    assert err.endswith("trials of another version are kept apart, not shown: 1 of version 0.0.9\n")


def test_trials_in_the_folder_that_the_command_does_not_show_are_counted(compare):
    first = ["--planner", "hover", "--seeds", "0,1", *FLAGS, "--out", "s"]
    assert "not shown" not in compare(*first, executor=Serial())[2]
    code, _, err = compare("--planner", "greedy", "--seeds", "0", *FLAGS, "--out", "s", executor=Serial())
    told = (
        "understory: s/study.sqlite: kept, not shown: 2 trials of other planners, code, scenarios, settings or seeds\n"
    )
    assert code == 0 and err.endswith(told)
    both = ("--planner", "hover", "--planner", "greedy", "--out", "s", *FLAGS)
    assert compare(*both, "--seeds", "0", executor=Serial())[2].endswith(told.replace("2 trials", "1 trial"))
    assert "not shown" not in compare(*both, "--seeds", "0,1", executor=Serial())[2]


@pytest.mark.parametrize(
    ("then", "place"),
    [
        (["--planner", "greedy", "--seeds", "0-1"], "compare-2"),
        (["--planner", "hover", "--seeds", "0"], "compare-2"),
        (["--planner", "hover", "--seeds", "2-3"], "compare-2"),
        (["--planner", "hover", "--seeds", "0-1", "--set", "wind.gust=1"], "compare-2"),
        (["--planner", "hover", "--seeds", "0-1", "--tracker", "jpda"], "compare"),
        (["--planner", "hover", "--seeds", f"0-1,{2**70}"], "compare"),
        (["--planner", "hover", "--planner", "greedy", "--seeds", "0-1"], "compare"),
        (["--planner", "hover()", "--seeds", "0-1", "--metric", "faults", "--redo"], "compare"),
    ],
)
def test_a_report_is_replaced_only_by_one_of_the_same_trials_or_more(compare, then, place):
    first = Path("runs/compare")
    assert compare("--planner", "hover", "--seeds", "0-1", *FLAGS, executor=Serial(INVENTED))[0] == 0
    before = (first / "report.html").read_bytes()
    for _ in range(2):  # the same command goes on where it was
        code, out, err = compare(*then, *FLAGS, executor=Serial(INVENTED))
        assert code == 0 and f"Results in runs/{place} (report.html)" in out
        assert (f"runs/compare holds other results; those of this comparison go into runs/{place}" in err) == (
            place != "compare"
        )
    assert ((first / "report.html").read_bytes() == before) == (place != "compare")
    assert sorted(path.name for path in Path("runs").iterdir()) == sorted({"compare", place})


def test_own_planners_and_trackers_come_first_then_the_order_given(compare, tmp_path, monkeypatch):
    (tmp_path / "ordered.py").write_text("from planning.baselines import Hover as Mine\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    planners = ["random", "greedy", "ordered:Mine", "hover"]
    options = [word for planner in planners for word in ("--planner", planner)]
    _, out, _ = compare(*options, "--seeds", "0", *FLAGS, "--out", "s", executor=Serial(INVENTED))
    names = [line.split()[0] for line in out.splitlines() if re.search(r"\s1\s+0\.\d\d", line)]
    assert names[:4] == ["Mine", "random", "greedy", "hover"] and "minus random" in out
    lines = Path("s/table.csv").read_text().splitlines()[1:5]
    assert [line.partition(",")[0] for line in lines] == ["ordered:Mine", "random", "greedy", "hover"]


@pytest.mark.parametrize("taken", ["report.html", "mission.npz"])
def test_results_without_a_store_are_left_alone(compare, taken):
    Path("runs/compare").mkdir(parents=True)
    Path("runs/compare", taken).write_text("mine")
    out = compare("--planner", "hover", "--seeds", "0", *FLAGS, executor=Serial(INVENTED))[1]
    assert "Results in runs/compare-2" in out and Path("runs/compare", taken).read_text() == "mine"


SCORED = """
study = { name = "mine", planners = ["greedy"], seeds = "0-1", scenarios = ["forest", "scatter"] }
score = { floor = "hover", bound = "greedy", metric = "ospa.mean_m" }
"""


def test_a_study_with_a_score_flies_its_ends_and_shows_scores(compare, tmp_path):
    (tmp_path / "mine.toml").write_text(SCORED)
    flags = ["--duration", "1", "--set", "trees.density=3"]
    code, out, err = compare("mine.toml", *flags, "--planner", "lawnmower", executor=Serial(INVENTED))
    assert (code, err) == (0, "") and "view=unlimited" in out
    assert "upper bound" in (tmp_path / "runs" / "mine" / "report.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("study", "words"),
    [
        (SCORED.replace("ospa.mean_m", "opsa.mean_m"), "score.metric: 'opsa.mean_m' is unknown; allowed are"),
        (SCORED + 'exclude = [{ planner = "hover" }]', "score.floor: 'hover' is not one of the study's planners"),
    ],
    ids=["metric", "floor"],
)
def test_a_score_that_the_trials_will_not_have_is_refused_before_they_fly(refused, tmp_path, study, words):
    (tmp_path / "mine.toml").write_text(study)
    assert words in refused("compare", "mine.toml", *FLAGS[:2])


def test_what_a_flag_varies_is_answered_by_level_and_from_python(compare, tmp_path):
    share = "ospa.share_under_1m"
    options = [
        "--planner",
        "hover",
        "--vary",
        "fleet.size=1-2",
        "--vary",
        "uavs.*.altitude=80,30",
        "--seeds",
        "0-15",
        *FLAGS,
    ]
    code, out, err = compare(*options, "--at-least", f"{share}=0.3", executor=Serial(INVENTED))
    assert (code, err) == (0, "")
    rows = read_rows(tmp_path / "runs" / "compare")
    assert len(rows) == 2 * 2 * 16 and rows[0].settings["fleet.size"] == "1"
    text = " ".join(out.split())
    assert text.index("[%] over fleet.size") < text.index("[%] over uavs.*.altitude")
    chosen = (
        "hover: fleet.size = 1, uavs.*.altitude = 80 was the cheapest of 4 with a mean of at least 30 % on seeds 0-7"
    )
    assert f"- {chosen}" in text and "on seeds 8-15, which had no part in the choice, it has" in text
    means = [np.mean([r.metrics[share] for r in rows if r.seed // 8 == half]) for half in (0, 1)]  # equal at all levels
    assert f"({'scans with OSPA under 1 m'} {100 * means[0]:.1f} %" in text and f"it has {100 * means[1]:.1f} %" in text
    page = (tmp_path / "runs" / "compare" / "report.html").read_text()
    assert chosen in page and "nothing to compare" not in page
    assert "being equal on every map" in page and "over uavs.*.altitude [%]" not in page
    frame = understory.compare_levels(tmp_path / "runs" / "compare", share, threshold=0.3)
    assert list(frame["factor"]) == ["fleet.size"] * 4 + ["uavs.*.altitude"] * 4
    assert list(frame["factor.uavs.*.altitude"]) == ["30"] * 2 + ["80"] * 2 + ["30", "80"] * 2
    own = [r.metrics[share] for r in rows if r.factors == (("fleet.size", "1"), ("uavs.*.altitude", "30"))]
    assert frame["mean"][0] == pytest.approx(np.mean(own)) and frame["met"][0] == np.sum(np.array(own) >= 0.3)
    assert frame["minus_before"].isna().tolist() == [True, False] * 4 and set(frame["minus_best"].dropna()) == {0.0}
    assert 0.5 < frame["sure"][0] < 1


def test_tuning_ends_in_a_verdict_on_fresh_maps(compare, tmp_path):
    options = [
        "--planner",
        "sma-nbo",
        "--vary",
        "planner.horizon=3,1",
        "--seeds",
        "0-3",
        "--metric",
        "ospa.mean_m",
        *FLAGS,
    ]
    code, out, _ = compare(*options, executor=Serial(INVENTED))
    text = " ".join(out.split())
    assert code == 0 and "sma-nbo: planner.horizon = 3 was the best of 2 on seeds 0-1 (OSPA mean " in text
    assert "on seeds 2-3, which had no part in the choice, it has " in text
    assert "planner.horizon = 3 and planner.horizon = 1 cannot be told apart, being equal on every map" in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--at-least", "share_held"], "--at-least: 'share_held' is not of the form metric=value"),
        (["--at-least", "share_held=90%"], "--at-least: 'share_held=90%' is not of the form metric=value"),
        (["--at-least", "share_held=90"], "--at-least: share_held=90 is not allowed; expected 0 to 1"),
        (["--at-least", "share_hold=0.9"], "did you mean share_held"),
        (["--at-least", "gospa.mean_m=2"], "--at-least: of gospa.mean_m, lower is better; use --at-most"),
        (["--at-most", "share_held=0.5"], "--at-most: of share_held, higher is better; use --at-least"),
        (["--at-most", "gospa.mean_m=2", "--at-least", "share_held=0.9"], "--at-most: not allowed together with"),
        (["--vary", "fleet.size"], "--vary: 'fleet.size' is not of the form"),
        (["--vary", "fleet.size=1", "--set", "fleet.size=2"], "--set: fleet.size is what --vary fleet.size varies"),
    ],
)
def test_a_wrong_flag_of_levels_is_refused_in_one_line(compare, options, message):
    code, out, err = compare(*options)
    assert (code, out) == (2, "") and message in err and err.count("\n") == 1
