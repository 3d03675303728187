"""The flight of a study into its folder, which can be interrupted and continued."""

from collections import Counter
from collections.abc import Hashable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from pathlib import Path

import msgspec

from sim.mission.trial import Trial, prefix_errors
from sim.mission.world_setup import find_scenario_remarks, make_forest_and_people
from sim.running.fly import fly, is_built_in
from sim.scenario.loading import place_of
from sim.study.cells import COMPARED_FACTORS, list_lone_keys
from sim.study.definition import Study
from sim.study.scheduler import Options, complete
from sim.study.store import NAME, Store, StoreError
from sim.study.trials import StudyTrial, TrialPlace, TrialRow
from sim.terminal.console import fail, print_remarks
from sim.terminal.progress import show_study_progress


def fly_study(
    study: Study,
    trials: Sequence[StudyTrial],
    folder: Path,
    executor: AbstractContextManager[Executor],
    options: Options,
) -> list[TrialRow]:
    """Fly what is missing of a study into its folder, new or that of an earlier flight; return the rows of all trials.

    The executor is opened when the missions are known to be sound, and closed at the end. InputError if a mission
    cannot be built, or the folder cannot be used. On any other failure it exits with a line on how to continue.
    """
    kept: int | None = None
    again = 0
    try:
        new = not (folder / NAME).exists()
        if new:  # checked before any file is written
            _check_missions(study, trials)
        with executor as flying, Store.open(folder, study.name) as store:
            if not new:
                flown = {} if options.redo else store.read_finished_rows(trials)
                _check_missions(study, [trial for trial in trials if trial.key not in flown])
            settings = {msgspec.json.encode(trial.setting): trial.setting for trial in trials}
            doubts = [line for setting in settings.values() for line in find_scenario_remarks(setting).doubts]
            print_remarks(*dict.fromkeys([*list_lone_keys(study), *doubts]), *_list_remarks_on_others(store, trials))
            with show_study_progress(Counter(map(_find_cell, trials))) as show:

                def on_row(row: TrialRow, fresh: bool) -> None:
                    nonlocal again
                    again += fresh
                    show(_find_cell(row), row.metrics.get("wall_s"), fresh)

                try:
                    return complete(trials, store, flying, options, on_row)
                except (KeyboardInterrupt, StoreError):
                    kept = len(store.read_finished_rows(trials))
                    raise
    except (KeyboardInterrupt, StoreError) as error:
        reason = str(error) or "interrupted"
    if kept is None:
        fail(f"{reason}; no trial was flown, {folder} is unchanged", code=1)
    if options.redo:
        rest = f"{kept} are there; without --redo, the same command flies what is missing"
        fail(f"{reason}; {again} of {len(trials)} trials were flown now, in {folder} {rest}", code=1)
    fail(f"{reason}; {kept} of {len(trials)} trials are kept in {folder}, the same command flies the rest", code=1)


def _find_cell(trial: TrialPlace) -> Hashable:
    """What trials of about the same length share."""
    return trial.scenario, trial.factors, trial.planner


def _check_missions(study: Study, trials: Sequence[StudyTrial]) -> None:
    """InputError, with file and levels, if a mission cannot be built with the first seed of a setting or planner.

    Without plug-ins from outside, only forest and people can be wrong, and no mission is built.
    """
    first = {(msgspec.json.encode(trial.setting), trial.planner): trial for trial in reversed(trials)}
    tried: set[bytes | str] = set()  # settings and planners
    for (setting, planner), trial in first.items():
        mission = Trial(trial.setting, planner, trial.seed, place=_name_place(study, trial))
        ours = is_built_in(mission)
        parts: set[bytes | str] = {setting} if ours else {setting, planner}
        if parts <= tried:
            continue
        tried |= parts
        if ours:
            with prefix_errors(mission.place):
                make_forest_and_people(mission.scenario, mission.seed)
        else:
            fly(mission).mission.close()


def _name_place(study: Study, trial: StudyTrial) -> str:
    """Beginning of an error about a trial's setting: the study's file, the levels and the scenario."""
    levels = [f"factors.{f}.{level}" for f, level in trial.factors if f in study.factors.keys() - {*COMPARED_FACTORS}]
    several = f"scenario {trial.scenario}: " * (len(study.scenarios) > 1)
    place = "".join(f"{part}: " for part in (study.file, ", ".join(levels)) if part)
    return f"{place}{place_of(trial.scenario, trial.settings) or several}"


def _list_remarks_on_others(store: Store, trials: Sequence[StudyTrial]) -> list[str]:
    """Remarks on results in the store of other package versions or other trials, which are not shown."""
    others = store.count_others(trials)
    rest = others.pop(trials[0].version, 0)
    text = ", ".join(f"{count} of version {version}" for version, count in others.items())
    notes = [f"{store.path}: trials of another version are kept apart, not shown: {text}"] if others else []
    if rest:
        counted = f"{rest} trial{'s' * (rest != 1)}"
        notes.append(f"{store.path}: kept, not shown: {counted} of other planners, code, scenarios, settings or seeds")
    return notes
