"""Sentences about the answers of a study: verdicts on planners, and notes and shortfalls below the tables."""

import math
from collections.abc import Sequence
from itertools import groupby

from sim.facts.metrics.metric import Metric
from sim.study.analysis.answers import Answer, Difference
from sim.study.analysis.intervals import LEAST_MAPS, LEVEL, POWER
from sim.study.analysis.labels import append_cell
from sim.study.report.tables import WIDE

ENOUGH = 8  # number of maps from which on intervals of shares of scans hold as often as they claim


def count_samples(count: int, sample: str = "map") -> str:
    """A number of samples in words; sample: what they are, as of `Answer`."""
    return f"{count} {sample}{'s' * (count != 1)}"


def format_ranges(numbers: Sequence[int]) -> str:
    """Ascending integers as text, such as 0-4, 7."""
    runs = [[number for _, number in run] for _, run in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0])]
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def write_verdict(
    planner: str, baseline: str, metric: Metric, gap: Difference, *, shown: int = 1, sample: str = "map"
) -> str:
    """One sentence: a planner is better or worse than the baseline, or these maps show no difference or are too few.

    planner and baseline: their labels. shown: number of differences that the page shows, including this one. sample: as
    of `Answer`.
    """
    if not gap.pairs:
        return f"{planner} and {baseline} cannot be told apart: they have no {sample} in common."
    unit = " points" if metric.unit == "%" else f" {metric.unit}".rstrip()
    mean, low, high = (metric.text(v, signed=True) for v in (gap.mean.value, gap.mean.low, gap.mean.high))
    over = f", mean over {gap.cells} cells" if gap.cells > 1 else ""
    within = over if math.isnan(gap.mean.low) else f" (95 %: {low} to {high}{over})"
    counted = f"; of {count_samples(gap.pairs, sample)} it won {gap.won}, tied {gap.tied} and lost {gap.lost}"
    ending = counted if metric.better != "neither" else ""
    apart = f"{planner} {_name_direction(metric, gap)} {baseline}"
    if gap.significant:
        start = apart
    elif gap.tied == gap.pairs:
        start = f"{planner} and {baseline} cannot be told apart, being equal on every {sample}"
    elif gap.pairs < LEAST_MAPS:
        are = "is" if gap.pairs == 1 else "are"
        start = f"{count_samples(gap.pairs, sample)} {are} too few to tell {planner} and {baseline} apart"
    elif gap.pairs - gap.tied < LEAST_MAPS:
        start = f"{planner} and {baseline} are equal on too many {sample}s to tell them apart"
    else:
        start = f"{planner} and {baseline} cannot be told apart"
    return f"{start}: {metric.label} {mean}{unit}{within}{ending}. {_write_remark(gap, shown, sample)}".strip()


def _write_remark(gap: Difference, shown: int, sample: str) -> str:
    if gap.significant:
        lone = gap.survives or shown == 1
        return "" if lone else f"This does not survive Holm's correction for all {shown} differences."
    few = f"At least {count_samples(LEAST_MAPS, sample)} are needed. " if gap.pairs < LEAST_MAPS else ""
    if not gap.pairs < gap.needed < math.inf:
        return few
    return f"{few}To find a difference of this size takes about {count_samples(round(gap.needed), sample)}."


def _name_direction(metric: Metric, gap: Difference) -> str:
    above = gap.mean.value > 0
    if metric.better == "neither":
        return "is above" if above else "is below"
    return "is better than" if above == (metric.better == "higher") else "is worse than"


def write_notes(found: Sequence[Answer], *, width: float = math.inf) -> list[str]:
    """Notes below the tables of these answers, one line each; width: as for `make_answer_tables`."""
    compared = [answer.difference.pairs for answer in found if answer.difference and answer.difference.pairs]
    counted = [answer.maps for answer in found if answer.maps > 1]
    lines = [
        "In brackets: 95 % intervals over the maps (seeds). On a new set of as many maps, expect the mean within 1.4 "
        "times this interval.",
    ]
    if any(answer.metric.unit == "m" for answer in found) or min([*counted, *compared], default=ENOUGH) < ENOUGH:
        few = f"Intervals over fewer than {ENOUGH} maps, and those of mean errors in metres, are right less often"
        lines.append(f"{few} than in 95 % of cases (docs/how-to/reports.md).")
    sample = next((answer.sample for answer in found if answer.sample != "map"), "map")
    if sample != "map":
        lines.append(
            f"{sample.capitalize()}s, not maps: seeds share trees and people, as from files. Intervals are over their "
            "noise and say nothing of other worlds."
        )
    if any(pairs < LEAST_MAPS for pairs in compared):
        lines.append(f"Fewer than {LEAST_MAPS} are too few to tell planners apart, wherever the interval ends.")
    if any(_lacks_interval(answer) for answer in found):
        lines.append(
            f"No brackets where fewer than {LEAST_MAPS} maps differ from the most common value: too many ties to tell "
            "what rare maps add."
        )
    if any(answer.maps < answer.flown for answer in found):
        lines.append("Maps: the number with a value, of all flown. Mean and median are over those with a value.")
    if compared:
        lines.append("Differences, and won, tied, lost, are over the maps on which both planners have a value.")
    if compared and width >= WIDE:
        chance = f"{100 * POWER:.0f} %"
        lines.append(f"Maps needed: so many maps show a difference of this size with a probability of {chance}.")
    if len(compared) > 1:
        lines.append(_write_correction_note(compared))
    if any(answer.trials + answer.failed > answer.flown for answer in found):
        lines.append(f"Each {sample} counts once, with the mean of its repeats.")
    return lines


def _lacks_interval(answer: Answer) -> bool:
    """True if the mean of several maps, or of several differences, has no interval."""
    gap = answer.difference
    of_gap = gap is not None and gap.pairs > 1 and math.isnan(gap.mean.low)
    return of_gap or (answer.maps > 1 and math.isnan(answer.mean.low))


def _write_correction_note(pairs: Sequence[int]) -> str:
    """Note on the star, or on its absence if there are too few maps: no p-value of n maps is below 2 / 2ⁿ."""
    chance = 1.0 - LEVEL
    shown = f"Holm's correction for all {len(pairs)} differences shown"
    needed = math.ceil(math.log2(2 * len(pairs) / chance))
    if max(pairs) < needed:
        return f"No difference can survive {shown} ({100 * chance:.0f} %) on fewer than {needed} maps."
    return f"* survives {shown} ({100 * chance:.0f} %)."


def list_shortfalls(found: Sequence[Answer]) -> list[str]:
    """Remarks on incomplete numbers, one line each: failed trials, undefined values, faults and maps without a pair."""
    lines: dict[str, None] = {}
    for answer in found:
        place = append_cell(answer.planner, answer.cell)
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
            counted = f"{gaps.pairs} of {gaps.pairs + gaps.unpaired} {answer.sample}s"
            lines[f"{place}: {counted} have a value of this planner and of the baseline{where}"] = None
    return list(lines)
