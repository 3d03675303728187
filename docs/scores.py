"""Tables and figure of the page of worlds, from a list of the trials behind them, docs/results/worlds.csv.

`python docs/scores.py DIR...` adds the trials of studies of bench-1 to the list and draws the figure;
`python docs/generate.py` then writes the tables into the page.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from sim.facts.metrics.metric import Metric
from sim.mission.atomic_files import write_whole
from sim.study.analysis.answers import Answer, Difference, differences, holm, map_means, pair_differences
from sim.study.analysis.groups import Group, Run, group_rows
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.analysis.normalised_score import Scored, score_planners
from sim.study.cells import VIEW, Levels, list_cells
from sim.study.definition import read_study
from sim.study.report.figures.pictures import draw_score_picture
from sim.study.store import read_rows
from sim.study.trials import TrialRow
from tracking.numerics.arrays import Array

DOCS = Path(__file__).parent
TRIALS, FIGURE = DOCS / "results" / "worlds.csv", DOCS / "media" / "scores.png"
STUDY = read_study("bench-1")
DEFAULT, *RIVALS = (
    "sma-nbo-gospa",
    "sma-nbo-mwtp",
    "sma-nbo",
    "pma-nbo",
    "mcr(samples=10)",
    "mcr(samples=10, search=0.1)",
    "mcr(samples=4, beta=0.5, evaluations=9216)",
    "dec-pomdp",
    "centralized",
    "greedy-mi",
    "dec-mcts",
    "rsp",
    "thompson",
    "greedy",
    "lawnmower",
    "random",
)
ORDER = (DEFAULT, *RIVALS, "oracle-found", "oracle")
FLOORS = ("lawnmower", "random")  # which the tables leave out, to be short
_DIGITS = 10  # of a metric: the same trial gives all of them again
METRICS = ("gospa.mean_m", "ospa.share_under_1m", "share_held", "time_to_find_s")


def trials(path: Path | None = None) -> list[TrialRow]:
    """The trials that a file lists, by default that of the page; none if there is no file."""
    path = path or TRIALS
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [_row(line) for line in csv.DictReader(file)]


def _row(line: dict[str, str]) -> TrialRow:
    factors = (("scenario", line["world"]), *([(VIEW, line[VIEW])] if line[VIEW] else []))
    metrics = {name: float(line[name] or "nan") for name in METRICS}
    place = {"scenario": line["world"], "factors": factors, "planner": line["planner"], "seed": int(line["seed"])}
    return TrialRow(**place, version=line["version"], status="done", metrics=metrics)


def add(folders: Iterable[Path], path: Path | None = None) -> None:
    """Add the trials of studies to a list, which has each once, in the order of worlds, planners and seeds.

    The last that was flown counts; flights with other settings than the study's are in other worlds, and left out.
    """
    settings = {(cell.scenario, _view(cell.factors)): cell.settings for cell in list_cells(STUDY)}
    flown = [row for folder in folders for row in read_rows(folder) if row.study == STUDY.name]
    flown = [row for row in flown if row.settings == settings.get((row.scenario, _view(row.factors)))]
    done = [*trials(path), *(row for row in flown if row.status == "done" and row.repeat == 0)]
    found = {(row.scenario, row.planner, _view(row.factors), row.seed): row for row in done}
    listed = sorted(found.items(), key=lambda entry: (STUDY.scenarios.index(entry[0][0]), *entry[0][1:]))
    with write_whole(path or TRIALS) as scratch, scratch.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["world", "planner", VIEW, "seed", "version", *METRICS])
        for place, row in listed:
            values = (row.metrics[name] for name in METRICS)
            texts = ("" if math.isnan(value) else f"{value:.{_DIGITS}g}" for value in values)
            writer.writerow([*place, row.version, *texts])


def _view(factors: Levels) -> str:
    return dict(factors).get(VIEW, "")


def gaps_table(name: str, world: str = "", base: str = DEFAULT) -> str:
    """A metric of a planner, and what others have beyond it, paired by map; the last line is their mean over worlds.

    Bold differences survive Holm's correction for all planners; of those in italics only the interval excludes zero.
    In a table of several worlds only the mean shows its interval.
    The table of the metric that the study scores begins with the means of floor and bound.
    """
    metric, groups = find_shown_metric(name), _groups(world)
    planners = [name for name in ORDER if name != base and any(group.planner == name for group in groups)]
    ends = dict(zip(_scored(groups).ends, ("`hover`", "bound"), strict=True)) if name == STUDY.score.metric else {}
    heads, means = ["planner"], {**{end: [text] for end, text in ends.items()}, base: [f"`{base}`"]}
    gaps: list[list[Difference]] = [[] for _ in planners]
    worlds: list[list[dict[Run, Array]]] = [[] for _ in planners]
    for cell, own in _by_world(groups):
        heads.append(_name(cell))
        for planner, line in means.items():
            line.append(f"{metric.text(map_means(own[planner], metric).value)} {metric.unit}")
        for k, planner in enumerate(planners):
            worlds[k].append(pair_differences(own[planner], own[base], [metric]))
            gaps[k] += differences(worlds[k][-1], [metric])
    if not world:
        heads, means = [*heads, "mean of these"], {planner: [*line, ""] for planner, line in means.items()}
        for k, pairs in enumerate(worlds):
            gaps[k] += differences({run: np.mean([gap[run] for gap in pairs], axis=0) for run in pairs[0]}, [metric])
    survives = iter(holm([gap.p_value for line in gaps for gap in line]))
    texts = [
        [_marked(gap, metric, next(survives), interval=bool(world) or gap is line[-1]) for gap in line] for line in gaps
    ]
    lines = [[f"`{name}`", *line] for name, line in zip(planners, texts, strict=True) if name not in FLOORS]
    return format_table(heads, [*means.values(), *lines])


def format_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in (heads, ["---"] * len(heads), *rows))


def _marked(gap: Difference, metric: Metric, survives: bool, *, interval: bool) -> str:
    text = gap.mean.text(metric, signed=True) if interval else metric.text(gap.mean.value, signed=True)
    if survives:
        return f"**{text}**"
    return f"_{text}_" if gap.mean.low * gap.mean.high > 0 else text


def _groups(world: str = "") -> list[Group]:
    """The trials in one world, or in all, by world and planner, whatever version flew them."""
    rows = [replace(row, version="") for row in trials() if world in ("", row.scenario)]
    return group_rows(rows, DEFAULT)


def _scored(groups: Sequence[Group]) -> Scored:
    found = score_planners([row for group in groups for row in group.done], groups, STUDY.score)
    if found is None:
        raise ValueError(f"{TRIALS} lists no map of both floor and bound")
    return found


def _by_world(groups: Sequence[Group]) -> Iterator[tuple[Levels, dict[str, Group]]]:
    """The groups of each world by planner, in the order of the study."""
    for world in STUDY.scenarios:
        own = {group.planner: group for group in groups if dict(group.cell)["scenario"] == world}
        if own:
            yield next(iter(own.values())).cell, own


def _name(cell: Levels) -> str:
    return f"`{dict(cell)['scenario']}`"


def draw() -> None:
    """The figure of scores in all worlds, in the order of the tables."""

    def place(score: Answer) -> tuple[int, int]:
        world = len(STUDY.scenarios) if score.cell is None else STUDY.scenarios.index(dict(score.cell)["scenario"])
        return world, ORDER.index(score.planner)

    scores, _, ends = _scored(_groups())
    found = sorted((score for score in scores if score.planner in ORDER), key=place)
    with write_whole(FIGURE) as scratch:
        scratch.write_bytes(draw_score_picture(found, ends).png)


if __name__ == "__main__":
    add(map(Path, sys.argv[1:]))
    draw()
