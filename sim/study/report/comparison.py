"""What a study compares, and the result: groups, answers and scores, which tables, figures and the report show."""

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.metric import Metric
from sim.study.analysis.answers import Answer, find_answers
from sim.study.analysis.groups import Group, drop_constant_factors, find_varying_factors, group_rows
from sim.study.analysis.labels import find_baseline, format_entrant, is_entrant_built_in, parse_labels
from sim.study.analysis.levels import Choice, LevelAnswer, Threshold, find_choices, find_levels
from sim.study.analysis.metric_choice import choose_metrics, find_shown_metric
from sim.study.analysis.normalised_score import Scored, find_score_ends, score_planners
from sim.study.cells import list_choices
from sim.study.definition import ScoreScale, Study
from sim.study.trials import StudyTrial, TrialRow
from tracking.errors import check_known


@dataclass(frozen=True)
class About:
    """Facts about a study that its rows do not contain."""

    study: str  # name
    description: str = ""
    command: str = ""  # command line that runs the study again
    versions: Mapping[str, str] = field(default_factory=dict)
    machine: str = field(  # machine that made the report; trials may have flown on others
        default_factory=lambda: f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}"
    )
    wall_s: float | None = None  # sum over all trials, even if they flew at the same time
    baseline: str | None = None  # a planner of the rows, by default the first
    order: tuple[str, ...] = ()  # entrants of the comparison, as they are shown; others follow by name
    labels: Mapping[str, str] = field(default_factory=dict)  # labels of planners, as from `parse_labels`
    metrics: tuple[str, ...] = ()  # names of metrics, by default the usual ones
    score: ScoreScale | None = None  # the study's score
    levels: Mapping[str, Sequence[str]] = field(default_factory=dict)  # of factors, as they are shown
    choices: tuple[str, ...] = ()  # factors of which a user chooses the level
    threshold: Threshold | None = None  # that a choice is to meet; its metric comes first


def make_about(
    study: Study,
    trials: Sequence[StudyTrial],
    *,
    baseline: str | None,
    labels: Sequence[str],
    metrics: Sequence[str],
    threshold: Threshold | None = None,
) -> About:
    """Facts about a study that is to be flown; InputError if they name what its trials will not have.

    Own planners and trackers come first, then all in the order in which they are given.
    baseline: label, text or name of a planner or tracker; None means the first. labels: as "label=planner".
    """
    given = parse_labels(trials, labels)
    find_baseline(trials, baseline, given)
    if study.score:
        find_score_ends(trials, study.score, given)
        check_known(study.at("score.metric"), study.score.metric, [*METRICS, *metrics])
    return About(
        study.name,
        study.description,
        baseline=baseline,
        order=tuple(sorted(dict.fromkeys(map(format_entrant, trials)), key=is_entrant_built_in)),
        labels=given,
        metrics=tuple(metrics),
        score=study.score,
        levels={factor: tuple(levels) for factor, levels in study.factors.items()},
        choices=tuple(list_choices(study)),
        threshold=threshold,
    )


@dataclass(frozen=True, eq=False)
class Comparison:
    """The rows of a study, compared."""

    baseline: str  # its label
    every: list[Group]  # with all factors
    groups: list[Group]  # in the same order, without the factors that have the same value in all of them
    metrics: list[Metric]
    answers: list[Answer]
    levels: list[LevelAnswer]  # by the first metric
    choices: list[Choice]
    scored: Scored | None  # None if the study has no score, or no map has both floor and bound


def compare_rows(rows: Sequence[TrialRow], about: About) -> Comparison:
    """Compare rows; InputError if a metric or the baseline is unknown, or there are no rows."""
    baseline = find_baseline(rows, about.baseline, about.labels)
    every = group_rows(rows, baseline, about.labels, about.order, about.levels)
    groups = drop_constant_factors(every)
    metrics = choose_metrics(rows, about.metrics)
    threshold = about.threshold
    if threshold:
        first = find_shown_metric(threshold.metric)
        metrics = [first, *(metric for metric in metrics if metric.name != first.name)]
    answers = find_answers(groups, metrics, baseline)
    scored = score_planners(rows, groups, about.score, about.labels)
    factors = {name: own for name, own in find_varying_factors(groups, about.levels).items() if name != "version"}
    chosen = [name for name in factors if name in about.choices]
    chosen = chosen or (list(factors) if threshold else [])
    levels = find_levels(groups, metrics[0], factors, threshold)
    choices = find_choices(groups, metrics[0], chosen, threshold) if chosen else []
    return Comparison(baseline, every, groups, metrics, answers, levels, choices, scored)
