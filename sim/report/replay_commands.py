"""The commands that fly single trials of a study again, and which trials are worth it."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from sim.analysis.cells import Group
from sim.evaluation.metric import Metric
from sim.scenario.random_streams import numbered
from sim.study.row import Row


@dataclass(frozen=True, eq=False)
class Extreme:
    """The best and the worst map of a group in one metric."""

    group: Group
    best: Row
    worst: Row


def command(row: Row) -> str:
    """The command line that flies a trial again, for a POSIX shell."""
    words = ["understory", "run", row.scenario, "--planner", row.planner, "--seed", str(row.seed)]
    if row.repeat:
        words += ["--repeat", str(row.repeat)]
    for key, value in row.settings.items():
        words += ["--set", f"{key}={value}"]
    return shlex.join(words)


def anchor(row: Row, number: int) -> str:
    """A name for a trial's place on a page; `number` makes it the only one."""
    flown = re.sub(r"[^a-z0-9]+", "-", f"{row.planner} {numbered(row.seed, row.repeat)}".lower()).strip("-")
    return f"map-{number}-{flown}"


def extremes(groups: Sequence[Group], metric: Metric) -> list[Extreme]:
    """Of each group with a finite value: its best and worst map; where neither way is better, least and greatest."""
    found = []
    for group in groups:
        rows = [row for row in group.done if math.isfinite(row.metrics.get(metric.name, math.nan))]
        if rows:
            ordered = sorted(rows, key=lambda row: (row.metrics[metric.name], row.seed, row.repeat))
            ends = (ordered[-1], ordered[0]) if metric.better == "higher" else (ordered[0], ordered[-1])
            found.append(Extreme(group, *ends))
    return found
