"""Effect of lost messages on a fleet: a table and a figure, as docs/explanation/network.md shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Annotated

import matplotlib
import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sim.drawing.palette import BLUE, VERMILLION
from sim.drawing.plots import save
from sim.scenario.loading import load
from sim.scenario.quantities import integers
from sim.study.engine import rows_of
from sim.study.pool import Pool
from sim.study.row import Row
from sim.study.tasks import check_worlds, task_of
from sim.terminal.commands import run_alone
from sim.terminal.progress import trial_progress
from tracking.fusion.rule import FUSION_RULES

LOSSES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
FUSIONS = tuple(FUSION_RULES)
_COLOURS = dict(zip(FUSIONS, (BLUE, VERMILLION), strict=True))

Curves = dict[str, list[list[Row]]]  # of each fusion: rows of all seeds at each loss


def curves(fusions: Sequence[str], seeds: Sequence[int], workers: int, overrides: Sequence[str] = ()) -> Curves:
    """Missions of the default scenario in ideal sensing, at all losses, on the same forests, people and seeds."""
    cases = list(product(fusions, LOSSES, seeds))
    tasks = [
        task_of(load("forest", ["sensing.mode=ideal", *overrides, *_network(fusion, loss)]), "sma-nbo-mwtp", seed)
        for fusion, loss, seed in cases
    ]
    check_worlds(tasks)
    with trial_progress(len(tasks)) as progress, Pool(workers) as pool:
        rows = iter(rows_of(tasks, pool, progress))
    return {fusion: [[next(rows) for _ in seeds] for _ in LOSSES] for fusion in fusions}


def _network(fusion: str, loss: float) -> list[str]:
    return [f"network.fusion={fusion}", f"network.loss={loss}"]


def table(found: Curves) -> str:
    """Means over the seeds, and their standard errors, in Markdown."""
    lines = ["| loss | fusion | OSPA under 1 m | OSPA mean | disagreement |", "|---|---|---|---|---|"]
    for (i, loss), fusion in product(enumerate(LOSSES), found):
        share, error, gap = (
            _summary(found[fusion][i], name) for name in ("ospa.share_under_1m", "ospa.mean_m", "disagreement_m")
        )
        lines.append(
            f"| {loss:.0%} | `{fusion}` | {100 * share[0]:.1f} ± {100 * share[1]:.1f} % "
            f"| {error[0]:.2f} ± {error[1]:.2f} m | {gap[0]:.4f} ± {gap[1]:.4f} m |"
        )
    return "\n".join(lines)


def figure(found: Curves) -> Figure:
    """OSPA and disagreement over the loss, with standard errors."""
    with matplotlib.rc_context({"font.family": "DejaVu Sans", "font.size": 10}):
        drawn = Figure(figsize=(7.2, 2.9), layout="constrained")
        FigureCanvasAgg(drawn)
        left, right = drawn.subplots(1, 2)
        _plot(left, found, "ospa.share_under_1m", 100.0)
        _plot(right, found, "disagreement_m", 1.0)
        left.set_ylabel("scans with OSPA under 1 m [%]")
        left.set_ylim(0, 100)
        right.set_ylabel("disagreement of UAVs [m]")
        right.set_yscale("log")
        right.set_ylim(1e-4, 20)  # without losses it is zero
        left.legend(loc="lower left", frameon=False)
    return drawn


def _plot(axes: Axes, found: Curves, name: str, scale: float) -> None:
    for fusion, levels in found.items():
        mean, error = scale * np.array([_summary(rows, name) for rows in levels]).T
        colour = [channel / 255 for channel in _COLOURS[fusion]]
        axes.errorbar(100 * np.array(LOSSES), mean, error, color=colour, lw=1.5, capsize=2, label=fusion)
    axes.set_xlabel("messages lost [%]")
    axes.set_xlim(-2, 102)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(lw=0.5, alpha=0.4)


def _summary(rows: Sequence[Row], name: str) -> tuple[float, float]:
    """Mean and its standard error over the seeds."""
    values = np.array([row.metrics[name] for row in rows])
    return float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values))) if len(values) > 1 else 0.0


def main(
    out: Annotated[Path, typer.Argument(metavar="PNG", help="Where the figure goes.")] = Path("network.png"),
    fusion: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="kla or hcmci; repeat for both. Default: both.")
    ] = None,
    seeds: Annotated[str, typer.Option(metavar="LIST", help="0-7 or 0,3,7.")] = "0-7",
    workers: Annotated[int, typer.Option(metavar="N", min=1, help="Processes to fly in.")] = 1,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="As for a run.")] = None,
) -> None:
    """Fly the default scenario at losses of 0 to 100 %; print a table and draw a figure."""
    found = curves(fusion or FUSIONS, integers(seeds, "--seeds"), workers, overrides or ())
    print(table(found))
    save(figure(found), out)


if __name__ == "__main__":
    run_alone(main)
