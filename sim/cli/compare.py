"""`understory compare`."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planning.catalogue import COMPARED
from planning.planner_loading import load_planner
from sim.scenario.loading import SCENARIOS, STUDY_TABLES
from sim.scenario.quantities import REPEATS, WORKERS, parse_duration, parse_integer, parse_integers, parse_number
from sim.scenario.text_files import read_toml
from sim.study.analysis.levels import Threshold
from sim.study.analysis.metric_choice import find_outside_metrics, find_shown_metric
from sim.study.cells import add_trackers, parse_factor
from sim.study.definition import STUDIES, Study, adapt_study, read_study
from sim.study.executors import Pool, connect
from sim.study.report.comparison import make_about
from sim.study.report.terminal import show_study
from sim.study.scheduler import Options
from sim.study.store import choose_folder
from sim.study.study_flight import fly_study
from sim.study.trials import list_trials
from sim.terminal.commands import Duration, Overrides, Timeout, merge_overrides
from sim.terminal.console import print_remarks
from tracking.errors import InputError, check_known
from tracking.fusion.member import TRACKERS

_Entered = Annotated[
    str, typer.Argument(metavar="STUDY", help="A packaged study (see `understory studies`), study file, or scenario.")
]
_Planners = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help=f"A planner; repeat for each. Default: the study's, or {', '.join(COMPARED)}."),
]
_Trackers = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="A tracker, flown with each planner; repeat for more. Default: the study's."),
]
_Scenarios = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="One of a study's scenarios; repeat for more. Default: all."),
]
_Seeds = Annotated[
    str | None,
    typer.Option(metavar="LIST", help="Seeds that every planner flies: 0-9 or 0,3,7. Default: the study's, or 0-9."),
]
_Repeats = Annotated[
    str | None,
    typer.Option(metavar="K", help="Number of flights on each map, with other noise. Default: the study's, or 1."),
]
_Out = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Folder of results; trials in it are not flown again. Default: one under runs/."),
]
_Baseline = Annotated[
    str | None, typer.Option(metavar="NAME", help="The planner that others are compared with. Default: the first.")
]
_Labels = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=PLANNER", help="A short name for a planner in tables and figures; repeatable."),
]
_Metrics = Annotated[
    list[str] | None, typer.Option(metavar="NAME", help="What to compare, see docs/how-to/studies.md; repeatable.")
]
_Vary = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=LEVELS",
        help="Compare levels of a setting, of planner.OPTION or of scenario: network.loss=0,0.5 or fleet.size=1-6; "
        "repeatable.",
    ),
]
_AtLeast = Annotated[
    str | None,
    typer.Option(metavar="METRIC=VALUE", help="Find the cheapest levels that reach a value, such as share_held=0.9."),
]
_AtMost = Annotated[
    str | None, typer.Option(metavar="METRIC=VALUE", help="The same for an upper bound, such as gospa.mean_m=2.")
]
_Workers = Annotated[str | None, typer.Option(metavar="N", help="Number of processes that fly. Default: one per core.")]
_Dask = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Fly on a dask cluster, such as tcp://host:8786.")]
_Keep = Annotated[str | None, typer.Option(metavar="WHAT", help="recordings: keep each trial's mission.npz.")]
_Redo = Annotated[bool, typer.Option("--redo", help="Fly trials that have results again, and replace these.")]


def compare(
    context: typer.Context,
    study: _Entered = "forest",
    planner: _Planners = None,
    tracker: _Trackers = None,
    scenario: _Scenarios = None,
    seeds: _Seeds = None,
    repeats: _Repeats = None,
    duration: Duration = None,
    overrides: Overrides = None,
    out: _Out = None,
    baseline: _Baseline = None,
    label: _Labels = None,
    vary: _Vary = None,
    at_least: _AtLeast = None,
    at_most: _AtMost = None,
    metric: _Metrics = None,
    workers: _Workers = None,
    dask: _Dask = None,
    timeout: Timeout = None,
    keep: _Keep = None,
    redo: _Redo = False,
) -> None:
    """Compare planners or trackers on the same forests, people and seeds. Started again, it flies what is missing."""
    changes = merge_overrides(overrides, duration)
    number = None if repeats is None else parse_integer(repeats, "--repeats", least=1, most=REPEATS)
    for name in planner or ():
        load_planner(name)
    for name in tracker or ():
        replace(TRACKERS, field="--tracker").find(name)
    if seeds is not None:
        parse_integers(seeds, "--seeds")
    chosen = adapt_study(
        add_trackers(_find_study(study), tracker or ()),
        planners=planner or (),
        scenarios=scenario or (),
        seeds=seeds,
        repeats=number,
        overrides=changes,
        vary=dict(map(parse_factor, vary or ())),
    )
    threshold = _read_threshold(at_least, at_most)
    processes = _read_workers(workers, dask)
    limit = None if timeout is None else parse_duration(timeout, "--timeout")
    if keep is not None:
        check_known("--keep", keep, ["recordings"])
    bounded = (threshold.metric,) if threshold else ()
    trials = list_trials(chosen, find_outside_metrics([*bounded, *(metric or ())]))
    about = make_about(chosen, trials, baseline=baseline, labels=label or (), metrics=metric or (), threshold=threshold)
    default = Path("runs") / chosen.name
    folder = out or choose_folder(default, chosen.name, trials)
    if folder not in (out, default):
        print_remarks(f"{default} holds other results; those of this comparison go into {folder}")
    options = Options(limit, None if keep is None else folder / "recordings", redo)
    executor = connect(dask) if dask is not None else context.obj.executor or Pool(processes, limit)
    show_study(fly_study(chosen, trials, folder, executor, options), folder, about)


def _read_threshold(at_least: str | None, at_most: str | None) -> Threshold | None:
    """The threshold of either option, at most one of which is given; None if neither is."""
    if at_least is not None and at_most is not None:
        raise InputError("--at-most: not allowed together with --at-least")
    given = at_most if at_least is None else at_least
    if given is None:
        return None
    option = "--at-most" if at_least is None else "--at-least"
    name, _, text = (part.strip() for part in given.rpartition("="))
    value = parse_number(text)
    if not name or math.isnan(value):
        raise InputError(f"{option}: {given!r} is not of the form metric=value, for instance share_held=0.9")
    find_outside_metrics([name])
    metric = find_shown_metric(name)
    if not metric.least <= value <= metric.most:
        raise InputError(f"{option}: {name}={text} is not allowed; expected {metric.least:g} to {metric.most:g}")
    wrong = "higher" if at_least is None else "lower"
    if metric.better == wrong:
        other = "--at-least" if at_least is None else "--at-most"
        raise InputError(f"{option}: of {name}, {wrong} is better; use {other}")
    return Threshold(name, value, at_least is not None)


def _find_study(name: str) -> Study:
    """A packaged study, a study file, or a study made of a scenario."""
    is_file = name.endswith(".toml")
    if name in STUDIES or (is_file and _is_study(Path(name))):
        return read_study(name)
    if not is_file:
        check_known("study", name, [*STUDIES, *SCENARIOS], " (or a .toml file)")
    return Study(name="compare", planners=COMPARED, scenarios=(name,))


def _is_study(path: Path) -> bool:
    """True for the file of a study, False for that of a scenario; a missing file counts as the packaged one's kind."""
    return bool({*STUDY_TABLES} & {*read_toml(path, "study")}) if path.is_file() else path.stem in STUDIES


def _read_workers(workers: str | None, dask: str | None) -> int | None:
    if workers is None:
        return None
    if dask is not None:
        raise InputError("--workers: not allowed together with --dask, whose cluster has workers of its own")
    return parse_integer(workers, "--workers", least=1, most=WORKERS)
