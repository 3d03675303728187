"""Times of the answers of 10 000 trials; docs/results/benchmarks.md says how to run this.

In ordinary test runs each part runs once, on few trials, and its times are not judged.
"""

import numpy as np
import pytest
from helpers.trials import row

from sim.analysis.answers import answers
from sim.analysis.cells import grouped
from sim.analysis.distributions import ecdf
from sim.analysis.metric_choice import available, chosen

pytestmark = pytest.mark.benchmark(group="10 000 trials")
METRICS = ("ospa.mean_m", "ospa.median_m", "ospa.share_under_1m", *(f"other_{i}" for i in range(13)))
BOUND = 2.0  # s, for every metric of 10 000 trials


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
        return answers(grouped(rows, "sma-nbo"), chosen(rows, available(rows)), "sma-nbo")

    found = benchmark.pedantic(work, rounds=3)
    assert len(found) == 16 * (len(rows) // (50 if judged else 5) + 3)
    if judged:
        assert benchmark.stats.stats.median < BOUND


def test_distributions(benchmark, judged, rows):
    def work():
        return [ecdf(group.ospa, np.geomspace(0.1, 50, 300)) for group in grouped(rows)]

    shares = benchmark.pedantic(work, rounds=3)
    assert all(curve[-1] == 1.0 for curve in shares)
    if judged:
        assert benchmark.stats.stats.median < BOUND
