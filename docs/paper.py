"""Tables and figures of docs/results/paper.md, from studies in runs/: `python docs/paper.py` prints the tables.

The page says how the studies are flown. The figures are those of [Li22]: distributions of OSPA over all scans from the
tenth on, of SMA-NBO over its horizon, and of its rivals.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sim.study.analysis.intervals import Estimate, estimate_means
from sim.study.definition import read_study
from sim.study.report.figures.charts import compute_ecdf
from sim.study.store import read_rows
from sim.study.trials import TrialRow
from tracking.numerics.arrays import Array

MEDIA = Path(__file__).parent / "media"
STUDY = read_study("paper-original")
DENSITIES, HORIZONS = (list(levels) for levels in STUDY.factors.values())
PLANNERS = {"sma-nbo": "SMA-NBO", "sma-nbo-mwtp": "with MWTP", "mcr": "MCR", "dec-pomdp": "Dec-POMDP"}
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#8c564b")
AT = np.geomspace(0.1, 50.0, 300)  # m, values of OSPA at which distributions are drawn
FIRST = 10  # scan from which on the paper counts
SECONDS = {  # [Li22] Table I, s: run time of a trial
    "sma-nbo": (616, 1401, 2094, 600, 1386, 2028, 574, 1307, 1914),
    "sma-nbo-mwtp": (643, 1457, 2033, 628, 1393, 2023, 604, 1319, 1924),
    "mcr": (1517, 3309, 5160, 1639, 3673, 5883, 1662, 3822, 6291),
    "dec-pomdp": (0, 2192, 2641, 0, 0, 0, 0, 1789, 2551),
}

Cells = dict[tuple[str, str, str], dict[int, TrialRow]]  # density, horizon and planner; by seed


def list_cells(rows: Iterable[TrialRow]) -> Cells:
    """Rows by density, horizon, planner and seed."""
    found: Cells = {}
    for row in (row for row in rows if row.status == "done"):
        levels = dict(row.factors)
        found.setdefault((levels["lambda"], levels["H"], row.planner.partition("(")[0]), {})[row.seed] = row
    return found


def late(row: TrialRow) -> float:
    """Share of the scans from the tenth on whose OSPA, as a mean over the UAVs, is under 1 m."""
    return float(np.mean(row.ospa[FIRST:] < 1.0))


def compare(cells: Cells, density: str, horizon: str, planner: str) -> Estimate:
    """Mean share of late scans under 1 m; for rivals of SMA-NBO the paired difference to it."""
    own, base = cells[density, horizon, planner], cells[density, horizon, "sma-nbo"]
    if planner == "sma-nbo":
        return estimate_means(np.array([[late(row)] for row in own.values()]), [1.0])[0]
    both = sorted(own.keys() & base.keys())
    return estimate_means(np.array([[late(own[seed]) - late(base[seed])] for seed in both]), [1.0])[0]


def write_shares(cells: Cells) -> str:
    """A line a density and horizon, a column a planner [%]."""
    lines = [["λ", "H", *PLANNERS.values()], ["---"] * (2 + len(PLANNERS))]
    for density in DENSITIES:
        for horizon in HORIZONS:
            flown = [planner for planner in PLANNERS if (density, horizon, planner) in cells]
            found = {planner: compare(cells, density, horizon, planner) for planner in flown}
            texts = {planner: write(one, signed=planner != "sma-nbo") for planner, one in found.items()}
            lines.append([density, horizon, *(texts.get(planner, "") for planner in PLANNERS)])
    return write_table(lines)


def write(found: Estimate, signed: bool) -> str:
    """An estimate of a share in %, with its interval, which too few maps or too many ties do not tell."""
    sign = "+" if signed else ""
    if np.isnan(found.low):
        return f"{100 * found.value:{sign}.1f}"
    low, high = (f"{100 * end:{sign}.1f}" for end in (found.low, found.high))
    return f"{100 * found.value:{sign}.1f} [{low}, {high}]"


def write_seconds(cells: Cells) -> str:
    """Processor time of the decisions of a trial [s], and its ratio to SMA-NBO, here and in the paper's Table I."""
    lines = [["λ", "H", *PLANNERS.values()], ["---"] * (2 + len(PLANNERS))]
    places = [(density, horizon) for density in DENSITIES for horizon in HORIZONS]
    for k, (density, horizon) in enumerate(places):
        line = [density, horizon]
        base = compute_seconds(cells, density, horizon, "sma-nbo")
        for planner in PLANNERS:
            own = compute_seconds(cells, density, horizon, planner)
            theirs = SECONDS[planner][k] / SECONDS["sma-nbo"][k]
            ratios = "" if planner == "sma-nbo" else f": {own / base:.1f} (paper {theirs:.1f})"
            line.append(f"{own:.2f}{ratios}" if own else "")
        lines.append(line)
    return write_table(lines)


