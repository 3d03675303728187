"""Flights of a study for `understory compare`, which can be interrupted and continued, and their results."""

import shlex
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import msgspec
from rich.markup import escape

from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.machine import list_versions
from sim.mission.trial import Trial, prefix_errors
from sim.mission.world_setup import make_forest_and_people
from sim.running.fly import fly, is_built_in
from sim.scenario.loading import place_of
from sim.scenario.random_streams import format_seed
from sim.scenario.remarks import find_remarks
from sim.study.analysis.normalised_score import find_score_ends
from sim.study.analysis.planner_labels import find_baseline, format_entrant, parse_labels
from sim.study.backends import Backend, Pool, connect
from sim.study.cells import COMPARED_FACTORS
from sim.study.report.report import About, write
from sim.study.report.terminal import show
from sim.study.scheduler import Options, complete
from sim.study.store import NAME, Store, StoreError
from sim.study.study import Study
from sim.study.tasks import Row, Task
from sim.terminal.console import console, fail, print_remarks
from sim.terminal.progress import show_study_progress
from sim.world.recorded_people import describe_trajectories
from sim.world.stem_map import find_unused_columns
from tracking.errors import InputError, check_known


def make_facts(
    study: Study, listed: Sequence[Task], *, baseline: str | None, labels: Sequence[str], metrics: tuple[str, ...]
) -> About:
    """Facts for the report of a study; InputError if they name planners or metrics that its trials will not have."""
    given = parse_labels(listed, labels)
    find_baseline(listed, baseline, given)
    if study.score:
        find_score_ends(listed, study.score, given)
        check_known(study.at("score.metric"), study.score.metric, [*METRICS, *metrics])
    return About(study.name, study.description, baseline=baseline, labels=given, metrics=metrics, score=study.score)


def fly_study(
    study: Study, listed: Sequence[Task], folder: Path, options: Options, workers: int | None, dask: str | None
) -> list[Row]:
    """Fly a study and return the rows of all trials; on failure, exit with a message on how to continue."""
    print_remarks(*dict.fromkeys(line for task in listed for line in find_remarks(task.setting)))
    kept: int | None = None
    again = 0
    try:
        new = not (folder / NAME).exists()
        if new:  # checked before any file is written
            _check_missions(study, listed)
        with _open_backend(workers, dask) as backend, Store.open(folder, study.name) as store:
            if not new:
                flown = {} if options.redo else store.read_finished_rows(listed)
                _check_missions(study, [task for task in listed if task.key not in flown])
            maps = dict.fromkeys(task.setting.trees for task in listed)
            files = {(task.setting.people, task.setting.area): task.setting for task in listed}
            remarks = [line for trees in maps for line in find_unused_columns(trees)]
            remarks += [line for setting in files.values() for line in describe_trajectories(setting)[1]]
            print_remarks(*dict.fromkeys(remarks), *_list_remarks_on_others(store, listed))
            with show_study_progress(len(listed)) as progress:

                def on_row(task: Task, row: Row, fresh: bool) -> None:
                    nonlocal again
                    again += fresh
                    progress.count(row.status == "failed", fresh)

                try:
                    return complete(listed, store, backend, options, on_row, progress.wait)
                except (KeyboardInterrupt, StoreError):
                    kept = len(store.read_finished_rows(listed))
                    raise
    except (KeyboardInterrupt, StoreError) as error:
        reason = str(error) or "interrupted"
    if kept is None:
        fail(f"{reason}; no trial was flown, {folder} is unchanged", code=1)
    if options.redo:
        rest = f"{kept} are there; without --redo, the same command flies what is missing"
        fail(f"{reason}; {again} of {len(listed)} trials were flown now, in {folder} {rest}", code=1)
    fail(f"{reason}; {kept} of {len(listed)} trials are kept in {folder}, the same command flies the rest", code=1)


def _check_missions(study: Study, listed: Sequence[Task]) -> None:
    """InputError, with file and levels, if a mission cannot be built with the first seed of a setting or planner.

    Without plug-ins from outside, only forest and people can be wrong, and no mission is built.
    """
    first = {(msgspec.json.encode(task.setting), task.planner): task for task in reversed(listed)}
    tried: set[bytes | str] = set()  # settings and planners
    for (setting, planner), task in first.items():
        trial = Trial(task.setting, planner, task.seed, place=_name_place(study, task))
        ours = is_built_in(trial)
        parts: set[bytes | str] = {setting} if ours else {setting, planner}
        if parts <= tried:
            continue
        tried |= parts
        if ours:
            with prefix_errors(trial.place):
                make_forest_and_people(trial.scenario, trial.seed)
        else:
            fly(trial).mission.close()


def _name_place(study: Study, task: Task) -> str:
    """Beginning of an error about a task's setting: the study's file, the levels and the scenario."""
    levels = [f"factors.{f}.{level}" for f, level in task.factors if f in study.factors.keys() - {*COMPARED_FACTORS}]
    several = f"scenario {task.scenario}: " * (len(study.scenarios) > 1)
    place = "".join(f"{part}: " for part in (study.file, ", ".join(levels)) if part)
    return f"{place}{place_of(task.scenario, task.settings) or several}"


def _open_backend(workers: int | None, dask: str | None) -> AbstractContextManager[Backend]:
    return Pool(workers) if dask is None else connect(dask)


def _list_remarks_on_others(store: Store, listed: Sequence[Task]) -> list[str]:
    """Remarks on results in the store of other package versions or other trials, which are not shown."""
    others = store.count_others(listed)
    rest = others.pop(listed[0].version, 0)
    text = ", ".join(f"{count} of version {version}" for version, count in others.items())
    notes = [f"{store.path}: trials of another version are kept apart, not shown: {text}"] if others else []
    if rest:
        trials = f"{rest} trial{'s' * (rest != 1)}"
        notes.append(f"{store.path}: kept, not shown: {trials} of other planners, code, scenarios, settings or seeds")
    return notes


def show_study(rows: Sequence[Row], folder: Path, about: About) -> None:
    """Print tables and write the report; exit with code 1 if that fails or trials have failed."""
    command = shlex.join(["understory", *sys.argv[1:]])
    wall = sum(row.metrics.get("wall_s", 0.0) for row in rows)
    try:
        write(rows, folder, replace(about, command=command, versions=list_versions(), wall_s=wall))
        show(rows, about)  # last, because the reader of a pipe may close it
    except (KeyboardInterrupt, InputError) as error:  # names were checked before, so the disk may be full
        reason = str(error) or "interrupted"
        fail(f"{reason}; all {len(rows)} trials are kept in {folder}, the same command writes the report", code=1)
    failures = [row for row in rows if row.status == "failed"]
    missing = "; the same command flies again what failed" if failures else ""
    console.print(f"Results in [bold]{escape(str(folder))}[/bold] (report.html){missing}.", soft_wrap=True)
    if failures:
        first = failures[0]
        place = f"{format_entrant(first)}, {format_seed(first.seed, first.repeat)}"
        fail(f"{len(failures)} of {len(rows)} trials failed, {place}: {first.error}", code=1)
