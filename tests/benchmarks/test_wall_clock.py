"""Wall clock of `understory run` beside that of its flight; docs/results/benchmarks.md says how to run this.

In ordinary test runs one short mission is flown, and nothing is judged.
"""

import json
import time

from helpers.processes import python

from sim.processes.cores import count_cores

FLIGHT = ("physics", "rendering", "detection", "tracking", "planning")


def test_run_with_film_and_page_beside_its_flight(judged, tmp_path):
    """From the start of the process to its end, with all files, on two cores; the least of several runs counts."""
    ratios = []
    for k in range(3 if judged else 1):
        begun = time.perf_counter()
        ended = python("-m", "sim", "run", "--duration", "40" if judged else "1", "--out", tmp_path / f"{k}")
        wall = time.perf_counter() - begun
        assert ended.returncode == 0, ended.stderr
        summary = json.loads((tmp_path / f"{k}" / "summary.json").read_text())
        seconds = summary["seconds"]
        flight = sum(seconds[stage] for stage in FLIGHT)
        ratios.append((wall / flight, seconds["other"] / summary["wall_s"]))
        print(f"\nrun {wall:.1f} s, flight {flight:.1f} s, {wall / flight:.2f} times, bound 1.6; not counted: "
              f"{100 * ratios[-1][1]:.1f} %, bound 3; exit {wall - summary['wall_s']:.2f} s")  # fmt: skip
    assert not judged or count_cores() == 1 or min(ratio for ratio, _ in ratios) <= 1.6
    assert not judged or min(other for _, other in ratios) <= 0.03
