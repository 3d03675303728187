"""Costs of studies, savings by a second process, answers of 10 000 trials: `-n 0 -s --benchmark-enable`, machine idle.

In ordinary test runs each part runs once, on little, and its times are not judged.
"""

import math
import sqlite3
import time

import msgspec
import numpy as np
import pytest
from helpers.studies import Serial, invented, short
from helpers.trials import row

from sim.study.analysis.answers import find_answers
from sim.study.analysis.groups import group_rows
from sim.study.analysis.metric_choice import choose_metrics, list_available
from sim.study.definition import Study
from sim.study.executors import Pool
from sim.study.report.figures.charts import compute_ecdf
from sim.study.scheduler import complete
from sim.study.store import Store, read_rows, tabulate_rows
from sim.study.trials import list_trials

METRICS = ("ospa.mean_m", "ospa.median_m", "ospa.share_under_1m", *(f"other_{i}" for i in range(13)))
BOUND = 2.0  # s, for every metric of 10 000 trials


def test_ten_thousand_trials_list_and_aggregate_in_two_seconds(tmp_path, judged):
    count = 10_000 if judged else 100
    found = short(["hover"], f"0-{count - 1}")
    full = dict.fromkeys((f"metric.{i}" for i in range(45)), 0.123456789)
    row = msgspec.structs.replace(invented(found[0]), ospa=np.ones(201, dtype=np.float32), times=np.arange(201) / 5)
    with Store.open(tmp_path, "short") as store:
        store._connection.execute("PRAGMA synchronous = OFF")  # what is measured is reading
        for task in found:
            store.add(task, msgspec.structs.replace(row, seed=task.seed, metrics={**full, "ospa.mean_m": task.seed}))
    start = time.perf_counter()
    with Store.open(tmp_path, "short") as store:
        rows = complete(found, store, Serial())
    listed = time.perf_counter() - start
    start = time.perf_counter()
    table = tabulate_rows(read_rows(tmp_path))
    assert table["ospa.mean_m"].mean() == (count - 1) / 2
    framed = time.perf_counter() - start
    start = time.perf_counter()
    sql = sqlite3.connect(tmp_path / "study.sqlite")
    (mean,) = sql.execute("SELECT avg(value) FROM metrics WHERE name = 'ospa.mean_m'").fetchone()
    sql.close()
    asked = time.perf_counter() - start
    assert len(rows) == count and math.isclose(mean, (count - 1) / 2)
    print(f"\n{count} trials: list {listed:.2f} s, frame and mean {framed:.2f} s, mean by SQL {asked:.2f} s")
    assert not judged or max(listed, framed, asked) < 2.0


def test_two_processes_are_nearly_twice_as_fast_as_one_and_cost_little(tmp_path, judged):
    """Rendered trials of 20 s, once the processes have started; overhead is what of one's time is no mission."""
    if not judged:
        pytest.skip("takes minutes, and an idle machine")
    found = list_trials(Study(name="short", planners=("sma-nbo-mwtp",), settings={"duration": "20"}, seeds="0-15"))
    walls, overheads = {1: [], 2: []}, []
    for turn, workers in enumerate((1, 2, 1, 2)):
        with Pool(workers) as pool, Store.open(tmp_path / str(turn), "short") as store:
            complete(short(["hover"], "100-103"), store, pool)  # which starts the processes
            start = time.perf_counter()
            rows = complete(found, store, pool)
            walls[workers].append(time.perf_counter() - start)
        if workers == 1:
            overheads.append(1 - sum(row.metrics["wall_s"] for row in rows) / walls[1][-1])
    one, two = min(walls[1]), min(walls[2])
    print(f"\n16 trials: one process {one:.1f} s, two {two:.1f} s, {one / two:.2f} x; overhead {min(overheads):.2%}")
    assert one / two >= 1.85 and min(overheads) < 0.03


@pytest.fixture(scope="module")
def rows(judged):
    """50 cells, 4 planners, 50 seeds; 16 metrics."""
    rng = np.random.default_rng(0)
    cells, seeds = (50, 50) if judged else (2, 5)
    ospa, times = rng.gamma(2.0, 0.2, 201).astype(np.float32), np.arange(201) / 5
    return [
        row(
            planner,
            seed,
            (("cell", str(cell)),),
            dict(zip(METRICS, rng.random(16), strict=True)),
            ospa=ospa,
            times=times,
        )
        for cell in range(cells)
        for planner in ("sma-nbo", "sma-nbo-mwtp", "greedy", "hover")
        for seed in range(seeds)
    ]


def test_answers(benchmark, judged, rows):
    def work():
        return find_answers(group_rows(rows, "sma-nbo"), choose_metrics(rows, list_available(rows)), "sma-nbo")

    found = benchmark.pedantic(work, rounds=3)
    assert len(found) == 16 * (len(rows) // (50 if judged else 5) + 3)
    if judged:
        assert benchmark.stats.stats.median < BOUND


def test_distributions(benchmark, judged, rows):
    def work():
        return [compute_ecdf(group.pool_ospa(), np.geomspace(0.1, 50, 300)) for group in group_rows(rows)]

    shares = benchmark.pedantic(work, rounds=3)
    assert all(curve[-1] == 1.0 for curve in shares)
    if judged:
        assert benchmark.stats.stats.median < BOUND
