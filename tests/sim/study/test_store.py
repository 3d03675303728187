"""The store holds each complete trial once, and says in one line why it cannot."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from helpers.studies import Serial, invented, plain, short, sql, store

from sim.study.scheduler import Options, complete
from sim.study.store import NAME, SCHEMA, Store, StoreError, read_rows, tabulate_rows
from tracking.errors import InputError

FACTORS = {"lambda": {"5": {"trees": {"density": 5}}, "3": {"trees": {"density": 3}}}}


@pytest.fixture
def filled(tmp_path):
    """A folder with the rows of some trials, the trials, and the rows."""
    tasks = short(["hover", "greedy"], "0-2", factors=FACTORS)
    return tmp_path, tasks, store(tmp_path, tasks)


def test_rows_come_back_as_they_were(filled):
    folder, tasks, rows = filled
    with Store.open(folder, "short") as opened:
        found = opened.read_finished_rows(tasks)
        assert opened.count_others([]) == {tasks[0].version: len(tasks)}
    assert [plain(found[task.key]) for task in tasks] == list(map(plain, rows))
    assert sorted(map(str, map(plain, read_rows(folder)))) == sorted(map(str, map(plain, rows)))
    assert found[tasks[0].key].metrics["wall_s"] == rows[0].metrics["wall_s"]


def test_seeds_of_any_size_are_read_as_they_were_in_order(tmp_path):
    seeds = [9, 10, 2**63 - 1, 2**63, 2**63 + 1, 2**64 - 1, 10**20, 2**80]
    store(tmp_path, short(["hover"], ",".join(map(str, reversed(seeds)))))
    assert [row.seed for row in read_rows(tmp_path)] == tabulate_rows(read_rows(tmp_path))["seed"].tolist() == seeds


def test_trials_are_what_their_keys_say_and_added_again_replace_the_first(filled):
    folder, tasks, rows = filled
    sql(folder, "UPDATE trials SET seed = 3, planner = 'other'")
    with Store.open(folder, "short") as opened:
        found = opened.read_finished_rows(tasks)
        assert [plain(found[task.key]) for task in tasks] == list(map(plain, rows))
        opened.add(tasks[0], msgspec.structs.replace(rows[0], metrics={"ospa.mean_m": -1.0}))
        assert opened.read_finished_rows(tasks)[tasks[0].key].metrics == {"ospa.mean_m": -1.0}
    assert len(read_rows(folder)) == len(tasks)


def test_plain_sql_reads_it_and_one_call_makes_a_frame(filled):
    folder, _, rows = filled
    joined = "trials t JOIN metrics m USING (key) JOIN factors f USING (key)"
    place = "m.name = 'ospa.mean_m' AND f.name = 'lambda' AND f.level = '3'"
    means = dict(sql(folder, f"SELECT t.planner, avg(m.value) FROM {joined} WHERE {place} GROUP BY t.planner"))
    expected = [r.metrics["ospa.mean_m"] for r in rows if r.factors == (("lambda", "3"),) and r.planner == "hover"]
    assert means["hover"] == pytest.approx(np.mean(expected)) and set(means) == {"hover", "greedy"}
    assert sql(folder, "SELECT DISTINCT value FROM metrics WHERE name = 'detection.precision'") == [(None,)]
    table = tabulate_rows(read_rows(folder))
    for path in (str(folder), folder / NAME, str(folder / NAME)):
        assert tabulate_rows(read_rows(path)).equals(table)
    assert len(table) == len(rows) and {"planner", "seed", "factor.lambda", "ospa.mean_m"} <= set(table.columns)
    mean = table[table["planner"] == "greedy"].groupby("factor.lambda")["detection.recall"].mean()["5"]
    expected = [r.metrics["detection.recall"] for r in rows if (r.planner, r.factors) == ("greedy", (("lambda", "5"),))]
    assert len(expected) == 3 and mean == pytest.approx(np.mean(expected)) and table["detection.precision"].isna().all()


def test_versions_of_one_trial_are_read_in_the_order_in_which_they_were_written(tmp_path):
    (task,) = short(["hover"], seeds="0")
    for version in ("0.1.0+b", "0.1.0+c", "0.1.0+a"):
        store(tmp_path, [msgspec.structs.replace(task, version=version, key=version)])
    assert [row.version for row in read_rows(tmp_path)] == ["0.1.0+b", "0.1.0+c", "0.1.0+a"]


def test_levels_may_be_renamed(filled):
    folder, *_ = filled
    renamed = short(["hover", "greedy"], "0-2", factors={"density": {"few": {"trees": {"density": 3}}}})
    with Store.open(folder, "short") as opened:
        executor = Serial()
        rows = complete(renamed, opened, executor)
    assert executor.flown == [] and {row.factors for row in rows} == {(("density", "few"),)}
    shown = [row.factors for row in read_rows(folder)]
    assert shown.count((("density", "few"),)) == 6 and shown.count((("lambda", "5"),)) == 6


def test_a_full_disk_loses_nothing_and_the_study_goes_on_once_there_is_room(tmp_path):
    tasks = short(["hover"], "0-39")
    with Store.open(tmp_path, "short") as opened:
        (pages,) = opened._connection.execute("PRAGMA page_count").fetchone()
        opened._connection.execute(f"PRAGMA max_page_count = {pages + 2}")
        with pytest.raises(StoreError, match=r"study\.sqlite: database or disk is full"):
            complete(tasks, opened, Serial({"hover": [None] * 40}))
    kept = len(read_rows(tmp_path))
    assert 0 < kept < 40
    with Store.open(tmp_path, "short") as opened:
        executor = Serial({"hover": [None] * 40})
        rows = complete(tasks, opened, executor)
    assert len(executor.flown) == 40 - kept
    assert list(map(plain, rows)) == [plain(invented(task)) for task in tasks]
    assert sql(tmp_path, "PRAGMA integrity_check") == [("ok",)]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: path.write_text("no database, however long\n" * 200), "cannot be used: file is not a database"),
        (lambda path: sql(path.parent, f"PRAGMA user_version = {SCHEMA + 1}"), f"version {SCHEMA + 1}, but this"),
        (lambda path: sql(path.parent, "CREATE TABLE mine (x)"), "is a database, but no store of a study"),
        (Path.mkdir, "cannot be used: is not a file"),
    ],
    ids=["text", "newer", "other", "folder"],
)
def test_a_store_that_is_none_is_refused_and_left_alone(tmp_path, make, message):
    path = tmp_path / NAME
    make(path)
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(InputError, match=message) as raised, Store.open(tmp_path, "short"):
        pass
    assert "\n" not in str(raised.value) and str(path) in str(raised.value)
    assert before is None or path.read_bytes() == before


def test_a_damaged_store_is_one_line(filled):
    folder, tasks, _ = filled
    with open(folder / NAME, "r+b") as file:
        file.seek(4096)
        file.write(b"damaged " * 4096)
    malformed = "cannot be used: database disk image is malformed"
    with pytest.raises(InputError, match=malformed):
        read_rows(folder)
    with pytest.raises(InputError, match=malformed), Store.open(folder, "short") as opened:
        opened.read_finished_rows(tasks)


def test_folders_of_another_study_or_that_cannot_be_written_are_refused(filled, tmp_path):
    folder, tasks, _ = filled
    with pytest.raises(InputError, match="holds study 'short', not 'long'"), Store.open(folder, "long"):
        pass
    assert len(read_rows(folder)) == len(tasks)
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file" / "study", "/proc/study", "/proc/full"):
        with pytest.raises(InputError, match=r"--out: .* cannot be used"), Store.open(tmp_path / folder, "short"):
            pass


def test_failed_trials_are_flown_again_and_done_ones_only_on_demand(tmp_path):
    tasks = short(["hover", "greedy"])
    with Store.open(tmp_path, "short") as opened:
        first = complete(tasks, opened, Serial({"greedy": ["x", "x", "x", "x"]}))
        assert [row.status for row in first] == ["done", "failed"] * 2
        again = Serial({"hover": [None] * 9})
        assert [row.status for row in complete(tasks, opened, again)] == ["done"] * 4
        assert again.flown == [("greedy", 0), ("greedy", 1)]
        redone = Serial({"hover": [None] * 9})
        complete(tasks, opened, redone, Options(redo=True))
        assert len(redone.flown) == 4
    assert len(read_rows(tmp_path)) == 4


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("DELETE FROM study", "it names no study"),
        ("DROP TABLE trials", "no such table: trials"),
        ("UPDATE trials SET metrics = '[]'", "a trial in it: Expected `object`, got `array`"),
        ("UPDATE trials SET ospa = x'ffffff'", "a trial in it: buffer size must be a multiple"),
        ("UPDATE trials SET scans_per_s = 0", "a trial in it: scans_per_s is 0"),
    ],
)
def test_a_store_of_which_something_was_changed_is_one_line(filled, statement, message):
    folder, tasks, _ = filled
    sql(folder, statement)
    with pytest.raises(InputError, match=message) as raised:
        read_rows(folder)
    assert "\n" not in str(raised.value) and str(folder) in str(raised.value)
    with pytest.raises(InputError, match=message), Store.open(folder, "short") as opened:
        opened.read_finished_rows(tasks)
