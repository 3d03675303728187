"""The answers of a study as tables of text, for the terminal and other formats."""

import math
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

from sim.analysis.answers import Answer, map_means
from sim.analysis.cell_text import Cell, cell_text, with_cell
from sim.analysis.coverage import caveats
from sim.analysis.differences import Difference
from sim.analysis.groups import Group
from sim.analysis.intervals import LEVEL, MOST_MAPS, POWER
from sim.analysis.normalised_score import SCORE, Scored
from sim.evaluation.metric import UNKNOWN, Metric

SCORES = "Normalised score of each planner [%]"  # title of the table
_NOTE = (
    "In brackets: 95 % intervals over the maps (seeds). On a new set of as many maps, expect the mean within 1.4 times "
    "this interval."
)
_MAPS = "Maps: the number with a value, of all flown. Mean and median are over those with a value."
_COMPARED = "Differences, and won, tied, lost, are over the maps on which both planners have a value."
_NEEDED = f"Maps needed: so many maps show a difference of this size with a probability of {100 * POWER:.0f} %."
_REPEATED = "Each map counts once, with the mean of its repeats. Spreads are standard deviations."


class Line(NamedTuple):
    """A line of a table."""

    cell: Cell | None  # empty if the study has no cells; None means all cells
    texts: list[str]


class Table(NamedTuple):
    """A table of the report."""

    title: str
    heads: list[str]
    lines: list[Line]
    metric: Metric | None = None  # set if this is the metric's main table
    note: str = ""


def tables(found: Sequence[Answer], baseline: str) -> list[Table]:
    """The tables of each metric: results and, if maps were repeated, spreads."""
    listed = []
    for metric, group in groupby(found, lambda answer: answer.metric):
        own = list(group)
        compared = any(answer.difference for answer in own)
        heads = ["planner", "maps", "mean", "median"]
        heads += [f"minus {baseline}", "won, tied, lost", "maps needed"] if compared else []
        listed.append(Table(metric.title, heads, [Line(a.cell, _texts(a, compared)) for a in own], metric))
        if _has_repeats(own):
            heads = ["planner", "between maps", "within maps"]
            heads += [f"minus {baseline}: between", "within", "maps needed"] if compared else []
            lines = [Line(a.cell, _spread_texts(a, compared)) for a in own]
            listed.append(Table(f"{metric.title}: spread", heads, lines))
    return listed


def score_table(scored: Scored, groups: Sequence[Group]) -> Table:
    """Table with a line per cell: the metric of floor and bound, and the score of each planner with its interval."""
    found, metric, ends = scored
    planners = list(dict.fromkeys(score.planner for score in found))
    by_key = {(group.cell, group.planner): group for group in groups}
    lines = []
    for cell, of_cell in groupby(found, lambda score: score.cell):
        texts = {score.planner: score.estimate.text(SCORE) for score in of_cell}
        if cell is None:
            start = ["mean over cells", "", ""]
        else:
            means = [map_means(by_key[cell, end], metric).value for end in ends]
            start = [cell_text(cell) or "all missions", *map(metric.text, means)]
        lines.append(Line((), [*start, *(texts.get(planner, UNKNOWN) for planner in planners)]))
    note = (
        f"{metric.label}: 0 is that of {ends.floor}, 100 that of {ends.bound}, on the maps that all three flew. "
        "In brackets: 95 % intervals over the maps; how often these hold was not counted."
    )
    heads = ["cell", *(f"{end} [{metric.unit}]" for end in ends), *planners]
    return Table(SCORES, heads, lines, note=note)


def _has_repeats(found: Sequence[Answer]) -> bool:
    return any(answer.trials + answer.failed > answer.flown for answer in found)


def notes(found: Sequence[Answer], *, wide: bool = True) -> list[str]:
    """Notes below the tables of these answers, one line each; without `wide`, tables lack the column of maps needed."""
    sampled = [(answer.metric, answer.maps) for answer in found]
    gaps = [(answer.metric, answer.difference.pairs) for answer in found if answer.difference]
    compared = [(metric, pairs) for metric, pairs in gaps if pairs]
    lines = [_NOTE, *caveats(sampled + compared)]
    if any(answer.maps < answer.flown for answer in found):
        lines.append(_MAPS)
    if compared:
        lines.append(_COMPARED)
    if compared and wide:
        lines.append(_NEEDED)
    if len(compared) > 1:
        lines.append(_correction_note([pairs for _, pairs in compared]))
    if _has_repeats(found):
        lines.append(_REPEATED)
    return lines


def _correction_note(pairs: Sequence[int]) -> str:
    """Note on the star, or on its absence if there are too few maps: no p-value of n maps is below 2 / 2ⁿ."""
    chance, shown = 1.0 - LEVEL, f"Holm's correction for all {len(pairs)} differences shown"
    needed = math.ceil(math.log2(2 * len(pairs) / chance))
    if max(pairs) < needed:
        return f"No difference can survive {shown} ({100 * chance:.0f} %) on fewer than {needed} maps."
    return f"* survives {shown} ({100 * chance:.0f} %)."


def shortfalls(found: Sequence[Answer]) -> list[str]:
    """Remarks on incomplete numbers, one line each: failed trials, undefined values, faults and maps without a pair."""
    lines: dict[str, None] = {}
    for answer in found:
        place = with_cell(answer.planner, answer.cell)
        if answer.failed:
            lines[f"{place}: {answer.failed} of {answer.trials + answer.failed} trials failed and do not count"] = None
        if answer.faulty:
            lines[f"{place}: faults in {answer.faulty} of {answer.trials} trials; `understory run` shows them"] = None
        if answer.undefined:
            what = f"{answer.metric.label} is undefined in {answer.undefined} of {answer.trials} trials"
            lines[f"{place}: {what}"] = None
        gaps = answer.difference
        if gaps and gaps.unpaired:
            where = " in every cell" if answer.cell is None else ""
            counted = f"{gaps.pairs} of {gaps.pairs + gaps.unpaired} maps"
            lines[f"{place}: {counted} have a value of this planner and of the baseline{where}"] = None
    return list(lines)


def _texts(answer: Answer, compared: bool) -> list[str]:
    metric = answer.metric
    maps = str(answer.maps) if answer.maps == answer.flown else f"{answer.maps}/{answer.flown}"
    own = [maps, answer.mean.text(metric), answer.median.text(metric)]
    if answer.cell is None:
        own = [f"{answer.difference.cells} cells" if answer.difference else "", "", ""]
    return [answer.planner, *own, *(_difference_texts(metric, answer.difference) if compared else [])]


def _difference_texts(metric: Metric, difference: Difference | None) -> list[str]:
    if difference is None:
        return ["baseline", "", ""]
    mark = "* " if difference.survives else ""
    record = UNKNOWN  # if neither direction is better, or there are no pairs
    if metric.better != "neither" and difference.pairs:
        record = f"{difference.won}, {difference.tied}, {difference.lost}"
    return [mark + difference.mean.text(metric, signed=True), record, _maps_needed_text(difference)]


def _maps_needed_text(difference: Difference) -> str:
    if math.isinf(difference.needed):
        return f"> {MOST_MAPS}" if difference.mean.value else UNKNOWN
    return UNKNOWN if math.isnan(difference.needed) else str(round(difference.needed))


def _spread_texts(answer: Answer, compared: bool) -> list[str]:
    metric, gap = answer.metric, answer.difference
    texts = [answer.planner, *(["", ""] if answer.cell is None else answer.spread.texts(metric))]
    if compared:
        texts += ["baseline", "", ""] if gap is None else [*gap.spread.texts(metric), _maps_needed_text(gap)]
    return texts
