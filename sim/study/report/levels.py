"""Tables and sentences on the levels of a study's factors, and on those chosen on some maps and judged on others."""

import math
from collections.abc import Sequence
from itertools import groupby
from typing import Any

from sim.facts.metrics.metric import UNKNOWN, Metric
from sim.study.analysis.answers import Difference
from sim.study.analysis.labels import SYMBOLS, append_cell, cell_text
from sim.study.analysis.levels import Choice, LevelAnswer, Measured, Threshold
from sim.study.report.sentences import count_samples, format_ranges, write_verdict
from sim.study.report.tables import Table, TableRow, list_ends

_MOST_SENTENCES = 8  # on differences from the best level; more are left to the tables


def make_level_tables(found: Sequence[LevelAnswer], metric: Metric, threshold: Threshold | None) -> list[Table]:
    """A table for each factor, with a section for each combination of the other factors' levels."""
    several = len({answer.planner for answer in found}) > 1
    listed = []
    for factor, answers in groupby(found, lambda answer: answer.factor):
        name = SYMBOLS.get(factor, factor)
        heads = [name, "maps", "mean", "minus the\nlevel before", "minus\nthe best"]
        heads += [f"maps with\n{threshold.text(metric)}", "mean so,\nsure by"] if threshold else []
        rows = []
        for answer in answers:
            texts = [f"{answer.planner}, {answer.level}" if several else answer.level, str(answer.found.maps)]
            texts.append(answer.found.mean.text(metric))
            texts += [_format_gap(answer.step, metric, ""), _format_gap(answer.gap, metric, "best")]
            texts += [str(answer.found.met), _format_share(answer.found.sure)] if threshold else []
            rows.append(TableRow(answer.others, texts))
        listed.append(Table(f"{metric.title} over {name}", heads, rows, metric))
    return listed


def _format_gap(gap: Difference | None, metric: Metric, missing: str) -> str:
    if gap is None:
        return missing if metric.better != "neither" or not missing else UNKNOWN
    return ("* " if gap.survives else "") + gap.mean.text(metric, signed=True)


def _format_share(share: float) -> str:
    """A share in %; of a confidence, never 100 %."""
    if math.isnan(share):
        return UNKNOWN
    return "> 99.9 %" if share > 0.999 else "< 0.1 %" if share < 0.001 else f"{100 * share:.1f} %"


def list_level_fields(found: Sequence[LevelAnswer], metric: Metric) -> list[dict[str, Any]]:
    """The answers as rows of a data frame, with values in SI units."""
    return [
        {
            "planner": answer.planner,
            "metric": metric.name,
            **{f"factor.{name}": level for name, level in (*answer.others, (answer.factor, answer.level))},
            "factor": answer.factor,
            "level": answer.level,
            "maps": answer.found.maps,
            **list_ends("mean", answer.found.mean),
            **_list_gap("before", answer.step),
            **_list_gap("best", answer.gap),
            "met": answer.found.met,
            "sure": answer.found.sure,
        }
        for answer in found
    ]


def _list_gap(other: str, gap: Difference | None) -> dict[str, Any]:
    name = f"minus_{other}"
    ends = list_ends(name, gap.mean) if gap else dict.fromkeys((name, f"{name}_low", f"{name}_high"), math.nan)
    return {**ends, f"{name}_p": gap.p_value if gap else math.nan, f"{name}_holm": bool(gap and gap.survives)}


def write_level_sentences(
    found: Sequence[LevelAnswer], choices: Sequence[Choice], metric: Metric, threshold: Threshold | None
) -> list[str]:
    """What is chosen and how it does on other maps; then, if they are few, the differences from the best levels."""
    lines = [_write_choice(choice, metric, threshold) for choice in choices]
    if choices and threshold:
        lines.append("Cheapest is what comes first in the order of the levels, of the first factor before the next.")
    gaps = [(answer, answer.gap) for answer in found if answer.gap]
    if len(gaps) > _MOST_SENTENCES:
        return [*lines, f"{len(gaps)} differences from the best levels are in the tables of levels."]
    for answer, gap in gaps:
        line = [other for other in found if other[:3] == answer[:3]]
        best = next(other.level for other in line if other.gap is None)
        one, other = (_name_level(answer, level) for level in (answer.level, best))
        shown = _count_tests([other for other in found if other.factor == answer.factor])
        lines.append(write_verdict(one, other, metric, gap, shown=shown))
    return lines


def _count_tests(found: Sequence[LevelAnswer]) -> int:
    """Number of pairs of levels of a factor that are compared; that of a level with the best one before it counts once.

    The best level and the one before it are among the differences from the best.
    """
    gaps = [answer.gap for answer in found if answer.gap and answer.gap.pairs]
    others = [a for a in found if a.gap and a.step and a.step is not a.gap and a.step.pairs]
    return len(gaps) + len(others)


def _name_level(answer: LevelAnswer, level: str) -> str:
    return append_cell(answer.planner, (*answer.others, (answer.factor, level)))


def _write_choice(choice: Choice, metric: Metric, threshold: Threshold | None) -> str:
    who = append_cell(choice.planner, choice.others)
    chosen_on, judged_on = (f"seeds {format_ranges(seeds)}" for seeds in (choice.chosen_on, choice.judged_on))
    aim = f"a mean of {threshold.text(metric)}" if threshold else ""
    if choice.levels is None:
        return f"{who}: none of {choice.options} combinations has {aim} ({metric.label}) on {chosen_on}."
    what = f"the cheapest of {choice.options} with {aim}" if threshold else f"the best of {choice.options}"
    means = [_write_mean(found, metric) for found in (choice.before, choice.after)]
    text = f"{who}: {cell_text(choice.levels)} was {what} on {chosen_on} ({metric.label} {means[0]}); "
    text += f"on {judged_on}, which had no part in the choice, it has {means[1]}."
    if threshold:
        after = choice.after
        sure = "too few maps, or too many ties, to tell how sure this is"
        if not math.isnan(after.sure):
            sure = f"its mean is {threshold.text(metric)} with a confidence of {_format_share(after.sure)}"
        return f"{text} There {sure}; {after.met} of {count_samples(after.maps)} meet{'s' * (after.met == 1)} it."
    if choice.rival is None or choice.gap is None:
        return text
    return f"{text} {write_verdict(cell_text(choice.levels), cell_text(choice.rival), metric, choice.gap)}".strip()


def _write_mean(found: Measured, metric: Metric) -> str:
    mean = found.mean
    low, high = (metric.text(value) for value in (mean.low, mean.high))
    return metric.with_unit(mean.value) + ("" if math.isnan(mean.low) else f" [{low}, {high}]")