def compute_seconds(cells: Cells, density: str, horizon: str, planner: str) -> float:
    """Mean processor time of the decisions of a trial [s], over maps that all planners flew; 0 if none was flown."""
    flown = {name: cells[density, horizon, name] for name in PLANNERS if (density, horizon, name) in cells}
    if planner not in flown:
        return 0.0
    rows = [flown[planner][seed] for seed in sorted(set.intersection(*map(set, flown.values())))]
    return float(np.mean([len(row.times) // 5 * row.metrics["planning_cpu_s_per_decision"] for row in rows]))


def write_overall(cells: Cells) -> str:
    """Mean difference of each rival to SMA-NBO over its cells, paired by maps [points]."""
    texts = []
    for planner in list(PLANNERS)[1:]:
        places = [place for place in cells if place[2] == planner]
        pairs = [(cells[place], cells[place[0], place[1], "sma-nbo"]) for place in places]
        seeds = set.intersection(*(own.keys() & base.keys() for own, base in pairs))
        gaps = [[np.mean([late(own[seed]) - late(base[seed]) for own, base in pairs])] for seed in sorted(seeds)]
        texts.append(f"{PLANNERS[planner]} {write(estimate_means(np.array(gaps), [1.0])[0], signed=True)}")
    return ", ".join(texts)


def write_assumptions(rows: Iterable[TrialRow]) -> str:
    """Share of late scans under 1 m [%] with each assumption switched, and the paired difference to none."""
    levels: dict[str, dict[int, float]] = {}
    for row in rows:
        levels.setdefault(dict(row.factors)["assumption"], {})[row.seed] = late(row)
    (names,) = map(list, read_study("paper-assumptions").factors.values())
    base = levels[names[0]]
    lines = [["assumption", "share", "difference"], ["---"] * 3]
    for name in names:
        both = sorted(levels[name].keys() & base.keys())
        gap = estimate_means(np.array([[levels[name][seed] - base[seed]] for seed in both]), [1.0])[0]
        mean = f"{100 * np.mean(list(levels[name].values())):.1f}"
        lines.append([name, mean, "" if name == names[0] else write(gap, signed=True)])
    return write_table(lines)


def write_table(lines: Sequence[Sequence[str]]) -> str:
    """Lines of a table in Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def pool(cells: Cells, density: str, horizon: str, planner: str) -> Array:
    """OSPA [m] of all late scans of all maps."""
    return np.concatenate([row.ospa[FIRST:] for row in cells[density, horizon, planner].values()])


def draw_horizons(by_radius: dict[str, Cells]) -> Figure:
    """Figure 4 of [Li22]: distributions of OSPA of SMA-NBO, a row a radius, a column a density, a line a horizon."""
    figure, axes = open_grid(len(by_radius), [f"λ = {density}" for density in DENSITIES], list(by_radius))
    for panels, cells in zip(axes, by_radius.values(), strict=True):
        for panel, density in zip(panels, DENSITIES, strict=True):
            for horizon, colour in zip(HORIZONS, COLOURS, strict=False):
                values = pool(cells, density, horizon, "sma-nbo")
                panel.plot(AT, 100 * compute_ecdf(values, AT), color=colour, label=f"H = {horizon}")
    return close(figure, axes)


def draw_rivals(cells: Cells) -> Figure:
    """Figure 5 of [Li22]: distributions of OSPA, a row a density, a column a horizon, a line a planner."""
    columns, names = [f"H = {horizon}" for horizon in HORIZONS], [f"λ = {density}" for density in DENSITIES]
    figure, axes = open_grid(len(names), columns, names)
    for panels, density in zip(axes, DENSITIES, strict=True):
        for panel, horizon in zip(panels, HORIZONS, strict=True):
            for (planner, name), colour in zip(PLANNERS.items(), COLOURS, strict=True):
                if (density, horizon, planner) in cells:
                    values = pool(cells, density, horizon, planner)
                    panel.plot(AT, 100 * compute_ecdf(values, AT), color=colour, label=name)
    return close(figure, axes)


def open_grid(rows: int, columns: Sequence[str], names: Sequence[str]) -> tuple[Figure, Array]:
    """A grid of panels with titles over its columns and names beside its rows."""
    figure = Figure(figsize=(9.0, 0.6 + 2.3 * rows), layout="constrained")
    axes = figure.subplots(rows, len(columns), sharex=True, sharey=True, squeeze=False)
    for panel, title in zip(axes[0], columns, strict=True):
        panel.set_title(title)
    for panels, name in zip(axes, names, strict=True):
        panels[0].set_ylabel(f"{name}\nscans with OSPA ≤ x [%]")
    return figure, axes


def close(figure: Figure, axes: Array) -> Figure:
    """Dress the panels, and add the legend."""
    for panel in axes.flat:
        panel.set(xscale="log", xlim=(AT[0], AT[-1]), ylim=(0, 102), xticks=[0.1, 1, 10])
        panel.set_xticks([0.1, 1, 10], ["0.1", "1", "10"])
        panel.axvline(1.0, color="0.7", lw=1.0, ls="--", zorder=0.5)
        panel.spines[["top", "right"]].set_visible(False)
    for panel in axes[-1]:
        panel.set_xlabel("x [m]")
    known = dict(zip(*reversed(axes.flat[-1].get_legend_handles_labels()), strict=True))
    figure.legend(known.values(), known.keys(), loc="outside upper center", ncols=4, frameon=False)
    return figure


def main(large: str = "runs/paper-r5", small: str = "runs/paper-r1", switched: str = "runs/paper-assumptions") -> None:
    """Print the tables and draw the figures of those folders that there are: R = 5 m, R = 1 m and assumptions."""
    by_radius = {
        name: list_cells(read_rows(folder))
        for name, folder in (("R = 1 m", small), ("R = 5 m", large))
        if Path(folder).is_dir()
    }
    for name, cells in by_radius.items():
        maps = {planner: min(len(cells[place]) for place in cells if place[2] == planner) for planner in PLANNERS}
        print(f"{name}, maps {maps}\n\n{write_shares(cells)}\n\n{write_overall(cells)}\n\n{write_seconds(cells)}\n")
    if by_radius:
        draw_horizons(by_radius).savefig(MEDIA / "paper-horizons.png", dpi=100, metadata={"Software": None})
    if "R = 5 m" in by_radius:
        draw_rivals(by_radius["R = 5 m"]).savefig(MEDIA / "paper-rivals.png", dpi=100, metadata={"Software": None})
    if Path(switched).is_dir():
        print(write_assumptions(read_rows(switched)))


if __name__ == "__main__":
    main(*sys.argv[1:])
