"""Tables and figure of docs/results/mismatch.md, from the study `mismatch` in runs/mismatch: `python docs/mismatch.py`.

If the study was flown in parts, `python docs/mismatch.py FOLDER...` takes all of them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import kendalltau, rankdata

from sim.study.analysis.intervals import Estimate, estimate_means
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.definition import read_study
from sim.study.store import read_rows
from sim.study.trials import TrialRow
from tracking.numerics.arrays import Array

PICTURE = Path(__file__).parent / "media" / "mismatch.png"
STUDY = read_study("mismatch")
(LEVELS,) = map(list, STUDY.factors.values())
METRIC = find_shown_metric("ospa.share_under_1m")
TRUTH = {level: "leaves, exact" if "leaves" in level else "exact" for level in LEVELS}
COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#222222", "#999999", "#8c564b", "#7f3c8d")


def list_values(rows: Sequence[TrialRow]) -> dict[tuple[str, str], dict[int, float]]:
    """The metric by level and planner, for each seed."""
    found: dict[tuple[str, str], dict[int, float]] = {}
    for row in rows:
        value = row.metrics.get(METRIC.name)
        if row.status == "done" and value is not None:
            found.setdefault((dict(row.factors)["believed"], row.planner), {})[row.seed] = value
    return found


def list_planners(values: dict[tuple[str, str], dict[int, float]]) -> list[str]:
    """The planners that were flown, in the order of the study."""
    flown = {planner for _, planner in values}
    return [planner for planner in STUDY.planners if planner in flown]


def estimate_loss(values: dict[tuple[str, str], dict[int, float]], level: str, planner: str) -> Estimate | None:
    """What a level costs a planner beside believing the truth, paired by maps; None without maps of both."""
    one, other = values.get((TRUTH[level], planner), {}), values.get((level, planner), {})
    both = sorted(one.keys() & other.keys())
    gaps = np.array([[one[seed] - other[seed]] for seed in both])
    return estimate_means(gaps, [METRIC.most - METRIC.least])[0] if both else None


def compute_ranks(values: dict[tuple[str, str], dict[int, float]], level: str) -> Array | None:
    """Rank of each planner at a level by its mean, 1 for the best; None unless all were flown."""
    cells = [values.get((level, planner), {}) for planner in list_planners(values)]
    if not cells or not all(cells):
        return None
    return np.asarray(rankdata([-np.mean(list(cell.values())) for cell in cells]), dtype=float)


def write_table(values: dict[tuple[str, str], dict[int, float]]) -> str:
    """A line a level, a column a planner: mean share of scans under 1 m [%], in brackets what the level costs.

    The last column is Kendall's tau of the ranking of planners with that under the truth.
    """
    planners = list_planners(values)
    lines = [["believed", *(f"`{planner}`" for planner in planners), "tau"], ["---"] * (len(planners) + 2)]
    for level in (level for level in LEVELS if any((level, planner) in values for planner in planners)):
        cells = [_write_cell(values, level, planner) for planner in planners]
        ranks, exact = compute_ranks(values, level), compute_ranks(values, TRUTH[level])
        known = level != TRUTH[level] and ranks is not None and exact is not None and len(planners) > 1
        lines.append([level, *cells, f"{kendalltau(ranks, exact).statistic:.2f}" if known else ""])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _write_cell(values: dict[tuple[str, str], dict[int, float]], level: str, planner: str) -> str:
    maps = values.get((level, planner))
    if not maps:
        return ""
    mean = METRIC.text(float(np.mean(list(maps.values()))))
    loss = estimate_loss(values, level, planner)
    return mean if level == TRUTH[level] or loss is None else f"{mean} ({loss.text(METRIC, signed=True)})"


def draw(values: dict[tuple[str, str], dict[int, float]]) -> Figure:
    """Share of scans under 1 m and rank, a line a planner, over all levels."""
    levels = [level for level in LEVELS if compute_ranks(values, level) is not None]
    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    shares, ranks = figure.subplots(2, 1, sharex=True)
    for k, planner in enumerate(list_planners(values)):
        cells = [list(values[level, planner].values()) for level in levels]
        shares.plot([METRIC.scale * np.mean(cell) for cell in cells], "o-", color=COLOURS[k], ms=4, label=planner)
        places = [found[k] for level in levels if (found := compute_ranks(values, level)) is not None]
        ranks.plot(places, "o-", color=COLOURS[k], ms=4)
    ranks.invert_yaxis()
    shares.set_ylabel(METRIC.title)
    ranks.set(ylabel="rank among planners", xticks=range(len(levels)))
    ranks.set_xticklabels(levels, rotation=60, ha="right")
    for axes in (shares, ranks):
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=5, frameon=False)
    return figure


def main(folders: Sequence[str]) -> None:
    """Print the table and draw the figure."""
    values = list_values([row for folder in folders for row in read_rows(folder)])
    print(write_table(values))
    draw(values).savefig(PICTURE, dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main(sys.argv[1:] or ["runs/mismatch"])
