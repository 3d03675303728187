"""Tables and figure of docs/results/mismatch.md: `python docs/mismatch.py`.

The trials of the study `mismatch` in runs/mismatch, or in the folders that are named, are written to
docs/results/mismatch.csv, from which all is made; those that were there before and not in the folders stay.
"""

from __future__ import annotations

import csv
import sys
import textwrap
from collections.abc import Iterable, Sequence
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

TRIALS = Path(__file__).parent / "results" / "mismatch.csv"
PICTURE = Path(__file__).parent / "media" / "mismatch.png"
STUDY = read_study("mismatch")
(LEVELS,) = map(list, STUDY.factors.values())
METRIC = find_shown_metric("ospa.share_under_1m")
TRUTH = {level: "leaves, exact" if "leaves" in level else "exact" for level in LEVELS}
BLIND = ("thompson", "greedy", "hover", "oracle")  # planners that do not ask where trees hide people
KNOWN = ", and known to be"
COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#222222", "#999999", "#8c564b", "#7f3c8d")


def write_trials(rows: Iterable[TrialRow]) -> None:
    """Write the metric of each trial, a line a level and seed, a column a planner."""
    lines = {(line["believed"], int(line["seed"])): line for line in read_trials()}
    for row in rows:
        value = row.metrics.get(METRIC.name)
        if row.status == "done" and value is not None:
            key = dict(row.factors)["believed"], row.seed
            line = lines.get(key, {})
            line = line if line.get("version") == row.version else {}  # a line is of one release
            own = {"believed": key[0], "seed": str(row.seed), "version": row.version}
            lines[key] = line | own | {row.planner: f"{value:.10g}"}
    order = sorted(lines, key=lambda key: (LEVELS.index(key[0]), key[1]))
    flown = [planner for planner in STUDY.planners if any(planner in line for line in lines.values())]
    with TRIALS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["believed", "seed", "version", *flown], restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines[key] for key in order)


def read_trials() -> list[dict[str, str]]:
    """The lines of `TRIALS`."""
    if not TRIALS.exists():
        return []
    with TRIALS.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def list_values(lines: Iterable[dict[str, str]]) -> dict[tuple[str, str], dict[int, float]]:
    """The metric by level and planner, for each seed."""
    found: dict[tuple[str, str], dict[int, float]] = {}
    for line in lines:
        for planner in STUDY.planners:
            if line.get(planner):
                found.setdefault((line["believed"], planner), {})[int(line["seed"])] = float(line[planner])
    return found


def list_planners(values: dict[tuple[str, str], dict[int, float]]) -> list[str]:
    """The planners that were flown, in the order of the study."""
    flown = {planner for _, planner in values}
    return [planner for planner in STUDY.planners if planner in flown]


def estimate_gap(values: dict[tuple[str, str], dict[int, float]], one: str, other: str) -> Estimate | None:
    """How much more a level has than another, as a mean over planners that plan by the trees, paired by maps."""
    planners = [planner for planner in list_planners(values) if planner not in BLIND]
    cells = [values.get((level, planner), {}) for level in (one, other) for planner in planners]
    both = sorted(set.intersection(*(set(cell) for cell in cells))) if cells else []
    gaps = [[np.mean([values[one, p][seed] - values[other, p][seed] for p in planners])] for seed in both]
    return estimate_means(np.array(gaps), [METRIC.most - METRIC.least])[0] if both else None


def compute_ranks(values: dict[tuple[str, str], dict[int, float]], level: str) -> Array | None:
    """Rank of each planner at a level by its mean, 1 for the best; None unless all were flown."""
    cells = [values.get((level, planner), {}) for planner in list_planners(values)]
    if not cells or not all(cells):
        return None
    return np.asarray(rankdata([-np.mean(list(cell.values())) for cell in cells]), dtype=float)


def write_table(values: dict[tuple[str, str], dict[int, float]]) -> str:
    """A line a level: what it costs beside believing the truth, and the mean share of each planner [%].

    The last column is Kendall's tau of the ranking of planners with that under the truth.
    """
    planners = list_planners(values)
    lines = [["believed", "costs", *(f"`{planner}`" for planner in planners), "tau"], ["---"] * (len(planners) + 3)]
    for level in (level for level in LEVELS if any((level, planner) in values for planner in planners)):
        ranks, exact = compute_ranks(values, level), compute_ranks(values, TRUTH[level])
        known = level != TRUTH[level] and ranks is not None and exact is not None and len(planners) > 1
        loss = estimate_gap(values, TRUTH[level], level) if level != TRUTH[level] else None
        means = [list(values.get((level, planner), {}).values()) for planner in planners]
        shares = [METRIC.text(float(np.mean(cell))) if cell else "" for cell in means]
        tau = f"{kendalltau(ranks, exact).statistic:.2f}" if known else ""
        lines.append([level, loss.text(METRIC, signed=True) if loss else "", *shares, tau])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def write_gains(values: dict[tuple[str, str], dict[int, float]]) -> str:
    """What it is worth to know how far off the map may be: a line a pair of levels."""
    lines = [["error", "knowing it gives back"], ["---"] * 2]
    for level in (level for level in LEVELS if level.endswith(KNOWN)):
        plain = level.removesuffix(KNOWN)
        plain = plain if plain in LEVELS else f"trees off by {plain}"
        gain = estimate_gap(values, level, plain)
        lines += [[plain, gain.text(METRIC, signed=True)]] if gain else []
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


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
    shares.set_ylabel(textwrap.fill(METRIC.title, 16))
    ranks.set(ylabel="rank among planners", xticks=range(len(levels)))
    ranks.set_xticklabels(levels, rotation=60, ha="right")
    for axes in (shares, ranks):
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=5, frameon=False)
    return figure


def main(folders: Sequence[str]) -> None:
    """Print the tables and draw the figure."""
    if folders:
        write_trials(row for folder in folders for row in read_rows(folder))
    values = list_values(read_trials())
    print(write_table(values))
    print()
    print(write_gains(values))
    draw(values).savefig(PICTURE, dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main(sys.argv[1:] or [folder for folder in ("runs/mismatch",) if Path(folder).is_dir()])
